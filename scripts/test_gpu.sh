#!/usr/bin/env bash
# Runs the tests of the CUDA build on a machine with a GPU, and then NVIDIA's sanitizers on the kernels.
#
#   scripts/test_gpu.sh [summary.txt [tests | cuda | sanitizers]]
#
# after cmake --preset cuda && cmake --build --preset cuda. The exit code is 1 if a test or check failed.
# With a file name, the summary is also written there; with a part, the part's summary is appended. `cuda` are the tests
# that CUDA affects, and those of several ranks.
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

# run_tests [ctest's options]
run_tests() {
  OMP_WAIT_POLICY=passive ctest --test-dir build/cuda -j "$(nproc)" --timeout 300 \
    --no-tests=error --output-on-failure "$@" >"$logs/ctest.log" 2>&1 || failed=1
  # Tests without a device skip; here that is a failure.
  grep -q "no CUDA device" "$logs/ctest.log" && failed=1
  say "ctest${*:+ $*}: $(grep -E 'tests passed' "$logs/ctest.log")"
}

# Several checks run at a time, on different GPUs if possible: a tool needs a core more than a GPU.
gpus=$(nvidia-smi -L | wc -l)
most_jobs=$((14 * gpus < $(nproc) ? 14 * gpus : $(nproc)))
jobs_started=0
job_logs=()
# start <log> <what> <command>...
start() {
  local log=$logs/$1.log what=$2
  shift 2
  while (($(jobs -rp | wc -l) >= most_jobs)); do wait -n || true; done
  (
    CUDA_VISIBLE_DEVICES=$((jobs_started % gpus)) "$@" >"$log" 2>&1
    code=$?
    sed -i 's/\x1b\[[0-9;]*m//g' "$log"
    ran=$(sed -nE 's/^\[==========\] ([1-9][0-9]* tests?) from .* ran.*/\1/p' "$log" | head -1)
    echo "$what, ${ran:-no test}: $(grep SUMMARY "$log" | sed 's/^=* //' | paste -sd ';')" >"$log.line"
    # Tests without a device skip; here that is a failure.
    ((code == 0)) && [[ -n $ran ]] && ! grep -q 'SKIPPED' "$log" && touch "$log.passed"
  ) &
  job_logs+=("$log")
  ((++jobs_started))
}

# Runs a test on two ranks, each under its own tool. A tool does not see the other rank's stores, so races cannot be
# checked, and `initcheck` applies to transports through the host only. Errors that NCCL handles itself are ignored.
# check_ranks <program> <filter> <tools>
check_ranks() {
  local program=$1 filter=$2 tool
  for tool in $3; do
    start "${program}_${filter//[^A-Za-z]/}_ranks_$tool" "compute-sanitizer $tool, $program on 2 ranks" \
      env -u CUDA_VISIBLE_DEVICES mpirun --allow-run-as-root --oversubscribe --bind-to none -n 2 \
      compute-sanitizer --tool "$tool" \
      --error-exitcode 9 "$tests/$program" --gtest_filter="$filter"
  done
}

# Runs small cases under each tool, which slow kernels down a hundredfold. `device_test` faults on purpose.
# check <program> <filter> [tools]
check() {
  local program=$1 filter=$2 tool
  for tool in ${3:-memcheck racecheck initcheck synccheck}; do
    start "${program}_${filter//[^A-Za-z]/}_$tool" "compute-sanitizer $tool, $program" \
      compute-sanitizer --tool "$tool" --error-exitcode 9 "$tests/$program" --gtest_filter="$filter"
  done
}
run_sanitizers() {
  rm -f "$logs"/*.passed "$logs"/*.line
  check paper_backend_test 'Paper/Kernels.*Gpu*:PaperGpu.TwoBodies*'
  check cuda_backend_test '*Forces*/AdaptiveEverything:*Forces*/ClosedBesideAdaptive:*Energies*/UniformEverything:*Surf*'
  # Blocks that wait for each other's packets take hours if each access is recorded for races.
  check cuda_paths_test '*CudaResidence*/Mail:*CudaResidence*/ClusterAdaptive:*CudaResidence*/MailClosed' \
    'memcheck initcheck synccheck'
  # Laws that remember: by tiles, and in residence.
  check cuda_backend_test '*Forces*/ClosedPlasticViscous'
  check history_cuda_test 'History.EvaluationsNeverCommit' 'memcheck initcheck synccheck'
  # The work of supports, which many blocks add up.
  check reactions_cuda_test 'Reactions.HaveTheSameBits*' 'memcheck racecheck initcheck'
  check setup_test '*Overlapping*'
  check physics_device_test '*'
  check_ranks share_test 'Bodies/Shares.MayBeLookedAtAtAnyTime/ApartGpuDirect' memcheck
  check_ranks share_test 'Bodies/Shares.MayBeLookedAtAtAnyTime/ApartGpuHost' 'memcheck initcheck'
  wait
  for log in "${job_logs[@]}"; do
    say "$(cat "$log.line")"
    [[ -e $log.passed ]] || failed=1
  done
}

case $part in
  all) run_tests && run_sanitizers ;;
  tests) run_tests ;;
  cuda) run_tests -L 'cuda|mpi' ;;
  sanitizers) run_sanitizers ;;
  *)
    echo "scripts/test_gpu.sh: $part: allowed are tests, cuda, sanitizers" >&2
    exit 2
    ;;
esac

if [[ -n ${1-} && $part == all ]]; then
  cp "$summary" "$1"
elif [[ -n ${1-} ]]; then
  cat "$summary" >>"$1"
fi
exit $failed
