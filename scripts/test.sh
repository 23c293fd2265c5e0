#!/usr/bin/env bash
# Configures, builds and tests phyxel.
#
#   scripts/test.sh                      all stages: cpu, cuda, asan, fuzz, tidy, hdf5 and tsan, in this order
#   scripts/test.sh cpu asan             only these
#   scripts/test.sh --start-within 50    only stages that start within 50 minutes; the summary names the stages left out
#
# cpu runs all tests; tidy checks the sources by clang-format, scripts/sizes.py and clang-tidy; hdf5 tests output by
# parallel HDF5; asan repeats the tests under sanitizers, with clang, except those of numerical results; fuzz runs the
# fuzzers of that build; tsan runs the tests with threads; cuda runs the tests that CUDA affects.
# All stages run even if one has failed. A summary follows, with the skipped cases of each stage by reason; the exit code is
# 1 if any stage failed. In CI (CI=1 or true), a missing tool or compiler is a failure; cases without a GPU are skipped.
# FUZZ_SECONDS (30) is the time of each fuzzer.
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

start_within=
if [[ ${1-} == --start-within ]]; then
  start_within=${2-}
  if [[ ! $start_within =~ ^[1-9][0-9]{0,5}$ ]]; then
    echo "scripts/test.sh: --start-within \"$start_within\" found; allowed: a whole number of minutes" >&2
    exit 2
  fi
  shift 2
fi
stages=("$@")
if [[ ${#stages[@]} -eq 0 ]]; then
  stages=(cpu cuda asan fuzz tidy hdf5 tsan)
fi
for stage in "${stages[@]}"; do
  case $stage in cpu | tidy | hdf5 | asan | tsan | cuda | fuzz) ;; *)
    echo "scripts/test.sh: unknown stage \"$stage\" (cpu, tidy, hdf5, asan, fuzz, tsan or cuda)" >&2
    exit 2 ;;
  esac
done

scripts/setup-debian.sh --tests || exit 1

jobs=$(nproc)
generator=()
command -v ninja >/dev/null || generator=(-G "Unix Makefiles")

in_ci() { [[ -n ${CI-} && $CI != 0 && $CI != false ]]; }

# In CI the configuration requires optional parts.
insist=()
if in_ci; then
  insist=(-DPHYXEL_MPI=ON -DPHYXEL_VIEW=ON)
fi

# Lists missing tools without which tests are not registered or skip.
missing_tools() {
  local tool module
  for tool in ccx chromium doxygen dpkg-shlibdeps ffmpeg fish gnuplot help2man mpirun pkg-config zsh; do
    command -v "$tool" >/dev/null || echo "$tool"
  done
  for module in h5py matplotlib meshio numpy pandas pytest vtkmodules; do
    python3 -c "import $module" 2>/dev/null || /usr/bin/python3 -c "import $module" 2>/dev/null || echo "Python's $module"
  done
}

have_clang() { command -v clang++ >/dev/null; }

# build <configure preset> <build preset>
build() {
  # The three unsanitized builds share the library's objects through ccache, so they precompile headers of tests only.
  local headers=()
  case $1 in cpu | hdf5 | cuda) headers=(-DPHYXEL_PCH=TESTS) ;; esac
  cmake --preset "$1" "${generator[@]}" "${insist[@]}" "${headers[@]}" -DPHYXEL_TESTS=ON &&
    cmake --build --preset "$2" --parallel "$jobs"
}

# ctest writes the names of failed tests to a file, which the summary repeats.
# tested <configure preset> [<build and test preset>]
tested() {
  local failed=build/$1/Testing/Temporary/LastTestsFailed.log
  export PHYXEL_SKIPS=$PWD/build/$1/skips.txt  # test programs append skipped cases to this file
  rm -f "$failed" "$PHYXEL_SKIPS"
  # Threads that spin at barriers take the cores from the tests beside them, which then last a hundred times as long.
  build "$1" "${2-$1}" && OMP_WAIT_POLICY=passive ctest --preset "${2-$1}" --parallel "$jobs"
}

# In CI, deletes the test programs of a build, whose device code takes some ten gigabytes.
free_programs() {
  if in_ci; then find "build/$1/tests" -type f -size +50M -delete; fi
}

failed_tests() {
  local log=build/$1/Testing/Temporary/LastTestsFailed.log
  [[ ! -f $log ]] || sed 's/^[0-9]*:/          /' "$log"
}

# The thread sanitizer does not see the barriers of GCC's libgomp, so that each parallel loop would look like a race.
# LLVM's runtime reports them through its tool Archer (verbose=1 shows that it is active).
tested_with_tsan() {
  local archer=
  archer=$(find "$(dirname "$(readlink -f "$(command -v clang++)")")/.." -name libarcher.so | head -1)
  if [[ -z $archer ]]; then
    echo "libarcher.so was not found beside clang++ (Debian: libomp-dev)"
    return 1
  fi
  export OMP_TOOL_LIBRARIES=$archer
  export TSAN_OPTIONS="ignore_noninstrumented_modules=1 ${TSAN_OPTIONS-}"
  tested tsan
}

