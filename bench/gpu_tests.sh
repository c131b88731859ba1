#!/usr/bin/env bash
# Runs the tests on a machine with an NVIDIA GPU, all modules side by side, and sums them up in bench/gpu_tests.txt.
#   bench/gpu_tests.sh BUILD_FOLDER COMMIT [OUTPUT]   (GPU_TEST_MODULES="mpm rom": these alone)
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=${1:?build folder} commit=${2:?commit} output=${3:-bench/gpu_tests.txt}
export GOMP_SPINCOUNT=${GOMP_SPINCOUNT:-2000}
modules=${GPU_TEST_MODULES:-core sparsegrid mpm graph rom train apps}
logs=$(mktemp -d)
for module in $modules; do
  filter='-*Slow*:ExportedSymbols*'  # the latter read object files, which may not have come with the programs
  [ $module = apps ] && filter='*Gpu'
  [ $module = rom ] && filter='*Cuda*'
  (
    # The longest one has the last GPU to itself where there are several.
    [ $module = mpm ] && export CUDA_VISIBLE_DEVICES=$(($(nvidia-smi --list-gpus | wc -l) - 1))
    timeout "${GPU_TEST_LIMIT:-900}" "$build/${module}_test" --gtest_filter="$filter" > "$logs/$module" 2>&1
    echo $? > "$logs/$module.status"
  ) &
done
wait
{
  echo "commit  $commit"
  nvidia-smi --query-gpu=name,driver_version --format=csv,noheader | sed 's/^/gpu     /; s/, /\ndriver  /' | head -2
  echo "command bench/gpu_tests.sh"
  for module in $modules; do
    echo
    echo "== ${module}_test: exit code $(cat "$logs/$module.status")"
    grep -E '^\[ +(PASSED|FAILED|SKIPPED) +\]' "$logs/$module" | sort -u
    grep -E '^\[ +OK \] .*(Gpu|GPU|Cuda|CUDA|cuda|Device)' "$logs/$module"
    [ "$(cat "$logs/$module.status")" = 0 ] || { grep -A 5 -E ': Failure$' "$logs/$module" | cut -c 1-300 | head -n 60; tail -n 5 "$logs/$module"; }
  done
} | sed "s#$PWD/##g" > "$output"
rm -r "$logs"
cat "$output"
