#!/usr/bin/env bash
# Checks format and lint, then runs every test program in build/ and sums up: the last line is
# "N passed, N failed", and the line before it "N skipped".
#   tests/run_all.sh [--slow] [--filter PATTERN]
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# Waiting OpenMP threads sleep soon: libgomp's default, seconds of spinning, stalls a busy machine.
export GOMP_SPINCOUNT=${GOMP_SPINCOUNT:-20000}
slow=0 filter=""
while [ $# -gt 0 ]; do
  case $1 in
    --slow) slow=1 ;;
    --filter) filter=${2:?--filter needs a GoogleTest pattern}; shift ;;
    *) echo "unknown argument '$1' (allowed: --slow, --filter PATTERN)" >&2; exit 2 ;;
  esac
  shift
done

passed=0 failed=0 skipped=0
check() { # NAME COMMAND...: status 77 says that it could not be tried
  local name=$1 log status=0 start=$SECONDS
  shift
  log=$(mktemp)
  "$@" > "$log" 2>&1 || status=$?
  name="$name ($((SECONDS - start)) s)"
  if [ $status = 0 ]; then
    passed=$((passed + 1))
    echo "ok      $name"
  elif [ $status = 77 ]; then
    skipped=$((skipped + 1))
    echo "skipped $name: $(tail -n 1 "$log")"
  else
    failed=$((failed + 1))
    echo "FAILED  $name"
    grep -v ' warnings generated' "$log" | tail -n 60
  fi
  rm -f "$log"
}

