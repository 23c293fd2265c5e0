#!/usr/bin/env bash
# Installs missing packages, builds phyxel, simulates the dino hung by its mouth, and draws it.
# Further arguments are passed to `phyxel run`, e.g. scripts/run.sh --precision double
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/setup-debian.sh
generator=()
command -v ninja >/dev/null || generator=(-G "Unix Makefiles")
cmake --preset cpu "${generator[@]}" -DPHYXEL_TESTS=OFF
cmake --build --preset cpu --parallel "$(nproc)"
build/cpu/bin/phyxel run examples/dino/scene.toml --out out/dino --force "$@"
cat <<MESSAGE

Trajectory  out/dino/phyxels.hdf.series, out/dino/surface.hdf.series (open them in ParaView)
Pictures    out/dino/pictures/*.png
Program     build/cpu/bin/phyxel --help
Scenes      examples/*/scene.toml
MESSAGE
