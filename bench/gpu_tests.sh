#!/usr/bin/env bash
# Runs the tests on a machine with an NVIDIA GPU, all modules side by side, and sums them up in bench/gpu_tests.txt.
#   bench/gpu_tests.sh BUILD_FOLDER COMMIT [OUTPUT]   (GPU_TEST_MODULES="mpm rom": these alone; GPU_TEST_SHARDS: processes
#   of a module, 1)
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=${1:?build folder} commit=${2:?commit} output=${3:-bench/gpu_tests.txt}
export GOMP_SPINCOUNT=${GOMP_SPINCOUNT:-2000}
modules=${GPU_TEST_MODULES:-core sparsegrid mpm graph rom train apps}
shards=${GPU_TEST_SHARDS:-1}
logs=$(mktemp -d)
for module in $modules; do
  filter='-*Slow*:ExportedSymbols*'  # the latter read object files, which may not have come with the programs
  [ $module = apps ] && filter='*Gpu'
  [ $module = rom ] && filter='*Cuda*'
  for shard in $(seq 0 $((shards - 1))); do
    (
      # The longest one has the last GPU to itself where there are several.
      [ $module = mpm ] && export CUDA_VISIBLE_DEVICES=$(($(nvidia-smi --list-gpus | wc -l) - 1))
      export GTEST_TOTAL_SHARDS=$shards GTEST_SHARD_INDEX=$shard
      timeout "${GPU_TEST_LIMIT:-900}" "$build/${module}_test" --gtest_filter="$filter" > "$logs/$module.$shard" 2>&1
      echo $? > "$logs/$module.$shard.status"
    ) &
  done
done
wait
{
  echo "commit  $commit"
  nvidia-smi --query-gpu=name,driver_version --format=csv,noheader | sed 's/^/gpu     /; s/, /\ndriver  /' | head -2
  echo "command bench/gpu_tests.sh"
  for module in $modules; do
    echo
    status=$(cat "$logs/$module".*.status | sort -n | tail -n 1)
    cat "$logs/$module".[0-9] "$logs/$module".[0-9][0-9] > "$logs/$module" 2> /dev/null
    echo "== ${module}_test: exit code $status"
    awk '/^\[ +PASSED +\]/ { n += $4 } END { print "[  PASSED  ] " n + 0 " tests." }' "$logs/$module"
    grep -E '^\[ +(FAILED|SKIPPED) +\]' "$logs/$module" | grep -v ' tests\?, listed below' | sed 's/ ([0-9]* ms)$//' | sort -u
    grep -E '^\[ +OK \] .*(Gpu|GPU|Cuda|CUDA|cuda|Device)' "$logs/$module"
    [ "$status" = 0 ] || { grep -A 5 -E ': Failure$' "$logs/$module" | cut -c 1-300 | head -n 60; tail -n 5 "$logs/$module"; }
  done
} | sed "s#$PWD/##g" > "$output"
rm -r "$logs"
cat "$output"
