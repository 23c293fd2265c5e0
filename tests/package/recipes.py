"""Holds what CITATION.cff, the container and the conda recipe say against the source tree: the version, the licence, the paper,
presets and scripts, and CMake's options.

    python3 recipes.py <source folder>
"""
import json
import pathlib
import re
import sys

source = pathlib.Path(sys.argv[1])


def text(name):
    return (source / name).read_text(encoding="utf-8")


cmake = text("CMakeLists.txt")
every_cmake = cmake + "".join(path.read_text(encoding="utf-8") for path in source.glob("cmake/*.cmake"))
version = re.search(r"project\(phyxel VERSION ([\d.]+)", cmake)[1]
citation, recipe, container = text("CITATION.cff"), text("packaging/conda/meta.yaml"), text("Containerfile")

for name, written in (("CITATION.cff", re.search(r"^version: (.*)$", citation, re.MULTILINE)),
                      ("packaging/conda/meta.yaml", re.search(r"^  version: (.*)$", recipe, re.MULTILINE)),
                      ("pyproject.toml", re.search(r'^version = "(.*)"$', text("pyproject.toml"), re.MULTILINE))):
    assert written and written[1] == version, f"{name}: version {written and written[1]}; needed: {version}, CMakeLists.txt's"

assert text("LICENSE").startswith("BSD 3-Clause License")
for name, written in (("CITATION.cff", citation), ("packaging/conda/meta.yaml", recipe)):
    assert re.search(r"^ *license: BSD-3-Clause$", written, re.MULTILINE), f"{name}: another licence than LICENSE"

# The paper, as docs/paper.md cites it.
cited = " ".join(text("docs/paper.md").split("\n\n")[1].split())
names = re.findall(r"family-names: (\w+)\n\s+given-names: (.*)", citation)
assert cited.startswith(", ".join(f"{given} {family}" for family, given in names) + ": "), names
title, year, series = (re.search(rf"^ +{key}: (.*)$", citation, re.MULTILINE)[1] for key in ("title", "year", "collection-title"))
assert f"*{title}*, {series}" in cited and series.endswith(year), (title, year, series)

# The container.
for script in re.findall(r"scripts/[\w-]+\.sh", container):
    assert (source / script).exists(), f"Containerfile: {script} is not there"
presets = json.loads(text("CMakePresets.json"))
for preset in re.findall(r"--workflow --preset (\w+)", container):
    assert preset in [one["name"] for one in presets["workflowPresets"]], f"Containerfile: no workflow {preset}"
    folder = re.search(rf"/phyxel/build/(\w+)/phyxel_", container)[1]
    assert folder == preset, f"Containerfile: packages are in build/{preset}, not build/{folder}"

# The conda recipe: options that CMake reads, and a package for each library that it looks for.
options = re.findall(r"-D(\w+)=", recipe)
assert len(options) >= 6, options
for option in options:
    assert option.startswith("CMAKE_") or re.search(rf"\b{option}\b", every_cmake), f"{option}: read by no CMake file"
least = re.search(r"cmake_minimum_required\(VERSION ([\d.]+)\)", cmake)[1]
for package in f"cmake >={least}|eigen >=3.4|fmt|hdf5 .*|metis|libpng|cli11|nlohmann_json|tomlplusplus|tinyobjloader|xxhash|openmpi".split("|"):
    assert re.search(rf"^    - {package}$", recipe, re.MULTILINE), f"packaging/conda/meta.yaml: no {package}"
