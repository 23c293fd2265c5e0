#!/usr/bin/env bash
# On a machine with a GPU: the measurements behind docs/performance.md, into a folder of CSV files.
#
#   scripts/measure_gpu.sh [folder]     after cmake --preset cuda && cmake --build --preset cuda
#
# PHYXEL names another program than build/cuda/bin/phyxel. The largest body takes some 100 GB of the
# GPU's memory while it is set up, and nearly as much of the host's.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-docs/results}
program=${PHYXEL:-build/cuda/bin/phyxel}
mkdir -p "$out"
step() {
  local name=$1
  shift
  echo "== $name"
  "$program" bench "$@" --device cuda --force --csv "$out/$name.csv" | grep -v '^#'
}
small=125,343,1000,2197,4096,8000,15625,27000
medium=50653,103823,250047,512000,1000000
large=2097152,4096000,8000000,16974593

step gpu_sizes step --phyxels "$small,$medium,$large" --terms green --seconds 0.2
step gpu_terms step --phyxels 2097152
step gpu_neighbours step --phyxels 2097152 --terms green --factor 1.45,1.6,1.8,2,2.15,2.3
step gpu_cantilever cantilever
# One table of several: one <table> <first>...
one() {
  local table=$1 part
  shift
  sed '/^[^#]/q' "$out/$1.csv" >"$out/$table.csv"
  for part in "$@"; do
    grep -v '^#' "$out/$part.csv" | tail -n +2 >>"$out/$table.csv"
    rm "$out/$part.csv"
  done
}
small=()
surfels=()
for body in dino alien_head horn_bug; do
  for count in 1 10 100; do
    step "gpu_small_${body}_$count" step --shape $body --bodies $count --terms green \
      --precision float
    small+=("gpu_small_${body}_$count")
  done
  step "gpu_surfels_$body" step --shape $body --terms green,surfels --precision float
  surfels+=("gpu_surfels_$body")
done
step gpu_surfels_cube step --phyxels 27000,103823,1000000 --terms green,surfels --precision float
one gpu_small "${small[@]}"
one gpu_surfels "${surfels[@]}" gpu_surfels_cube
step gpu_setup setup --phyxels 103823,1000000,4096000,16003008 --precision float --repeat 3
step gpu_capacity step --phyxels "${CAPACITY:-300763000}" --terms green --precision float --repeat 3
