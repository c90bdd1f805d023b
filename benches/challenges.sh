#!/usr/bin/env bash
# How often the verdict is right, in two layers, each rate with its exact 95 % interval:
# (a) measured sets drawn from pools of stored runs, calibrated and diagnosed; (b) sealed challenges end to end.
#
#   benches/challenges.sh [--quick] [FOLDER]
#
# Runs, tables and results stay in FOLDER (target/challenges when left out): killed and started again, it continues.
# --quick: one place in the parameter space, one panel, pools of 200 runs, 60 sets a cell, n = 20, four challenges.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
pool=2000 sets=1000 counts=10,20,50 places=A,B panels=5 blind=60
candidates='["cohesion", "wall_friction_scatter", "size_distribution", "fill_level", "tilt"]'
if [ "${1:-}" = --quick ]; then
  shift
  pool=200 sets=60 counts=20 places=A panels=1 blind=4
  candidates='["cohesion", "wall_friction_scatter", "size_distribution"]'
fi
folder=${1:-target/challenges}
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)

cargo build --release --quiet
granulake() { "${CARGO_TARGET_DIR:-$root/target}/release/granulake" --study "$folder/pipeline.toml" "$@"; }
sed -e "s/^candidates = .*/candidates = $candidates/" -e 's/^bootstrap = .*/bootstrap = 500/' \
  -e 's|path = "artifacts/measured/demo/|path = "measured/demo/|; s|path = "artifacts/measured/|path = "measured/|' \
  pipeline.toml >"$folder/pipeline.toml"
cp -r artifacts/measured "$folder/"
granulake repro train >/dev/null

echo "## (a) drawn sets: pools of $pool runs per truth and test, $sets sets a cell, $panels panels"
cargo bench --quiet --bench challenges -- "$folder" "$pool" "$sets" "$counts" "$places" "$panels" all,kpis,without

echo
echo "## (b) $blind sealed challenges end to end"
# none, then the candidates in turn; cohesion at Bond number 1 with n = 20 is the first that hides something.
names=(none cohesion size_distribution random)
solved=()
for number in $(seq 1 "$blind"); do
  name=${names[$(( (number - 1) % 4 ))]}
  dir=$folder/blind-$number
  strength=()
  [ "$name" = cohesion ] && strength=(--strength 1)
  [ -e "$dir/sealed.toml" ] || granulake challenge new --seed "$((500 + number))" --effect "$name" "${strength[@]}" --n 20 \
    --out "$dir" 2>/dev/null
  [ -e "$dir/solution/tables/verdicts/verdicts.parquet" ] || granulake challenge solve "$dir"
  solved+=("$dir")
done
granulake challenge score "${solved[@]}"
