#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "shapes/implicit_body.hpp"

namespace phyxel {
namespace {

/// Marching tetrahedra over the lattice of the bounding box, with the values of one block of
/// lattice points in memory at a time.
class Polygoniser {
 public:
  Polygoniser(const ImplicitBody& body, double cell) : body_(body), cell_(cell) {
    const Vec3d margin{cell, cell, cell};
    origin_ = body.low() - margin;
    const Vec3d extent = body.high() + margin - origin_;
    blocks_ = {block_count(extent.x), block_count(extent.y), block_count(extent.z)};
  }

  Surface run() {
    for (int z = 0; z < blocks_[2]; ++z)
      for (int y = 0; y < blocks_[1]; ++y)
        for (int x = 0; x < blocks_[0]; ++x) polygonise_block({x, y, z});
    surface_.normal = vertex_normals(surface_.position, surface_.triangle);
    return std::move(surface_);
  }

 private:
  static constexpr int side = 8;  // cells along a side of a block
  using Cell = std::array<int, 3>;

  int block_count(double extent) const {
    return static_cast<int>(std::ceil(extent / (side * cell_))) + 1;
  }
  Vec3d place(const Cell& c) const {
    return origin_ + cell_ * Vec3d{1. * c[0], 1. * c[1], 1. * c[2]};
  }

  void polygonise_block(const Cell& block) {
    const Cell first{side * block[0], side * block[1], side * block[2]};
    // A block is empty if the function in its middle exceeds the largest change towards a corner;
    // the slope stays below 1.5 for the parts in use.
    const Vec3d middle = place(first) + 0.5 * side * cell_ * Vec3d{1, 1, 1};
    if (std::abs(body_.value(middle)) > 1.5 * std::sqrt(3.) * 0.5 * side * cell_) return;
    for (int k = 0, v = 0; k <= side; ++k)
      for (int j = 0; j <= side; ++j)
        for (int i = 0; i <= side; ++i, ++v)
          value_[v] = body_.value(place({first[0] + i, first[1] + j, first[2] + k}));
    for (int k = 0; k < side; ++k)
      for (int j = 0; j < side; ++j)
        for (int i = 0; i < side; ++i) polygonise_cube(first, {i, j, k});
  }

  /// Polygonises six tetrahedra about the cube's diagonal, one for each order of the three axes.
  void polygonise_cube(const Cell& first, const Cell& local) {
    static constexpr int axes[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1},
                                       {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    for (int order = 0; order < 6; ++order) {
      std::array<Corner, 4> corner;
      Cell at = local;
      for (int step = 0;; ++step) {
        corner[step] = {{first[0] + at[0], first[1] + at[1], first[2] + at[2]},
                        value_[at[0] + (side + 1) * (at[1] + (side + 1) * at[2])]};
        if (step == 3) break;
        ++at[axes[order][step]];
      }
      if (order >= 3) std::swap(corner[0], corner[1]);  // makes the tetrahedron right-handed
      polygonise_tetrahedron(corner);
    }
  }

  struct Corner {
    Cell at;
    double value;
  };

  void polygonise_tetrahedron(const std::array<Corner, 4>& corner) {
    std::array<int, 4> inside, outside;
    int n_in = 0, n_out = 0;
    for (int c = 0; c < 4; ++c) {
      if (corner[c].value < 0)
        inside[n_in++] = c;
      else
        outside[n_out++] = c;
    }
    const auto vertex = [&](int a, int b) { return vertex_on(corner[a], corner[b]); };
    const auto odd = [](int a, int b, int c, int d) {
      const int p[4] = {a, b, c, d};
      int swaps = 0;
      for (int i = 0; i < 4; ++i)
        for (int j = i + 1; j < 4; ++j) swaps += p[i] > p[j];
      return swaps % 2 == 1;
    };
    const auto emit = [&](Index a, Index b, Index c, bool turn) {
      surface_.triangle.push_back(turn ? Triangle{a, c, b} : Triangle{a, b, c});
    };
    if (n_in == 1 || n_in == 3) {
      const int apex = n_in == 1 ? inside[0] : outside[0];
      const auto& base = n_in == 1 ? outside : inside;
      const bool turn = odd(apex, base[0], base[1], base[2]) != (n_in == 3);
      emit(vertex(apex, base[0]), vertex(apex, base[1]), vertex(apex, base[2]), turn);
    } else if (n_in == 2) {
      const int a = inside[0], b = inside[1], c = outside[0], d = outside[1];
      const bool turn = odd(a, b, c, d);
      const Index ac = vertex(a, c), ad = vertex(a, d), bc = vertex(b, c), bd = vertex(b, d);
      emit(ac, ad, bd, turn);
      emit(ac, bd, bc, turn);
    }
  }

  Index vertex_on(const Corner& p, const Corner& q) {
    const Cell low{std::min(p.at[0], q.at[0]), std::min(p.at[1], q.at[1]),
                   std::min(p.at[2], q.at[2])};
    // The ends of an edge differ by 0 or 1 on each axis, with the same sign on all axes.
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis) {
      key = key << 20 | static_cast<std::uint64_t>(low[axis]);
    }
    for (int axis = 0; axis < 3; ++axis) key = key << 1 | (p.at[axis] != q.at[axis]);
    const auto [found, fresh] = vertices_.try_emplace(key, static_cast<Index>(vertices_.size()));
    if (fresh) {
      // Vertices are kept off the lattice points, so that no triangle is degenerate.
      const double t = std::clamp(p.value / (p.value - q.value), 0.02, 0.98);
      surface_.position.push_back((1 - t) * place(p.at) + t * place(q.at));
    }
    return found->second;
  }

  const ImplicitBody& body_;
  double cell_;
  Vec3d origin_;
  Cell blocks_;
  std::array<double, (side + 1) * (side + 1) * (side + 1)> value_{};
  std::unordered_map<std::uint64_t, Index> vertices_;
  Surface surface_;
};

}  // namespace

Surface polygonise(const ImplicitBody& body, double cell) { return Polygoniser(body, cell).run(); }

}  // namespace phyxel
