#!/usr/bin/env bash
# Runs the tests on a machine with an NVIDIA GPU and sums them up in bench/gpu_tests.txt.
#   bench/gpu_tests.sh BUILD_FOLDER COMMIT [OUTPUT]
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=${1:?build folder} commit=${2:?commit} output=${3:-bench/gpu_tests.txt}
export GOMP_SPINCOUNT=${GOMP_SPINCOUNT:-20000}
{
  echo "commit  $commit"
  nvidia-smi --query-gpu=name,driver_version --format=csv,noheader | sed 's/^/gpu     /; s/, /\ndriver  /' | head -2
  echo "command bench/gpu_tests.sh"
  for module in core sparsegrid mpm graph rom train apps; do
    log=$(mktemp) filter='-*Slow*'
    [ $module = apps ] && filter='*Gpu'
    [ $module = rom ] && filter='*Cuda*'
    timeout 240 "$build/${module}_test" --gtest_filter="$filter" > "$log" 2>&1
    status=$?
    echo
    echo "== ${module}_test: exit code $status"
    grep -E '^\[ +(PASSED|FAILED|SKIPPED) +\]' "$log" | sort -u
    grep -E '^\[ +OK \] .*(Gpu|GPU|Cuda|CUDA|cuda|Device)' "$log"
    [ $status = 0 ] || grep -v -E '^\[ +(RUN|OK) ' "$log" | tail -n 30
    rm -f "$log"
  done
} > "$output"
cat "$output"
