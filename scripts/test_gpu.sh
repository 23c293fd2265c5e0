#!/usr/bin/env bash
# On a machine with a GPU: all tests of the CUDA build, then NVIDIA's sanitizers on the kernels.
#
#   scripts/test_gpu.sh [summary.txt [tests | sanitizers]]
#
# after cmake --preset cuda && cmake --build --preset cuda. Ends with exit code 1 if anything failed.
# With a file name, a summary goes there too; with a part, that part is added to it.
set -uo pipefail
cd "$(dirname "$0")/.."

if ! nvidia-smi -L >/dev/null 2>&1; then
  echo "scripts/test_gpu.sh: no NVIDIA GPU here; scripts/test.sh tests everything else" >&2
  exit 1
fi
part=${2-all}
tests=build/cuda/tests
logs=build/cuda/gpu-logs
mkdir -p "$logs"
summary=$logs/summary.txt
failed=0

say() { echo "$*" | tee -a "$summary"; }

: >"$summary"
say "$(build/cuda/bin/phyxel --version), $(nvidia-smi --query-gpu=name --format=csv,noheader | head -1), $(date -u +%F)"

run_tests() {
  OMP_WAIT_POLICY=passive ctest --test-dir build/cuda -j "$(nproc)" --timeout 300 \
    --output-on-failure >"$logs/ctest.log" 2>&1 || failed=1
  say "ctest: $(grep -E 'tests passed' "$logs/ctest.log")"
}

# Two ranks, each with its own tool: what they store in each other's memory is not seen as a race.
# check_ranks <program> <filter>
check_ranks() {
  local program=$1 filter=$2 tool log
  for tool in memcheck initcheck; do
    log=$logs/${program}_ranks_$tool.log
    mpirun --allow-run-as-root --oversubscribe -n 2 compute-sanitizer --tool "$tool" \
      --error-exitcode 9 "$tests/$program" --gtest_filter="$filter" >"$log" 2>&1 || failed=1
    grep -qE '^\[==========\] [1-9][0-9]* tests? from .* ran' "$log" || failed=1  # or none ran
    say "compute-sanitizer $tool, $program on 2 ranks: $(grep SUMMARY "$log" | sed 's/^=* //' | paste -sd ';')"
  done
}

# Small cases: each tool slows kernels down a hundredfold. `device_test` faults on purpose.
# check <program> <filter> [tools]
check() {
  local program=$1 filter=$2 tool log
  for tool in ${3:-memcheck racecheck initcheck synccheck}; do
    log=$logs/${program}_${filter//[^A-Za-z]/}_$tool.log
    compute-sanitizer --tool "$tool" --error-exitcode 9 "$tests/$program" --gtest_filter="$filter" \
      >"$log" 2>&1 || failed=1
    grep -qE '^\[==========\] [1-9][0-9]* tests? from .* ran' "$log" || failed=1  # or none ran
    say "compute-sanitizer $tool, $program, $(grep -E '^\[==========\] [0-9]+ tests? from .* ran' "$log" |
      sed -E 's/.*\] ([0-9]+ tests?) .*/\1/'): $(grep SUMMARY "$log" | tail -1 | sed 's/^=* //')"
  done
}
run_sanitizers() {
  check paper_backend_test 'Paper/Kernels.*Gpu*:PaperGpu.TwoBodies*'
  check cuda_backend_test '*Forces*/AdaptiveEverything:*Energies*/UniformEverything:*Surf*'
  # Blocks that wait for each other's mail take hours where every access is recorded for races.
  check cuda_backend_test '*Residence*/Mail:*Residence*/ClusterAdaptive' 'memcheck initcheck synccheck'
  check setup_test '*Overlapping*'
  check physics_device_test '*'
  check_ranks share_test 'Bodies/Shares.MayBeLookedAtAtAnyTime/*Apart*Gpu*'
}

case $part in
  all) run_tests && run_sanitizers ;;
  tests) run_tests ;;
  sanitizers) run_sanitizers ;;
  *)
    echo "scripts/test_gpu.sh: $part: allowed are tests, sanitizers" >&2
    exit 2
    ;;
esac

if [[ -n ${1-} && $part == all ]]; then
  cp "$summary" "$1"
elif [[ -n ${1-} ]]; then
  cat "$summary" >>"$1"
fi
exit $failed
