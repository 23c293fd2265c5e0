/// Lattices of nodes behind a body, on which smooth displacements have few unknowns.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// The number of nodes from which on several threads share a loop.
inline constexpr Index worth_threads = 2000;

/// A regular lattice of nodes.
struct Lattice {
  Vec3d low;           ///< Its lowest node [m].
  double spacing = 0;  ///< [m]
  Vec3<int> count;     ///< Nodes along each axis, at least 2.

  std::uint64_t key(Vec3<int> at) const {
    return (static_cast<std::uint64_t>(at.x) * static_cast<std::uint64_t>(count.y) +
            static_cast<std::uint64_t>(at.y)) *
               static_cast<std::uint64_t>(count.z) +
           static_cast<std::uint64_t>(at.z);
  }
  Vec3<int> node(std::uint64_t key) const;
  bool contains(Vec3<int> at) const {
    return at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < count.x && at.y < count.y &&
           at.z < count.z;
  }
  /// The lattice of twice the spacing whose hats are sums of those of this one.
  Lattice coarser() const;
};

/// The eight nodes around a place, and the values and gradients of their hats there.
struct LatticeCell {
  LatticeCell(const Lattice& lattice, Vec3d place);

  std::array<Vec3<int>, 8> node;
  std::array<double, 8> hat;
  std::array<Vec3d, 8> slope;  ///< [1/m]
};

/// The nodes of a lattice that are in use, and their stiffness against each other. A node has a
/// block for each of the 27 nodes around it, itself included.
class LatticeLevel {
 public:
  using Nodes = std::vector<Vec3d>;  ///< Shape [nodes].
  static constexpr int around = 27;

  /// @param keys of the nodes in use, ascending
  LatticeLevel(const Lattice& lattice, std::vector<std::uint64_t> keys);

  const Lattice& lattice() const { return lattice_; }
  Index size() const { return static_cast<Index>(keys_.size()); }
  Vec3<int> node(Index a) const { return lattice_.node(keys_[a]); }
  /// The number of a node; -1 if it is not in use.
  Index number(Vec3<int> at) const;
  /// The number of a node around another; -1 if it is not in use. @param k as of `place_around`
  Index near(Index a, int k) const { return near_[static_cast<std::size_t>(a)][k]; }
  /// The place of a block of a row, from the difference of nodes, each -1, 0 or 1.
  static int place_around(Vec3<int> way) { return (way.x + 1) * 9 + (way.y + 1) * 3 + way.z + 1; }

  /// Sets the block of a node against one around it [N/m].
  void set_block(Index a, int k, const Mat3d& block);
  Mat3d block(Index a, int k) const;
  /// Prepares smoothing, after all blocks are set.
  void begin();

  /// out = K x.
  void product(const Nodes& x, Nodes& out) const;
  /// x = ω D⁻¹ r, with the blocks D of nodes against themselves: smooths K x = r.
  void smooth(const Nodes& r, Nodes& x) const;
  /// r = 0 along axes along which a node does not move.
  void restrict_to_free(Nodes& r) const;

 private:
  double largest_eigenvalue() const;

  Lattice lattice_;
  std::vector<std::uint64_t> keys_;
  std::vector<std::array<Index, around>> near_;
  std::vector<float> blocks_;   // shape [nodes, 27, 3 columns, 4]
  std::vector<Mat3d> inverse_;  // of the blocks of nodes against themselves [m/N]
  double largest_ = 1;          // eigenvalue of inverse_ K
};

}  // namespace phyxel
