#include "accuracy/round_bodies.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <utility>

#include "phyxel/mesh.hpp"

namespace phyxel::app {
namespace {

constexpr double pi = std::numbers::pi;

/// A lattice of hexahedral cells, bent.
struct BentBlock {
  std::array<int, 3> cells;           ///< Number along each side.
  std::function<Vec3d(Vec3d)> place;  ///< From the unit cube, right-handed [m].
};

/// The phyxels of blocks at the nodes of their cells, nodes of common faces once, each with an
/// eighth of every cell around it; and the surface of all blocks together.
class BentLattice {
 public:
  /// @param near distance below which nodes are one [m]
  BentLattice(const std::vector<BentBlock>& blocks, double near) : near_(near) {
    for (const BentBlock& block : blocks) add(block);
    std::map<Index, Index> surfel;
    for (const auto& [key, face] : faces_) {
      if (face.cells > 1) continue;
      std::array<Index, 4> corner{};
      for (int k = 0; k < 4; ++k) {
        const auto [at, is_new] =
            surfel.try_emplace(face.node[k], static_cast<Index>(surfel.size()));
        if (is_new) cloud_.surface.position.push_back(cloud_.position[face.node[k]]);
        corner[k] = at->second;
      }
      cloud_.surface.triangle.push_back({corner[0], corner[1], corner[2]});
      cloud_.surface.triangle.push_back({corner[0], corner[2], corner[3]});
    }
    cloud_.surface.normal = vertex_normals(cloud_.surface.position, cloud_.surface.triangle);
    on_surface_.resize(cloud_.position.size());
    for (const auto& [node, index] : surfel) on_surface_[node] = 1;
  }

  Cloud&& take() { return std::move(cloud_); }
  const std::vector<char>& on_surface() const { return on_surface_; }

 private:
  struct Face {
    std::array<Index, 4> node;  ///< Counter-clockwise seen from outside.
    int cells = 0;
  };

  Index node_at(Vec3d p) {
    // Off the middle between two steps, where nodes of symmetric bodies are.
    const auto step = [&](double x) { return std::llround(x / near_ + 0.37); };
    const auto [at, is_new] = nodes_.try_emplace({step(p.x), step(p.y), step(p.z)},
                                                 static_cast<Index>(cloud_.position.size()));
    if (is_new) cloud_.position.push_back(p), cloud_.volume.push_back(0);
    return at->second;
  }

  void add(const BentBlock& block) {
    const auto [nx, ny, nz] = block.cells;
    const auto node = [&, nx = nx, ny = ny, nz = nz](int i, int j, int k) {
      return node_at(block.place(
          {static_cast<double>(i) / nx, static_cast<double>(j) / ny, static_cast<double>(k) / nz}));
    };
    for (int k = 0; k < nz; ++k) {
      for (int j = 0; j < ny; ++j) {
        for (int i = 0; i < nx; ++i) {
          std::array<Index, 8> corner{};
          for (int c = 0; c < 8; ++c) {
            corner[c] = node(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1));
          }
          add_cell(corner);
        }
      }
    }
  }

