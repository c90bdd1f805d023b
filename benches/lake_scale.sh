#!/usr/bin/env bash
# How the lake behaves with N finished runs (19050 when left out) at POINTS design points (127) in three experiments; the
# runs are made up and not simulated. Prints wall seconds and peak memory of the steps; the last line is
# `noop_s=… status_s=… query_s=…`, each the median of five.
set -euo pipefail
cd "$(dirname "$0")/.."
runs=${1:-19050}
points=${2:-127}
repetitions=$((runs / (3 * points)))
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

cargo build --release --quiet
fill() { cargo bench --quiet --bench lake_scale -- "$folder" "$@" | tail -1; }
granulake() { ./target/release/granulake --study "$folder/pipeline.toml" "$@"; }
seconds() { # of a command, wall
  local start end
  start=$(date +%s%N)
  "$@" >"$folder/out" 2>"$folder/err" || [ $? -eq 3 ] || { cat "$folder/err" >&2; exit 1; }
  end=$(date +%s%N)
  echo "$start $end" | awk '{ printf "%.3f\n", ($2 - $1) / 1e9 }'
}
median() { for _ in 1 2 3 4 5; do seconds "$@"; done | sort -n | sed -n 3p; }
peak() { # MiB of granulake with these arguments, where GNU time is installed
  [ -x /usr/bin/time ] || { echo "?"; return; }
  /usr/bin/time -o "$folder/peak" -f %M ./target/release/granulake --study "$folder/pipeline.toml" "$@" >"$folder/out" 2>"$folder/err"
  awk '{ printf "%.0f", $1 / 1024 }' "$folder/peak"
}
step() { echo "$1: $(seconds granulake "${@:2}") s"; }

fill "$runs" "$points"
step "all tables made from the ledgers" repro aggregate
noop=$(median granulake repro aggregate)
status=$(median granulake status)
query=$(median granulake query "SELECT experiment, avg(value) AS mean FROM kpis GROUP BY experiment")
echo "peak memory of the no-op: $(peak repro aggregate) MiB"
step "plan of one repetition more" plan simulate --reps $((repetitions + 1))
echo "its peak memory: $(peak plan simulate --reps $((repetitions + 1))) MiB"
fill more
step "repro aggregate once that repetition is simulated" repro aggregate
fill more
echo "peak memory of the same once more: $(peak repro aggregate) MiB"
echo "noop_s=$noop status_s=$status query_s=$query"
