#!/usr/bin/env bash
# The groups of a comparison side by side on a machine with many cores, then the speeds alone.
#   tests/golden/groups.sh BUILD REFERENCE_BUILD REFERENCE_SOURCE OUTPUT_FOLDER [cpu|cuda]
# OUTPUT_FOLDER/<group>.txt holds the rows, <group>.json the same for programs. Set GOLDEN_LIMIT to the seconds that a
# group may take (default 550), GOLDEN_SPEEDS=0 to leave the speeds out.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
build=${1:?build folder} reference=${2:?build of the reference} source=${3:?source of the reference}
out=${4:?output folder} device=${5:-cpu}
mkdir -p "$out"
compare() { # GROUP ARGUMENTS...
  local group=$1
  shift
  timeout "${GOLDEN_LIMIT:-550}" /usr/bin/env python3 -u tests/golden/compare_builds.py --build "$build" --reference-build "$reference" \
    --reference-source "$source" --device "$device" --json "$out/$group.json" "$@" > "$out/$group.txt" 2>&1
  echo "$group: exit code $?, $(tail -n 1 "$out/$group.txt")"
}
cores=$(nproc)
half=$((cores > 7 ? cores / 4 : 1))
share() { # NUMBER GROUP ARGUMENTS...: on a quarter of the cores
  local first=$((($1 * half) % cores))
  shift
  (taskset -cp "$first-$((first + half - 1))" "$BASHPID" > /dev/null; compare "$@") &
}
share 0 mpm_f32_sets --only 'mpm/*/f32/*'
share 2 mpm_f32_forms --only 'mpm/*/f32'
share 1 mpm_f64 --only 'mpm/*/f64*'
share 2 rollouts --only 'rollout/*'
share 3 reduced --only 'reduced/*' --only 'fit/*'
share 0 training --only 'train/*'
share 1 data --only 'generate*' --only 'data*' --only 'convert*' --only 'interface*'
if [ "$device" = cuda ]; then
  share 2 gpu_mpm --only 'gpu/mpm/*'
  share 3 gpu_rollouts --only 'gpu/rollout/*'
  share 0 gpu_training --only 'gpu/train/*'
fi
wait
[ "${GOLDEN_SPEEDS:-1}" = 0 ] || compare speeds --only 'speed/*'
