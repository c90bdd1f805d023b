#!/bin/sh
# One-factor runs of the density test, for the table in docs/physics.md.
#
#   benches/density_factors.sh [repetitions] [name ...]
#
# Prints one line per factor: solid fraction (mean, sd), coordination number, runs. Without names every factor runs.
# GRANULAKE is the binary, target/release/granulake by default; STIFFNESS the stiffness over the paper's, 0.1 by default.
set -eu
cd "$(dirname "$0")/.."
granulake=${GRANULAKE:-target/release/granulake}
stiffness=${STIFFNESS:-0.1}
repetitions=${1:-10}
[ $# -eq 0 ] || shift
# gamma of a constant dashpot keeps its damping ratio when the stiffness changes: gamma ~ sqrt(k).
gamma=$(awk "BEGIN { printf \"%.4g\", 0.3 * sqrt($stiffness) }")
wanted=" $* "

# factor NAME SETTING...
factor() {
    name=$1
    shift
    case $wanted in "  " | *" $name "*) ;; *) return 0 ;; esac
    # What is compared with: damping as a ratio, deletion by centre; a later --set overrides an earlier one.
    set -- $(printf -- '--set %s ' "stiffness_scale=$stiffness" damping_reading=pair_ratio deletion_reference=centre "$@")
    for seed in $(seq "$repetitions"); do
        "$granulake" --study studies/fransen2022.toml sim bulk_density --json --seed "$seed" "$@"
    done | awk -v name="$name" -v density=2750 '
        function number(key) { match($0, "\"" key "\":[-0-9.e]+"); return substr($0, RSTART + length(key) + 3, RLENGTH - length(key) - 3) }
        {
            match($0, "\"bulk_density\":{[^}]*}"); $0 = substr($0, RSTART, RLENGTH) $0
            match($0, "\"value\":[-0-9.e]+"); phi = substr($0, RSTART + 8, RLENGTH - 8) / density
            n++; sum += phi; square += phi * phi; contacts += number("coordination_number")
        }
        END {
            mean = sum / n; sd = n > 1 ? sqrt((square - n * mean * mean) / (n - 1)) : 0
            printf "%-24s phi %.4f sd %.4f  contacts %.2f  n %d\n", name, mean, sd, contacts / n, n
        }'
}

low="sliding_friction=0.1 rolling_friction=0.1"
high="sliding_friction=0.9 rolling_friction=0.9"
regression="sliding_friction=0.5513 rolling_friction=0.4885"
interpolation="sliding_friction=0.5198 rolling_friction=0.1996"
constant="damping_reading=constant damping=$gamma"

# shellcheck disable=SC2086 # settings are words
{
    for corner in low high regression interpolation; do
        eval "friction=\$$corner"
        factor "$corner" $friction
        factor "$corner-constant" $friction $constant
    done
    for corner in low high; do
        eval "friction=\$$corner"
        factor "$corner-constant-top" $friction $constant deletion_reference=top
        factor "$corner-constant-1e-3" $friction $constant insertion_step=1e-3
    done
    factor high-mean-particle $high damping_reading=mean_particle
    factor high-smallest-grain $high damping_reading=mean_particle damping=0.134
    factor high-per-mass $high damping_reading=per_mass
    factor high-restitution $high damping_reading=restitution
    factor high-insertion-1e-3 $high insertion_step=1e-3
    factor high-insertion-1e-5 $high insertion_step=1e-5
    factor high-half-rolling sliding_friction=0.9 rolling_friction=0.45
    factor high-no-rolling sliding_friction=0.9 rolling_friction=0
    factor high-soft-rolling $high rolling_stiffness_ratio=0.0714
    factor high-half-step $high time_step_fraction=0.05
    factor high-smooth-wall $high wall_friction_steel_sliding=0
    factor high-wall-rolls $high wall_rolling_ratio=0
    factor high-cut $high bulk_density.count=cut
    factor high-softer $high stiffness_scale=0.01
}
