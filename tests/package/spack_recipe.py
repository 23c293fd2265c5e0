"""Runs Spack's recipe beside a stand-in for Spack, and holds what it says against the build: every
option that it sets is one that CMake files read, and CMake's version is the one they ask for.

    python3 spack_recipe.py <source folder>
"""

import pathlib
import re
import sys
import types


class Package:
    """What build systems of Spack give to a recipe, as far as this one uses it."""

    @staticmethod
    def define(name, value):
        return name, value

    define_from_variant = define

    class spec:
        variants = {"cuda_arch": types.SimpleNamespace(value=("90",))}

        @staticmethod
        def satisfies(_):
            return True


class Cuda:
    pass


said = {}


def directive(name):
    return lambda *args, **options: said.setdefault(name, []).append((args, options))


def stand_in(module, **names):
    parts = module.split(".")
    for end in range(1, len(parts) + 1):
        sys.modules.setdefault(".".join(parts[:end]), types.ModuleType(parts[end - 1]))
    vars(sys.modules[module]).update(names)


source = pathlib.Path(sys.argv[1])
repository = source / "scripts/spack/spack_repo/phyxel"
names = ["license", "version", "variant", "depends_on", "conflicts"]
stand_in("spack.package", **{name: directive(name) for name in names})
stand_in("spack_repo.builtin.build_systems.cmake", CMakePackage=Package)
stand_in("spack_repo.builtin.build_systems.cuda", CudaPackage=Cuda)
stand_in("spack_repo.builtin.packages.tinyobjloader.package", Tinyobjloader=Package)


def recipe(package):
    file = repository / f"packages/{package}/package.py"
    found = {"__file__": str(file), "__name__": package}
    exec(compile(file.read_text(), file, "exec"), found)
    return found[package.capitalize()]


phyxel = recipe("phyxel")
assert phyxel.git == f"file://{source.resolve()}", phyxel.git

cmake = "".join(
    path.read_text() for path in [source / "CMakeLists.txt", *source.glob("cmake/*.cmake")]
)
for option, _ in phyxel().cmake_args():
    assert re.search(rf"\b{option}\b", cmake), f"{option}: read by no CMake file"
variants = {args[0] for args, _ in said["variant"]}
assert {"mpi", "parallel_hdf5", "shared", "view"} == variants, variants

needed = " ".join(args[0] for args, _ in said["depends_on"])
least = re.search(r"cmake_minimum_required\(VERSION ([\d.]+)\)", cmake)[1]
assert f"cmake@{least}:" in needed, least
for package in "fmt hdf5 metis libpng eigen cli11 nlohmann-json tomlplusplus xxhash mpi cuda".split():
    assert package in needed, package

recipe("tinyobjloader")
(own,) = [args[0] for args, _ in said["version"] if args[0] != "main"]
assert f"tinyobjloader@{own}" in needed, own
