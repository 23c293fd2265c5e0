#!/usr/bin/env bash
# Formats all C++ files, or with --check lists those that are not formatted (exit code 1).
set -euo pipefail
cd "$(dirname "$0")/.."

mode=(-i)
if [[ ${1-} == --check ]]; then
  mode=(--dry-run --Werror)
fi
find lib cuda partition mpi apps bench tests fuzz examples -name '*.[ch]pp' -o -name '*.cu' -o -name '*.cuh' | sort |
  xargs clang-format "${mode[@]}"
