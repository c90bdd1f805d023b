#!/usr/bin/env bash
# How the lake behaves with N finished runs (19050 when left out), which are made up and not simulated.
# Prints wall seconds of the steps; the last line is `noop_s=… status_s=… query_s=…`, each the median of five.
set -euo pipefail
cd "$(dirname "$0")/.."
runs=${1:-19050}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

cargo build --release --quiet
cargo bench --quiet --bench lake_scale -- "$folder" "$runs" | tail -1
granulake() { ./target/release/granulake --study "$folder/pipeline.toml" "$@"; }
seconds() { # of a command, wall
  local start end
  start=$(date +%s%N)
  "$@" >"$folder/out" 2>"$folder/err" || [ $? -eq 3 ] || { cat "$folder/err" >&2; exit 1; }
  end=$(date +%s%N)
  echo "$start $end" | awk '{ printf "%.3f\n", ($2 - $1) / 1e9 }'
}
median() { for _ in 1 2 3 4 5; do seconds "$@"; done | sort -n | sed -n 3p; }

echo "repro aggregate, tables made from the ledgers: $(seconds granulake repro aggregate) s"
noop=$(median granulake repro aggregate)
status=$(median granulake status)
query=$(median granulake query "SELECT experiment, avg(value) AS mean FROM kpis GROUP BY experiment")
peak=$( { command -v /usr/bin/time >/dev/null && /usr/bin/time -f %M ./target/release/granulake \
  --study "$folder/pipeline.toml" repro aggregate 2>&1 >/dev/null | tail -1; } || echo 0)
echo "one repetition more, plan: $(seconds granulake plan simulate --reps $((runs / 381 + 1))) s; peak memory of the no-op: $((peak / 1024)) MiB"
echo "noop_s=$noop status_s=$status query_s=$query"
