#!/usr/bin/env bash
# Installs the Debian packages that phyxel needs. No other file lists them.
#
#   scripts/setup-debian.sh            packages for building and running
#   scripts/setup-debian.sh --tests    also packages for the tests
#
# Installs missing packages as root or through sudo; otherwise prints the command and ends with exit code 1.
set -euo pipefail

build=(g++ cmake ninja-build git libeigen3-dev libtomlplusplus-dev libcli11-dev libfmt-dev
       libhdf5-dev libxxhash-dev libpng-dev libtinyobjloader-dev nlohmann-json3-dev
       libmetis-dev libopenmpi-dev openmpi-bin
       libboost-dev          # phyxel view
       gnuplot-nox           # the figures of phyxel paper
       ffmpeg                # phyxel render --video
       help2man dpkg-dev)    # the manual page, and packages
# clang for sanitizers, fuzzers and static analysis, Doxygen for the reference, Python for the module and for independent
# reading of files, Chromium for pages, fish and zsh for their completions, parallel HDF5 beside the serial one, and CalculiX,
# beside which phyxel is measured.
tests=(ccache pkg-config clang-format clang-tidy doxygen libgtest-dev libgmock-dev clang libclang-rt-dev libomp-dev lld llvm
       python3-h5py python3-vtk9 python3-dev pybind11-dev python3-numpy python3-pytest
       python3-matplotlib python3-pandas python3-meshio chromium fish zsh libhdf5-openmpi-dev calculix-ccx)

wanted=("${build[@]}")
if [[ ${1-} == --tests ]]; then
  wanted+=("${tests[@]}")
elif [[ $# -gt 0 ]]; then
  echo "usage: scripts/setup-debian.sh [--tests]" >&2
  exit 2
fi

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  echo "Not a Debian system: nothing installed. phyxel needs the equivalents of:" >&2
  echo "  ${wanted[*]}" >&2
  exit 0
fi

missing=()
for package in "${wanted[@]}"; do
  if ! dpkg-query -W -f '${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed; then
    missing+=("$package")
  fi
done
if [[ ${#missing[@]} -eq 0 ]]; then
  exit 0
fi

install=(apt-get install -y --no-install-recommends "${missing[@]}")
if [[ $(id -u) -eq 0 ]]; then
  as_root=(env DEBIAN_FRONTEND=noninteractive)
elif command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [[ -t 0 ]]; }; then
  as_root=(sudo env DEBIAN_FRONTEND=noninteractive)  # asks for a password on a terminal only
else
  echo "Packages are missing, and this user may not install them. As root, type:" >&2
  echo "  apt-get update && ${install[*]}" >&2
  exit 1
fi
echo "Installing: ${missing[*]}"
"${as_root[@]}" apt-get update
"${as_root[@]}" "${install[@]}"
