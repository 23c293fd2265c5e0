#!/usr/bin/env bash
# Makes the measurements of docs/performance.md on a machine with a GPU, as CSV files in a folder.
#
#   scripts/measure_gpu.sh [folder [part...]]   after cmake --preset cuda && cmake --build --preset cuda
#
# Parts: sizes, terms, contact, small and setup, which are the default; meshes (runs of MESH, a file, by MESH_PHYXELS phyxels with
# MESH_CLOSURE); for docs/scaling.md on hosts with several GPUs, ranks (2, 4, 8 GPUs) and large (LARGE phyxels on all GPUs;
# a billion by default, with 4 or more).
# PHYXEL is the program (default: build/cuda/bin/phyxel), PHYXEL_STUDIES phyxel_studies (default: beside it).
# bench/make_pages.py writes the pages. The set-up of the largest body takes about 100 GB of the GPU's memory, and
# nearly as much of the host's.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-docs/results}
program=${PHYXEL:-build/cuda/bin/phyxel}
studies=${PHYXEL_STUDIES:-$(dirname "$program")/phyxel_studies}
mkdir -p "$out"
shift || true
parts=" ${*:-sizes terms contact small setup} "
has() { [[ $parts == *" $1 "* ]]; }
# measured <table> <program> <arguments>...
measured() {
  local name=$1
  shift
  echo "== $name"
  "$@" --device cuda --force --csv "$out/$name.csv" | grep -v '^#'
}
step() { measured "$1" "$program" bench "${@:2}"; }
if has sizes; then
  small=125,343,1000,2197,4096,8000,15625,27000
  medium=50653,103823,250047,512000,1000000
  large=2097152,4096000,8000000,16974593
  step gpu_sizes step --phyxels "$small,$medium,$large" --terms green --seconds 0.2
fi
if has terms; then
  step gpu_terms step --phyxels 2097152
  step gpu_neighbours step --phyxels 2097152 --terms green --factor 1.45,1.6,1.8,2,2.15,2.3
  step gpu_cantilever cantilever
fi
# Joins tables of equal columns: one <table> <first>...
one() {
  local table=$1 part
  shift
  sed '/^[^#]/q' "$out/$1.csv" >"$out/$table.csv"
  for part in "$@"; do
    grep -v '^#' "$out/$part.csv" | tail -n +2 >>"$out/$table.csv"
    rm "$out/$part.csv"
  done
}
if has contact; then
  step gpu_contact_obstacle step --phyxels 1000000 --terms green,obstacle --precision float --seconds 1
  step gpu_contact_bodies step --phyxels 500000 --bodies 2 --terms green,contact --precision float --seconds 1
  one gpu_contact gpu_contact_obstacle gpu_contact_bodies
fi
if has small; then
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
fi
if has setup; then
  measured gpu_setup "$studies" setup --phyxels 103823,1000000,4096000,16003008 --precision float --repeat 3
  step gpu_capacity step --phyxels "${CAPACITY:-300763000}" --terms green --precision float --repeat 3
fi
if has meshes; then
  mesh=$(realpath "${MESH:?is not set: the file of a mesh}")
  closure=${MESH_CLOSURE:-\"auto\"}
  folder=$(mktemp -d)
  for phyxels in ${MESH_PHYXELS:-1000000 10000000 100000000}; do
    scene=$folder/scene.toml
    cat >"$scene" <<SCENE
title = "$(basename "${mesh%.*}"), free and turning"
[time]
end = 2e-5
step = 1e-7
[solver]
precision = "float"
device = "cuda"
[output]
frames_per_second = 0
surface = false
checkpoint_every = 0
[[body]]
mesh = "$mesh"
phyxels = $phyxels
closure = $closure
spin = [0, 0, 1]
[body.material]
young = 1e6
poisson = 0.3
density = 1000
SCENE
    name=gpu_mesh_$((phyxels / 1000000))m
    echo "== $name"
    "$program" run "$scene" --json --out "$folder/run" --force --profile "$folder/profile.json" >"$folder/run.json"
    # The summary of the run, what it was asked for, and the seconds of the stages of its set-up.
    python3 - "$folder" "$closure" >"$out/$name.json" <<'SUMMARY'
import collections, json, pathlib, sys
folder = pathlib.Path(sys.argv[1])
run = json.loads((folder / "run.json").read_text())
run = {key: value for key, value in run.items() if key not in ("scene", "directory", "checkpoint")}
stages, peak = collections.Counter(), 0
for event in json.loads((folder / "profile.json").read_text())["traceEvents"]:
    if event["ph"] == "X":
        stages[event["name"]] += event["dur"] * 1e-6
    elif event["ph"] == "C":
        peak = max(peak, event["args"]["GB"])
run |= {"closure": json.loads(sys.argv[2]), "stages": dict(stages), "host_memory_gb": peak}
print(json.dumps(run, indent=1))
SUMMARY
    rm -r "$folder/run"
  done
  rm -r "$folder"
fi

gpus=$(nvidia-smi -L | wc -l)
# ranks <n> <name> <options>...: a table of n ranks
ranks() {
  local n=$1 name=$2
  shift 2
  echo "== $name"
  OMP_NUM_THREADS=$(($(nproc) / n)) OMP_WAIT_POLICY=passive mpirun --allow-run-as-root --oversubscribe \
    --bind-to none -n "$n" "$program" bench scaling --device cuda --force --csv "$out/$name.csv" "$@" |
    grep -v '^#'
}
if (has ranks || has large) && ((gpus < 2)); then
  echo "scripts/measure_gpu.sh: ranks and large need 2 GPUs or more; this host has $gpus" >&2
  exit 1
fi
if has ranks; then
  for n in 2 4 8; do
    ((n <= gpus)) || break
    ranks $n gpu_ranks_${n}a --phyxels 2000376 --seconds 0.3
    ranks $n gpu_ranks_${n}b --phyxels 16974593 --partitioner curve --seconds 0.3
    ranks $n gpu_ranks_${n}c --phyxels 16003008 --weak --partitioner curve --seconds 0.3
    ranks $n gpu_ranks_${n}f --phyxels 4096000 --partitioner metis --seconds 0.3
    ranks $n gpu_ranks_${n}g --phyxels 16974593 --partitioner metis --seconds 0.3
    transports=(nccl host)
    if "$program" doctor | grep -q ", CUDA-aware"; then transports+=(mpi); fi
    for transport in "${transports[@]}"; do
      ranks $n gpu_ranks_${n}d_$transport --phyxels 2000376,16974593 --partitioner curve --seconds 0.3 \
        --without-one --transport $transport
    done
  done
fi
if has large; then
  ranks "$gpus" gpu_ranks_${gpus}e --phyxels "${LARGE:-1000000000}" --partitioner curve --seconds 2 --repeat 3 \
    --without-one
fi