  void add_cell(const std::array<Index, 8>& corner) {
    static constexpr int sides[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    double volume = 0;
    for (const auto& side : sides) {
      Face face;
      Vec3d middle;
      for (int k = 0; k < 4; ++k) {
        face.node[k] = corner[side[k]];
        middle += 0.25 * cloud_.position[face.node[k]];
      }
      for (int k = 0; k < 4; ++k) {
        const Vec3d& a = cloud_.position[face.node[k]];
        const Vec3d& b = cloud_.position[face.node[(k + 1) % 4]];
        volume += dot(middle, cross(a, b)) / 6;
      }
      std::array<Index, 4> key = face.node;
      std::sort(key.begin(), key.end());
      ++faces_.try_emplace(key, face).first->second.cells;
    }
    for (const Index i : corner) cloud_.volume[i] += volume / 8;
  }

  double near_;
  Cloud cloud_;
  std::map<std::array<long long, 3>, Index> nodes_;
  std::map<std::array<Index, 4>, Face> faces_;
  std::vector<char> on_surface_;
};

/// Moves phyxels inside by up to `jitter` spacings.
void jitter_inside(Cloud& cloud, const std::vector<char>& on_surface, double jitter,
                   double spacing) {
  std::mt19937_64 engine(1);
  const auto random = [&] { return static_cast<double>(engine() >> 11) * 0x1p-52 - 1; };
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    if (on_surface[i]) continue;
    cloud.position[i] += jitter * spacing * Vec3d{random(), random(), random()};
  }
}

/// The cloud as a discretisation has it: as it is, jittered, or spread on and in its surface.
/// @param touches true if the body keeps its surface also without closed gradients
Cloud filled(Cloud cloud, const std::vector<char>& on_surface, const Discretisation& d,
             double spacing, bool touches = false) {
  if (d.filling == Filling::mesh) {
    cloud = sample_surface(
        cloud.surface, {.phyxels = static_cast<Index>(cloud.position.size()), .on_surface = true});
  } else if (d.jitter > 0) {
    jitter_inside(cloud, on_surface, d.jitter, spacing);
  }
  if (d.closure == 0 && !touches) cloud.surface = {};
  order_along_curve(cloud);
  return cloud;
}

Cloud bent(const std::vector<BentBlock>& blocks, const Discretisation& d, double spacing,
           bool touches = false) {
  BentLattice lattice(blocks, 1e-6 * spacing);
  const std::vector<char> on_surface = lattice.on_surface();
  return filled(lattice.take(), on_surface, d, spacing, touches);
}

/// The surface of a cylinder: its side cut into triangles, its caps fans about the axis.
Surface cylinder_surface(double radius, double length, Index sides, int layers) {
  Surface surface;
  for (int k = 0; k <= layers; ++k) {
    for (Index n = 0; n < sides; ++n) {
      const double angle = 2 * pi * n / sides;
      surface.position.push_back(
          {radius * std::cos(angle), radius * std::sin(angle), length * k / layers});
    }
  }
  const auto low = static_cast<Index>(surface.position.size()), top = low + 1;
  surface.position.push_back({0, 0, 0});
  surface.position.push_back({0, 0, length});
  const auto at = [&](int layer, Index n) { return layer * sides + n % sides; };
  for (Index n = 0; n < sides; ++n) {
    surface.triangle.push_back({low, at(0, n + 1), at(0, n)});
    surface.triangle.push_back({top, at(layers, n), at(layers, n + 1)});
    for (int k = 0; k < layers; ++k) {
      surface.triangle.push_back({at(k, n), at(k, n + 1), at(k + 1, n + 1)});
      surface.triangle.push_back({at(k, n), at(k + 1, n + 1), at(k + 1, n)});
    }
  }
  surface.normal = vertex_normals(surface.position, surface.triangle);
  return surface;
}

}  // namespace

Cloud quarter_tube(const Discretisation& d, double inner_radius, double outer_radius) {
  const double wall = outer_radius - inner_radius, spacing = wall / d.across;
  const double middle = 0.5 * (inner_radius + outer_radius);
  const int around = static_cast<int>(std::lround(0.5 * pi * middle / spacing));
  return bent({{{d.across, around, 2},
                [=](Vec3d p) {
                  const double r = inner_radius + wall * p.x, angle = 0.5 * pi * p.y;
                  return Vec3d{r * std::cos(angle), r * std::sin(angle), 2 * spacing * p.z};
                }}},
              d, spacing);
}

double thickness_of_slice(const Discretisation& d, double radius) {
  return 2 * (2 * radius / d.across);
}

Cloud quarter_of_cylinder(const Discretisation& d, double radius) {
  const double spacing = 2 * radius / d.across, slice = thickness_of_slice(d, radius);
  const int around = static_cast<int>(std::lround(0.25 * pi * radius / spacing)),
            deep = static_cast<int>(std::lround(0.5 * radius / spacing));
  // A place whose larger component is 1, between the axis and the inner block's outside.
  const auto inside = [=](Vec3d side) { return 0.5 * radius * (0.4 + 0.6 / norm(side)) * side; };
  const auto lifted = [=](Vec3d p, double z) { return p + Vec3d{0, 0, slice * z}; };
  std::vector<BentBlock> blocks{
      {{around, around, 2}, [=](Vec3d p) {
         const Vec3d side{std::tan(0.25 * pi * p.x), std::tan(0.25 * pi * p.y), 0};
         const double larger = std::max(side.x, side.y);
         if (larger == 0) return lifted({}, p.z);
         return lifted(larger * inside((1 / larger) * side), p.z);
       }}};
  for (const bool above : {false, true}) {
    // From the inner block outwards along x of the cell, or along y of it above.
    const std::array<int, 3> cells =
        above ? std::array{around, deep, 2} : std::array{deep, around, 2};
    blocks.push_back({cells, [=](Vec3d p) {
                        const double along = above ? p.x : p.y, out = above ? p.y : p.x;
                        const double slope = std::tan(0.25 * pi * along);
                        const Vec3d v = above ? Vec3d{slope, 1, 0} : Vec3d{1, slope, 0};
                        return lifted((1 - out) * inside(v) + (out * radius / norm(v)) * v, p.z);
                      }});
  }
  return bent(blocks, d, spacing, true);
}

