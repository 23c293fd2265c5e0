#!/usr/bin/env bash
# Runs clang-tidy on the C++ sources of some folders; findings are errors (exit code 1).
#
#   scripts/tidy.sh [folder...]       default: lib partition mpi, as in CI; apps takes five times as long
#
# The compile commands are those of build/cpu, which must be configured.
set -euo pipefail
cd "$(dirname "$0")/.."

if [[ ! -f build/cpu/compile_commands.json ]]; then
  echo "scripts/tidy.sh: build/cpu is not configured: cmake --preset cpu" >&2
  exit 1
fi
folders=("$@")
if [[ ${#folders[@]} -eq 0 ]]; then
  folders=(lib partition mpi)
fi
# Only sources that this build compiles: clang-tidy would have to guess the commands of other sources.
find "${folders[@]}" -name '*.cpp' | sort | while read -r file; do
  if grep -q "\"file\": \"$PWD/$file\"" build/cpu/compile_commands.json; then echo "$file"; fi
done | xargs -P "$(nproc)" -n 4 clang-tidy --quiet -p build/cpu 2> >(grep -v 'warnings\? generated\.$' >&2)
