"""Recipe for tinyobjloader: Spack's own recipe ends at version 1.0, whose callbacks cannot report warnings."""

from spack_repo.builtin.packages.tinyobjloader.package import Tinyobjloader as Builtin

from spack.package import *


class Tinyobjloader(Builtin):
    """Tiny but powerful single file wavefront obj loader."""

    git = "https://github.com/tinyobjloader/tinyobjloader.git"
    version("2.0.0rc10", tag="v2.0.0rc10")