# fuzzed_by <fuzzer>: runs a fuzzer. Crashing inputs are kept under build/asan/fuzz/found, the log beside it.
fuzzed_by() {
  local fuzzer=$1 name corpus seeds code=0
  name=$(basename "$fuzzer")
  corpus=build/asan/fuzz/corpus/$name
  seeds=fuzz/corpus/${name#fuzz_}
  mkdir -p "$corpus" build/asan/fuzz/found
  [[ -d $seeds ]] || seeds=
  "$fuzzer" -max_total_time="${FUZZ_SECONDS:-30}" -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 \
    -artifact_prefix=build/asan/fuzz/found/"$name"- "$corpus" ${seeds:+"$seeds"} >build/asan/fuzz/"$name".log 2>&1 || code=1
  echo "--- $name"
  if [[ $code -ne 0 ]]; then
    grep -vE '^(#[0-9]+[[:space:]]|[[:space:]]*NEW_FUNC)' build/asan/fuzz/"$name".log | tail -n 40
  fi
  grep -E 'number_of_executed_units|average_exec_per_sec' build/asan/fuzz/"$name".log
  return $code
}

# One fuzzer a core.
fuzzed() {
  build asan fuzz || return 1
  local failed=0 fuzzer
  for fuzzer in build/asan/bin/fuzz_*; do
    while [[ $(jobs -pr | wc -l) -ge $jobs ]]; do wait -n || failed=1; done
    fuzzed_by "$fuzzer" &
  done
  while [[ $(jobs -p | wc -l) -gt 0 ]]; do wait -n || failed=1; done
  return $failed
}

have_tidy() { command -v clang-tidy >/dev/null && command -v clang-format >/dev/null; }

looked_at() {
  cmake --preset cpu "${generator[@]}" "${insist[@]}" -DPHYXEL_TESTS=ON >/dev/null && scripts/format.sh --check &&
    python3 -B scripts/sizes.py && scripts/tidy.sh
}

have_nvcc() {
  command -v nvcc >/dev/null || [[ -n ${CUDACXX-} || -x /usr/local/cuda/bin/nvcc ]]
}

have_parallel_hdf5() {
  command -v mpirun >/dev/null && [[ -n $(find /usr/include/hdf5/openmpi "${HDF5_ROOT-/nowhere}" -name hdf5.h 2>/dev/null) ]]
}

# without <tool>: skips a stage whose tool is missing, by exit code 77. The summary reads the tool from $lacking.
lacking=$(mktemp)
trap 'rm -f "$lacking"' EXIT
without() {
  echo "$1" >"$lacking"
  return 77
}

# stage <name>
stage() {
  case $1 in
    cpu) tested cpu ;;
    tidy) if have_tidy; then looked_at; else without "clang-tidy or clang-format"; fi ;;
    hdf5) if have_parallel_hdf5; then tested hdf5; else without "parallel HDF5 (Debian: libhdf5-openmpi-dev)"; fi ;;
    asan) if have_clang; then tested asan; else without clang; fi ;;
    fuzz) if have_clang; then fuzzed; else without clang; fi ;;
    tsan) if have_clang; then tested_with_tsan; else without clang; fi ;;
    cuda) if have_nvcc; then tested cuda cuda-tests && free_programs cuda; else without nvcc; fi ;;
  esac
}

summary=()
worst=0
mapfile -t missing < <(missing_tools)
for name in "${stages[@]}"; do
  if [[ -n $start_within && $SECONDS -gt $((60 * start_within)) ]]; then
    summary+=("$(printf '  %-5s LEFT OUT: %d minutes had passed, more than the %d of --start-within' "$name" \
      $((SECONDS / 60)) "$start_within")")
    continue
  fi
  echo
  echo "=== $name"
  start=$SECONDS
  skips=build/$name/skips.txt
  (stage "$name")
  code=$?
  result=passed
  if [[ $code -eq 77 ]] && ! in_ci; then
    result="SKIPPED: missing tool: $(cat "$lacking")"
  elif [[ $code -eq 77 ]]; then
    result="FAILED: missing tool: $(cat "$lacking") (CI is set)"
  elif [[ $code -ne 0 ]]; then
    result=FAILED
  fi
  [[ $result != FAILED* ]] || worst=1
  counted=0
  if [[ $code -ne 77 && -f $skips && $name != fuzz && $name != tidy ]]; then
    counted=$(wc -l <"$skips")
    result+=", $counted cases skipped"
  fi
  summary+=("$(printf '  %-5s %5d s  %s' "$name" $((SECONDS - start)) "$result")")
  if [[ $counted -gt 0 ]]; then summary+=("$(scripts/skips.py "$skips" | sed 's/^/          skipped /')"); fi
  if [[ $result == FAILED* ]]; then summary+=("$(failed_tests "$name")"); fi
done

echo
echo "Summary"
printf '%s\n' "${summary[@]}"
if [[ ${#missing[@]} -gt 0 ]]; then
  for tool in "${missing[@]}"; do echo "  missing tool: $tool; its tests were left out"; done
  if in_ci; then
    echo "  FAILED: in CI (CI=$CI) no tool may be missing"
    worst=1
  fi
fi
exit $worst
