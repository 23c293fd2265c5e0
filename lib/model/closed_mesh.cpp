#include "model/closed_mesh.hpp"

#include <fmt/format.h>

#include "mesh/surface_topology.hpp"
#include "phyxel/error.hpp"

namespace phyxel {

Surface read_closed_mesh(const std::filesystem::path& file, const std::string& where) {
  Surface surface = read_mesh(file);
  const SurfaceDefects defects = inspect_surface(surface);
  if (!connect(surface).closed) {
    throw InputError(
        fmt::format("{}{}{}: the surface is not closed ({}), so that nothing lies inside; allowed: "
                    "a closed one",
                    where, where.empty() ? "" : ": ", file.string(), defects.describe()));
  }
  orient(surface);
  return surface;
}

}  // namespace phyxel