Cloud strap_on_drum(const Discretisation& d, double radius, double thickness, double tail) {
  const double spacing = thickness / d.across, slice = 2 * spacing;
  const int around = static_cast<int>(std::lround(pi * (radius + 0.5 * thickness) / spacing)),
            down = static_cast<int>(std::lround(tail / spacing));
  std::vector<BentBlock> blocks{
      {{d.across, around, 2}, [=](Vec3d p) {
         const double r = radius + thickness * p.x, angle = pi * p.y;
         return Vec3d{r * std::cos(angle), r * std::sin(angle), slice * p.z};
       }}};
  for (const double side : {1.0, -1.0}) {
    blocks.push_back({{d.across, down, 2}, [=](Vec3d p) {
                        const double r = radius + thickness * (side > 0 ? p.x : 1 - p.x);
                        return Vec3d{side * r, tail * (p.y - 1), slice * p.z};
                      }});
  }
  return bent(blocks, d, spacing, true);
}

Cloud eighth_of_shell(const Discretisation& d, double inner_radius, double outer_radius) {
  const double wall = outer_radius - inner_radius, spacing = wall / d.across;
  const double middle = 0.5 * (inner_radius + outer_radius);
  const int around = static_cast<int>(std::lround(0.25 * pi * middle / spacing));
  std::vector<BentBlock> blocks;
  for (int axis = 0; axis < 3; ++axis) {
    blocks.push_back(
        {{around, around, d.across}, [=](Vec3d p) {
           const double r = inner_radius + wall * p.z;
           const double side[3] = {std::tan(0.25 * pi * p.x), std::tan(0.25 * pi * p.y), 1};
           const Vec3d v{side[(5 - axis) % 3], side[(6 - axis) % 3], side[(7 - axis) % 3]};
           return (r / norm(v)) * v;
         }});
  }
  return bent(blocks, d, spacing);
}

Cloud eighth_of_ball(const Discretisation& d, double radius) {
  const double spacing = 2 * radius / d.across;
  const int around = static_cast<int>(std::lround(0.25 * pi * radius / spacing)),
            deep = static_cast<int>(std::lround(0.5 * radius / spacing));
  // A place whose largest component is 1, between the middle and the inner block's outside.
  const auto inside = [=](Vec3d side) { return 0.5 * radius * (0.4 + 0.6 / norm(side)) * side; };
  std::vector<BentBlock> blocks{
      {{around, around, around}, [=](Vec3d p) {
         const Vec3d side{std::tan(0.25 * pi * p.x), std::tan(0.25 * pi * p.y),
                          std::tan(0.25 * pi * p.z)};
         const double largest = std::max({side.x, side.y, side.z});
         return largest == 0 ? Vec3d{} : largest * inside((1 / largest) * side);
       }}};
  for (int axis = 0; axis < 3; ++axis) {
    blocks.push_back(
        {{around, around, deep}, [=](Vec3d p) {
           const double side[3] = {std::tan(0.25 * pi * p.x), std::tan(0.25 * pi * p.y), 1};
           const Vec3d v{side[(5 - axis) % 3], side[(6 - axis) % 3], side[(7 - axis) % 3]};
           return (1 - p.z) * inside(v) + (p.z * radius / norm(v)) * v;
         }});
  }
  return bent(blocks, d, spacing, true);
}

Cloud rod(const Discretisation& d, double radius, double length) {
  const double spacing = 2 * radius / d.across;
  if (d.filling == Filling::cells) {
    BodyRequest body;
    body.name = "rod";
    body.where = "phyxel accuracy";
    body.source.shape = {.name = "cylinder",
                         .radius = radius,
                         .length = length,
                         .spacing = spacing,
                         .jitter = d.jitter};
    body.translation = {0, 0, 0.5 * length};
    return make_cloud(body);
  }
  const int rings = std::max(1, d.across / 2);
  const int layers = static_cast<int>(std::lround(length / spacing));
  const double s = radius / rings, high = length / layers;
  Cloud cloud;
  std::vector<char> on_surface;
  for (int k = 0; k <= layers; ++k) {
    const bool end = k == 0 || k == layers;
    const double z = high * k, thick = end ? 0.5 * high : high;
    cloud.position.push_back({0, 0, z});
    cloud.volume.push_back(pi * 0.25 * s * s * thick);
    on_surface.push_back(end);
    for (int ring = 1; ring <= rings; ++ring) {
      const bool outer = ring == rings;
      const double from = ring - 0.5, to = outer ? ring : ring + 0.5;
      const int count = 6 * ring;
      for (int n = 0; n < count; ++n) {
        const double angle = 2 * pi * n / count;
        cloud.position.push_back({ring * s * std::cos(angle), ring * s * std::sin(angle), z});
        cloud.volume.push_back(pi * (to * to - from * from) * s * s * thick / count);
        on_surface.push_back(end || outer);
      }
    }
  }
  cloud.surface = cylinder_surface(radius, length, 6 * rings, layers);
  cloud = filled(std::move(cloud), on_surface, d, spacing);
  for (Index i = 0; i < static_cast<Index>(cloud.position.size()); ++i) {
    if (cloud.position[i].z < 1e-6 * length) cloud.regions["z-"].push_back(i);
  }
  return cloud;
}

}  // namespace phyxel::app
