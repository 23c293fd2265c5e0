#!/usr/bin/env bash
# Configures, builds and tests.
#
#   scripts/test.sh                   cpu, tidy, asan, fuzz, tsan and cuda (where nvcc is)
#   scripts/test.sh cpu asan          only these
#
# cpu runs every test; tidy looks at the sources by clang-format and clang-tidy, as cpu compiles them; asan every one again under the sanitizers, with clang, of whose build fuzz
# takes the fuzzers; tsan those that have threads; cuda those that CUDA changes.
# Every stage runs even if an earlier one failed; a summary comes last, and exit code 1 if any failed.
# FUZZ_SECONDS (30) is the time for each fuzzer.
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

stages=("$@")
if [[ ${#stages[@]} -eq 0 ]]; then
  stages=(cpu tidy asan fuzz tsan cuda)
fi
for stage in "${stages[@]}"; do
  case $stage in cpu | tidy | asan | tsan | cuda | fuzz) ;; *)
    echo "scripts/test.sh: unknown stage \"$stage\" (cpu, tidy, asan, tsan, cuda or fuzz)" >&2
    exit 2 ;;
  esac
done

scripts/setup-debian.sh --tests || exit 1

jobs=$(nproc)
generator=()
command -v ninja >/dev/null || generator=(-G "Unix Makefiles")

have_clang() { command -v clang++ >/dev/null; }

# build <configure preset> <build preset>
build() {
  cmake --preset "$1" "${generator[@]}" -DPHYXEL_TESTS=ON && cmake --build --preset "$2" --parallel "$jobs"
}

# ctest keeps the names of what failed in a file, which the summary repeats: the list of a stage is
# far above when the last stage ends.
# tested <configure preset> [<build and test preset>]
tested() {
  local failed=build/$1/Testing/Temporary/LastTestsFailed.log
  rm -f "$failed"
  build "$1" "${2-$1}" && ctest --preset "${2-$1}" --parallel "$jobs"
}

failed_tests() {
  local log=build/$1/Testing/Temporary/LastTestsFailed.log
  [[ ! -f $log ]] || sed 's/^[0-9]*:/          /' "$log"
}

# GCC's libgomp does not tell the thread sanitizer about its barriers, so every parallel loop would
# look like a race. LLVM's does, through its tool Archer, which says so on request (verbose=1).
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

fuzzed() {
  build asan fuzz || return 1
  local failed=0 fuzzer name corpus seeds
  for fuzzer in build/asan/bin/fuzz_*; do
    name=$(basename "$fuzzer")
    corpus=build/asan/fuzz/corpus/$name
    seeds=fuzz/corpus/${name#fuzz_}
    mkdir -p "$corpus" build/asan/fuzz/found
    [[ -d $seeds ]] || seeds=
    echo "--- $name"
    # Crashing inputs are kept under build/asan/fuzz/found, the whole log beside it.
    if ! "$fuzzer" -max_total_time="${FUZZ_SECONDS:-30}" -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 \
      -artifact_prefix=build/asan/fuzz/found/"$name"- "$corpus" ${seeds:+"$seeds"} >build/asan/fuzz/"$name".log 2>&1; then
      failed=1
      grep -vE '^(#[0-9]+[[:space:]]|[[:space:]]*NEW_FUNC)' build/asan/fuzz/"$name".log | tail -n 40
    fi
    grep -E 'number_of_executed_units|average_exec_per_sec' build/asan/fuzz/"$name".log
  done
  return $failed
}

looked_at() {
  command -v clang-tidy >/dev/null && command -v clang-format >/dev/null || return 77
  cmake --preset cpu "${generator[@]}" -DPHYXEL_TESTS=ON >/dev/null && scripts/format.sh --check && scripts/tidy.sh
}

have_nvcc() {
  command -v nvcc >/dev/null || [[ -n ${CUDACXX-} || -x /usr/local/cuda/bin/nvcc ]]
}

summary=()
worst=0
for stage in "${stages[@]}"; do
  echo
  echo "=== $stage"
  start=$SECONDS
  case $stage in
    cpu) (tested cpu) ;;
    tidy) (looked_at) ;;
    asan) if have_clang; then (tested asan); else (exit 77); fi ;;
    fuzz) if have_clang; then (fuzzed); else (exit 77); fi ;;
    tsan) if have_clang; then (tested_with_tsan); else (exit 77); fi ;;
    cuda) if have_nvcc; then (tested cuda cuda-tests); else (exit 77); fi ;;
  esac
  code=$?
  result=passed
  if [[ $code -eq 77 ]]; then
    result="skipped: its compiler is not installed"
  elif [[ $code -ne 0 ]]; then
    result=FAILED
    worst=1
  fi
  summary+=("$(printf '  %-5s %5d s  %s' "$stage" $((SECONDS - start)) "$result")")
  if [[ $result == FAILED ]]; then summary+=("$(failed_tests "$stage")"); fi
done

echo
echo "Summary"
printf '%s\n' "${summary[@]}"
exit $worst
