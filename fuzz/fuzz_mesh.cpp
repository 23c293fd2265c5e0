/// Fuzzer of the mesh readers: the first byte chooses the format, the rest is the file. The only
/// error is an InputError, and a mesh that is read must be valid.
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "mesh/mesh_formats.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace phyxel;
  if (size == 0) return 0;
  const MeshFormat format = static_cast<MeshFormat>(data[0] % 3);
  const std::string_view content(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    const Surface surface = parse_mesh(content, format, "mesh");
    require(!surface.triangle.empty() && surface.normal.size() == surface.position.size());
    for (const Vec3d& p : surface.position) require(is_finite(p));
    for (const Triangle& t : surface.triangle) {
      for (const Index corner : t) {
        require(corner >= 0 && static_cast<std::size_t>(corner) < surface.position.size());
      }
    }
    const SurfaceDefects defects = inspect_surface(surface);
    require(defects.parts > 0 && !defects.describe().empty());
  } catch (const InputError& error) {
    require(error.what()[0] == 'm');  // the message names the file
  }
  return 0;
}
