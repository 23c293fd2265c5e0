#!/usr/bin/env bash
# Profiles the two passes of a step on a machine with a GPU and Nsight Compute, as a CSV file for docs/performance.md.
#
#   scripts/profile_gpu.sh [file]     after cmake --preset cuda && cmake --build --preset cuda
#
# PHYXEL is the program (default: build/cuda/bin/phyxel). Nsight Compute fixes the clock at its base frequency.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-docs/results/gpu_profile.csv}
program=${PHYXEL:-build/cuda/bin/phyxel}
metrics=gpu__time_duration.sum,smsp__cycles_elapsed.avg.per_second,smsp__inst_executed.sum
metrics+=,smsp__issue_active.avg.pct_of_peak_sustained_active
metrics+=,l1tex__data_pipe_lsu_wavefronts.avg.pct_of_peak_sustained_elapsed
metrics+=,sm__pipe_fma_cycles_active.avg.pct_of_peak_sustained_active
metrics+=,sm__pipe_fp64_cycles_active.avg.pct_of_peak_sustained_active
metrics+=,dram__bytes.sum,dram__throughput.avg.pct_of_peak_sustained_elapsed
metrics+=,lts__t_bytes.sum,lts__t_sectors.avg.pct_of_peak_sustained_elapsed
metrics+=,sm__warps_active.avg.pct_of_peak_sustained_active

{
  echo "# program: $("$program" --version)"
  echo "# gpu: $(nvidia-smi --query-gpu=name --format=csv,noheader | head -1)"
  echo "# date: $(date -u +%F)"
  echo "precision,kernel,metric,unit,value"
  for precision in float double; do
    ncu --csv --print-units base --metrics "$metrics" -k regex:pass_ --launch-skip 8 --launch-count 2 \
      "$program" bench step --device cuda --phyxels 2097152 --terms green --precision "$precision" \
      --repeat 1 --seconds 0.02 2>/dev/null |
      python3 -c '
import csv, sys
rows = csv.reader(line for line in sys.stdin if line.startswith("\""))
head = next(rows)
at = {name: k for k, name in enumerate(head)}
for row in rows:
    kernel = "pass 1" if "pass_1" in row[at["Kernel Name"]] else "pass 2"
    value = row[at["Metric Value"]].replace(",", "")
    print(sys.argv[1], kernel, row[at["Metric Name"]], row[at["Metric Unit"]], value, sep=",")
' "$precision"
  done
} >"$out.tmp"
mv "$out.tmp" "$out"
