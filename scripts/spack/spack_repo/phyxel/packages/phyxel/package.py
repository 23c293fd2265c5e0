"""Spack's recipe, for Spack 1.0 and later. In a clone of phyxel's repository:

    spack repo add scripts/spack/spack_repo/phyxel
    spack install phyxel
    spack install phyxel +cuda cuda_arch=90 +parallel_hdf5
"""

import os

from spack_repo.builtin.build_systems.cmake import CMakePackage
from spack_repo.builtin.build_systems.cuda import CudaPackage

from spack.package import *


class Phyxel(CMakePackage, CudaPackage):
    """Deformable bodies made of phyxels, physics points without a mesh, that carry surfels:
    total-Lagrangian moving least squares on CPUs, GPUs and the ranks of MPI."""

    license("BSD-3-Clause")

    # The clone that contains this recipe.
    git = "file://" + os.path.abspath(os.path.join(os.path.dirname(__file__), *[os.pardir] * 6))
    version("main", branch="main")

    variant("mpi", default=True, description="Bodies shared by MPI ranks")
    variant("parallel_hdf5", default=False, description="Ranks write long arrays collectively")
    variant("view", default=True, description="Live views in a browser (phyxel view)")
    variant("shared", default=True, description="Shared libraries")

    depends_on("c", type="build")
    depends_on("cxx", type="build")
    depends_on("boost@1.74:", type="build", when="+view")
    depends_on("cmake@3.25:", type="build")
    depends_on("cli11", type="build")
    depends_on("eigen@3.4:3", type="build")
    depends_on("nlohmann-json", type="build")
    depends_on("tinyobjloader@2.0.0rc10", type="build")
    depends_on("tomlplusplus", type="build")
    depends_on("xxhash", type="build")
    depends_on("fmt")
    depends_on("hdf5 ~mpi", when="~parallel_hdf5")
    depends_on("hdf5 +mpi", when="+parallel_hdf5")
    depends_on("libpng")
    depends_on("metis")
    depends_on("mpi", when="+mpi")
    depends_on("cuda@12:", when="+cuda")
    depends_on("gnuplot", type="run")  # the figures of phyxel paper

    conflicts("~mpi", when="+parallel_hdf5", msg="Parallel HDF5 needs MPI; allowed: +mpi")
    conflicts("cuda_arch=none", when="+cuda", msg="No GPU architecture; allowed: e.g. cuda_arch=90")
    conflicts("%gcc@:10", msg="phyxel is written in C++20; allowed: GCC 11 or later")

    def cmake_args(self):
        args = [
            self.define_from_variant("PHYXEL_MPI", "mpi"),
            self.define_from_variant("PHYXEL_CUDA", "cuda"),
            self.define_from_variant("PHYXEL_PARALLEL_HDF5", "parallel_hdf5"),
            self.define_from_variant("PHYXEL_VIEW", "view"),
            self.define_from_variant("BUILD_SHARED_LIBS", "shared"),
            self.define("PHYXEL_TESTS", False),
            self.define("PHYXEL_PYTHON", "OFF"),  # pip's
            self.define("PHYXEL_MARCH", ""),  # Spack's compiler wrapper adds the target's
        ]
        if self.spec.satisfies("+cuda"):
            architectures = self.spec.variants["cuda_arch"].value
            args.append(self.define("CMAKE_CUDA_ARCHITECTURES", architectures))
        return args
