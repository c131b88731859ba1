#!/usr/bin/env bash
# Runs the fuzz targets on new inputs, spread over processes, and prints a line for each target as it ends.
#   campaign.sh BUILD AMOUNT JOBS OUT [TARGET...]
# BUILD holds graupel_fuzz, and lib/ with shared libraries where this machine lacks them. AMOUNT is a number of inputs
# for each target, or a time ("60s"). JOBS processes run at once. OUT gets logs, new inputs (OUT/TARGET/corpus) and
# findings (OUT/TARGET/findings). Seeds are corpus/ and regressions/ beside this script. Exit code 1: there are findings.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
all_targets=(scene recipe safetensors mesh_obj mesh_ply mesh_stl state_file solver_state)
most_findings=20 # of a process, which then ends

export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
# Little freed memory is kept from reuse: more than a processor's cache takes a third of the time.
export ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=0:quarantine_size_mb=2:thread_local_quarantine_size_kb=128
ASAN_OPTIONS+=:max_malloc_fill_size=0:malloc_context_size=1
export UBSAN_OPTIONS=print_stacktrace=1
[ ! -w /dev/shm ] || export TMPDIR=/dev/shm

last() { # PATTERN LOG: the last number behind it, 0 where there is none
  local found
  found=$(grep -aoE "$1 *[0-9]+" "$2" | tail -n 1 | grep -oE '[0-9]+$' || true)
  echo "${found:-0}"
}

run_shard() { # BUILD AMOUNT OUT TARGET SHARD SHARDS: until the amount is done; a finding ends libFuzzer, which then starts again
  local build=$1 amount=$2 out=$3/$4 target=$4 shard=$5 shards=$6
  local log=$out/shard-$shard.log corpus=$out/corpus-$shard inputs=0 cov=0 tries=0 start=$SECONDS left limit
  local seeds=("$here/corpus/$target")
  [ ! -d "$here/regressions/$target" ] || seeds+=("$here/regressions/$target")
  mkdir -p "$corpus"
  while [ "$tries" -lt "$most_findings" ]; do
    if [[ $amount == *s ]]; then
      left=$((${amount%s} - (SECONDS - start)))
      limit=-max_total_time=$left
    else
      left=$(((amount + shards - 1) / shards - inputs))
      limit=-runs=$left
    fi
    [ "$left" -gt 0 ] || break
    tries=$((tries + 1))
    if GRAUPEL_FUZZ_TARGET=$target "$build/graupel_fuzz" "$limit" -seed=$((1000 * shard + tries)) -max_len=32768 \
      -timeout=25 -rss_limit_mb=2048 -malloc_limit_mb=128 -print_final_stats=1 -entropic=0 -verbosity=1 \
      "-artifact_prefix=$out/findings/" "$corpus" "${seeds[@]}" > "$log.$tries" 2>&1; then
      status=0
    else
      status=$?
    fi
    inputs=$((inputs + $(last 'stat::number_of_executed_units:' "$log.$tries")))
    [ "$(last 'cov:' "$log.$tries")" -le "$cov" ] || cov=$(last 'cov:' "$log.$tries")
    [ $status != 0 ] || break
  done
  echo "$inputs $cov $((SECONDS - start))" > "$out/shard-$shard.done.part"
  (
    flock 9
    mv "$out/shard-$shard.done.part" "$out/shard-$shard.done"
    if [ "$(find "$out" -name '*.done' | wc -l)" = "$shards" ]; then
      mkdir -p "$out/corpus"
      find "$out" -path '*/corpus-*' -type f -exec cp -t "$out/corpus" {} +
      cat "$out"/*.done | awk -v target="$target" -v findings="$(find "$out/findings" -type f | wc -l)" \
        '{ n += $1; if ($2 > cov) cov = $2; if ($3 > 0) rate += $1 / $3 }
         END { printf "%-13s %10d inputs %9.0f/s  coverage %6d  findings %d\n", target, n, rate, cov, findings }' |
        tee -a "$out/../summary.txt"
    fi
  ) 9> "$out/lock"
}

if [ "${1:-}" = --shard ]; then
  shift
  run_shard "$@"
  exit
fi
[ $# -ge 4 ] || { sed -n '2,7p' "${BASH_SOURCE[0]}" | sed 's/^# \{0,1\}//' >&2; exit 2; }
build=$(cd "$1" && pwd) amount=$2 jobs=$3
mkdir -p "$4"
out=$(cd "$4" && pwd)
shift 4
[ $# -gt 0 ] || set -- "${all_targets[@]}"
[ ! -d "$build/lib" ] || export LD_LIBRARY_PATH=$build/lib
shards=$jobs
[[ $amount != *s ]] || shards=1
for target in "$@"; do
  rm -rf "${out:?}/$target"
  mkdir -p "$out/$target/findings"
  for shard in $(seq "$shards"); do printf '%s\0' "$build" "$amount" "$out" "$target" "$shard" "$shards"; done
done | xargs -0 -n 6 -P "$jobs" "${BASH_SOURCE[0]}" --shard
[ -z "$(find "$out" -path '*/findings/*' -type f)" ] || exit 1
