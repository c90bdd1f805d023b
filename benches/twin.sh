#!/usr/bin/env bash
# Measured data by another engine: the coarse study's tests in LIGGGHTS (Debian's package), measured by `granulake measure`.
#
#   benches/twin.sh [FOLDER]      20 repetitions (5 of the hopper) of control, cohesive and capillary: about 4 CPU-minutes
#
# FOLDER (target/twin when left out) keeps every run: killed and started again, it continues. At the end it holds
# control.csv, cohesive.csv and capillary.csv, as they stand in artifacts/measured/liggghts. What is converted, what
# differs and what the diagnosis says: docs/twin.md.
#
#   SETS="control" N=100 benches/twin.sh FOLDER       other sets, repetitions
#   ROLLING=epsd2 SLOWER=4 benches/twin.sh FOLDER     one factor: law of rolling, time step over 4 (also WALL_ROLLING)
#   SLIDING_DASHPOT=off ROLLING_DASHPOT=off           between grains
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:-target/twin}
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
deck=$PWD/benches/twin/in.twin
# theta*: inside the bounds, no design point; at this rolling friction `epsd` has our rolling stiffness (docs/twin.md).
theta=(sliding_friction=0.4 rolling_friction=0.35635 particle_density=2700)

if ! command -v liggghts >/dev/null; then
  apt-get update -qq && apt-get install -y -qq --no-install-recommends liggghts >&2
fi
if [ -z "${GRANULAKE:-}" ]; then
  cargo build --release --quiet --no-default-features
  GRANULAKE=${CARGO_TARGET_DIR:-target}/release/granulake
fi
if [ -z "${TWIN:-}" ]; then
  built=$(cargo bench --no-default-features --no-run --bench twin --message-format=json)
  TWIN=$(grep -o '"executable":"[^"]*/twin-[^"]*"' <<<"$built" | tail -n 1 | cut -d '"' -f 4)
fi
export OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1

# One run: set, experiment, repetition. grains.csv and flow.csv stay.
simulate() {
  local run=$folder/$1/$2/$3 cohesion=off walls=off seed=7000000
  [ -e "$run/grains.csv" ] && return
  case $1 in
    cohesive) cohesion=sjkr walls=sjkr seed=7100000 ;;
    # Its walls are dry: with liquid on them LIGGGHTS crashes.
    capillary) cohesion=easo/capillary/viscous seed=7200000 ;;
  esac
  rm -rf "$run"
  "$TWIN" pipeline.toml "$2" $((seed + $3)) "$run" "${theta[@]}"
  [ "${ROLLING_DASHPOT:-on}" = on ] ||
    sed -i -E '/^fix coefficientRollingViscousDamping/ s/ [0-9.]+e-1/ 0/g' "$run/materials.in"
  (cd "$run" && nice -n 5 liggghts -in "$deck" -var rolling "${ROLLING:-epsd}" -var wall_rolling "${WALL_ROLLING:-epsd2}" \
    -var cohesion $cohesion -var wall_cohesion $walls -var slower "${SLOWER:-1}" \
    -var sliding_dashpot "${SLIDING_DASHPOT:-on}" >log 2>&1) ||
    { echo "LIGGGHTS failed, see $run/log" >&2; exit 1; }
  cp "$run/flow.txt" "$run/flow.csv"
  { echo 'x [m],y [m],z [m],radius [m],vx [m/s],vy [m/s],vz [m/s]'
    [ ! -e "$run/grains.txt" ] || sed '1,/^ITEM: ATOMS/d; s/ *$//; s/ /,/g' "$run/grains.txt"; } >"$run/grains.part"
  rm -f "$run"/{grains.txt,flow.txt,log.liggghts,grains.data,*.in,*.stl}
  mv "$run/grains.part" "$run/grains.csv"
}

# Rows of one test of a set, repetitions in their order.
measure() {
  local grains=() flows=() set=() k # the hopper is empty at the end
  for k in $(seq 1 "$3"); do
    grains+=("$folder/$1/$2/$k/grains.csv")
    flows+=("$folder/$1/$2/$k/flow.csv")
  done
  [ "$2" = hopper ] || set+=(--particles "${grains[@]}")
  [ "$2" = bulk_density ] || set+=(--flow "${flows[@]}")
  for k in "${theta[@]}"; do set+=(--set "$k"); done
  # 4: some observable has no value and is left out, as where an arch stands over the slot.
  { "$GRANULAKE" measure "$2" "${set[@]}" --csv || [ $? = 4 ]; } | tail -n +2
}

for name in ${SETS:-control cohesive capillary}; do
  for experiment in pile ledge bulk_density hopper; do
    count=${N:-20}
    [ $experiment = hopper ] && count=${HOPPERS:-5}
    for k in $(seq 1 "$count"); do simulate "$name" $experiment "$k"; done
  done
  { echo "# LIGGGHTS $(dpkg-query -W -f '${Version}' liggghts 2>/dev/null || echo unknown), benches/twin.sh, set $name; see README.md"
    echo experiment,repetition,kpi,value,unit
    for experiment in pile ledge bulk_density; do measure "$name" $experiment "${N:-20}"; done
    [ "${HOPPERS:-5}" = 0 ] || measure "$name" hopper "${HOPPERS:-5}"; } >"$folder/$name.part"
  mv "$folder/$name.part" "$folder/$name.csv"
  echo "$folder/$name.csv"
done