# Every fuzz target for a minute, two at once (docs/lab/fuzzing.md): each state of the code that they run has its own
# inputs, and always the same.
check_new_inputs() {
  local state
  state=$(git ls-tree HEAD -- core io nn sparsegrid mpm graph rom hybrid tests/fuzz | git hash-object --stdin)
  export GRAUPEL_FUZZ_SEED=${GRAUPEL_FUZZ_SEED:-$((16#${state:0:7}))}
  GRAUPEL_FUZZ_SECONDS=60 GTEST_TOTAL_SHARDS=2 GTEST_SHARD_INDEX=1 build/fuzz_test --gtest_filter='*NewInputs*' &
  GRAUPEL_FUZZ_SECONDS=60 GTEST_TOTAL_SHARDS=2 GTEST_SHARD_INDEX=0 build/fuzz_test --gtest_filter='*NewInputs*'
  local status=$?
  wait $! && return $status
}

check_format() {
  git ls-files -- '*.h' '*.cpp' '*.cu' '*.cuh' | xargs clang-format --dry-run -Werror
}
if [ -z "$filter" ]; then
  # Lint runs beside the checks that use one core, and is waited for after them.
  if [ -e build/tidy/compile_commands.json ]; then
    lint_log=$(mktemp)
    nice /usr/bin/python3 tests/lint.py > "$lint_log" 2>&1 &
    lint=$!
    finish_lint() { local status=0; wait $lint || status=$?; cat "$lint_log"; rm -f "$lint_log"; return $status; }
  fi
  check "format (clang-format)" check_format
  check "tools/convert.py (unittest)" /usr/bin/python3 tests/tools/convert_test.py
  check "formats of tools/convert.py (unittest)" /usr/bin/python3 tests/tools/convert_formats_test.py
  check "networks in NumPy by docs/reference/networks.md" /usr/bin/python3 tests/tools/numpy_inference.py
  check "installed package: headers, examples, programs" /usr/bin/python3 tests/package/package_test.py
  check "man pages; completion in bash, zsh, fish" /usr/bin/python3 tests/package/manual_test.py
  check "Python wheel in a clean environment" /usr/bin/python3 tests/python/wheel_test.py --in-build
  # Of the programs' libraries those that are there; the others are named as skipped.
  python=/usr/bin/python3
  [ ! -x build/export-python/bin/python ] || python=build/export-python/bin/python
  check "exported files in other programs" $python tests/export/programs_test.py
  for library in pxr:usd-core vtk:vtk bpy:bpy; do
    $python -c "import importlib.util as u, sys; sys.exit(u.find_spec('${library%:*}') is None)" && continue
    skipped=$((skipped + 1))
    echo "skipped exported files in ${library#*:}: 'python3 tests/export/programs_test.py --install' installs it"
  done
  if ! command -v pvpython > /dev/null; then
    skipped=$((skipped + 1))
    echo "skipped exported files in ParaView: needs the package python3-paraview"
  fi
  if [ -e build/libgraupel_inject.so ]; then
    check "failed writes of exports" /usr/bin/python3 tests/faults/faults_test.py --only export --kinds write --most 2
    check "kills between the writes of a flush" /usr/bin/python3 tests/faults/flush_test.py
  else
    skipped=$((skipped + 1))
    echo "skipped failed writes: 'ninja -C build graupel_inject' makes what they need"
  fi
  if [ "$(id -u)" = 0 ] && [ "$(command -v slurmctld slurmd sbatch munged | wc -l)" = 4 ]; then
    check "arrays and training under Slurm" /usr/bin/python3 tests/slurm/slurm_test.py
  else
    skipped=$((skipped + 1))
    echo "skipped arrays and training under Slurm: needs root and the packages slurmctld slurmd slurm-client munge"
  fi
  check "keys, pointer and messages of the viewer's page" /usr/bin/python3 tests/viewer/page_test.py
  check "Markdown: links, lines, index" /usr/bin/python3 tests/tools/docs_test.py
  check "documentation as web pages: links, search" ./run site
  if [ -n "${lint:-}" ]; then
    check "lint (clang-tidy), that it was waited for" finish_lint
  else
    skipped=$((skipped + 1))
    echo "skipped lint (clang-tidy): './run test' makes its compile commands"
  fi
  check "new inputs for the fuzz targets, 60 s each" check_new_inputs
  check "comparison of builds (tests/golden/selftest.py)" /usr/bin/python3 tests/golden/selftest.py
fi

# One GoogleTest program a module; slow tests are named *Slow* and run with --slow.
pattern=${filter:-*}
[ $slow = 1 ] || pattern="$pattern:-*Slow*"
for program in build/*_test; do
  report=$(mktemp)
  log=$(mktemp)
  start=$SECONDS
  GTEST_COLOR=no timeout 900 "$program" --gtest_filter="$pattern" --gtest_output="json:$report" > "$log" 2>&1
  status=$?
  counts=$(python3 - "$report" "$status" <<'EOS'
import json, sys
try:
    suites = json.load(open(sys.argv[1]))["testsuites"]
except Exception:
    print(0, 1, 0)  # it crashed or ran out of time before its report
    sys.exit()
tests = [t for s in suites for t in s["testsuite"]]
bad = sum(1 for t in tests if t.get("failures"))
skip = sum(1 for t in tests if t.get("result") == "SKIPPED")
good = len(tests) - bad - skip
if int(sys.argv[2]) and not bad:
    bad = 1
print(good, bad, skip)
EOS
)
  read -r good bad skip <<< "$counts"
  passed=$((passed + good)) failed=$((failed + bad)) skipped=$((skipped + skip))
  echo "$(basename "$program"): $good passed, $bad failed, $skip skipped ($((SECONDS - start)) s)"
  [ "$skip" = 0 ] || grep -A1 -h ': Skipped$' "$log" | grep -v -e ': Skipped$' -e '^--$' | sort | uniq -c | sed 's/^/    skipped: /'
  [ "$bad" = 0 ] || grep -v -E '^\[ +(RUN|OK) ' "$log" | tail -n 80
  rm -f "$report" "$log"
done
[ $slow = 1 ] || echo "tests named *Slow* were left out; tests/run_all.sh --slow runs them"
echo "$skipped skipped"
echo "$passed passed, $failed failed"
[ $failed = 0 ]
