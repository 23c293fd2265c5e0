/// The stiffness of a body on nested lattices, for smooth displacements.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "model/box.hpp"
#include "phyxel/communicator.hpp"
#include "phyxel/types.hpp"
#include "solver/lattice_level.hpp"

namespace phyxel {

/// Lattices of twice, four times ... the spacing of a body's phyxels. The stiffness on the finest
/// is that of its hats, by quadrature over the phyxels:
///
///   K_ab = Σ_i v_i [λ F∇N_a (F∇N_b)ᵀ + μ (F∇N_b (F∇N_a)ᵀ + ∇N_a · ∇N_b F Fᵀ)] + N_a N_b C_i,
///
/// with the deformation gradient F of the phyxel, and more stiffness C_i, as by inertia.
/// On coarser ones it is that of the sums of these hats. A V-cycle with damped Jacobi smoothing
/// solves for it nearly, exactly on the coarsest. Every rank has all nodes; sums over phyxels are
/// of whole multiples of a quantum, so that they have the same bits on any number of ranks and
/// threads.
class BodyLattices {
 public:
  using Nodes = LatticeLevel::Nodes;

  /// A phyxel of this rank.
  struct Source {
    Index phyxel = 0;
    Vec3d place;                ///< At rest [m].
    double volume = 0;          ///< [m³]
    double lambda = 0, mu = 0;  ///< Lamé's parameters [Pa].
  };

  /// What the stiffness depends on. Spans have the shape [n], or are empty.
  struct Present {
    std::span<const Mat3d> gradient;  ///< Of displacement; empty: small.
    std::span<const Mat3d> more;      ///< Stiffness C [N/m].
  };

  /// Collective on a share. @param ranks null without ranks
  /// @param box around the phyxels of all ranks [m]. @param spacing of phyxels [m]
  BodyLattices(const Communicator* ranks, const Box& box, double spacing,
               std::vector<Source> sources);

  /// Sets the stiffness. Collective on a share. @param free 1 along free axes, shape [n]
  void set(std::span<const Vec3d> free, const Present& present);

  /// From the finest to the coarsest.
  const std::vector<LatticeLevel>& levels() const { return levels_; }

  /// The most that a sum of values of r times `by` may be: products with hats are then exact.
  static constexpr double largest_sum = 1LL << 37;

  /// Numbers that `gather` writes.
  std::size_t size() const { return 3 * static_cast<std::size_t>(levels_.front().size()); }
  /// The most values of r that a node takes a part of, on all ranks.
  double most() const { return most_; }
  /// Gives the sums of r over the phyxels of this rank, times the hats of nodes.
  /// @param by values of r times it are rounded to whole numbers, whose sums in double are exact
  void gather(std::span<const Vec3d> free, std::span<const Vec3d> r, double by,
              std::span<std::int64_t> sums);
  /// The sum of r, from the sums of all ranks. @param by as of `gather`
  Vec3d total(std::span<const std::int64_t> sums, double by) const;
  /// Sets the sums of the shares of phyxels in the motion of the whole body, of all ranks.
  void set_shares(std::span<const std::int64_t> sums, double by) { shares_ = at_nodes(sums, by); }
  /// Solves for r - share times mean, and adds the solution to x at the phyxels of this rank.
  /// @param sums of r, of all ranks. @param by as of `gather`
  void correct(std::span<const std::int64_t> sums, double by, Vec3d mean,
               std::span<const Vec3d> free, std::span<Vec3d> x);

 private:
  /// The nodes of a level in terms of the next coarser one.
  struct Transfer {
    struct Term {
      Index node = 0;
      double weight = 0;
    };
    std::vector<Offset> parent_start, child_start;
    std::vector<Term> parents;   ///< Of each fine node.
    std::vector<Term> children;  ///< Of each coarse node.
  };

  Nodes at_nodes(std::span<const std::int64_t> sums, double by) const;
  void add_level();
  void find_entries();
  std::vector<Vec3d> free_nodes(std::span<const Vec3d> free) const;
  void assemble(std::span<const Vec3d> free, const Present& present);
  double largest_entry(const Present& present) const;
  void find_cells();
  /// Adds up the stiffness of the cells of a layer of the lattice, times `by`.
  std::vector<double> stiffness_of_cells(int layer, const Present& present, double by) const;
  void add_cell(Index node, Index cell, const double* matrix, std::int64_t* blocks) const;
  void coarsen(std::size_t level);
  void factor();
  void solve_coarsest();
  void cycle(std::size_t level);
  void add_over_ranks(std::span<std::int64_t> sums) const {
    if (ranks_) ranks_->add(sums);
  }

  const Communicator* ranks_;
  std::vector<Source> sources_;
  double most_ = 0;
  std::vector<LatticeLevel> levels_;  // from the finest to the coarsest
  std::vector<Transfer> transfers_;   // between each and the next
  // Of each source: its nodes and their hats, shape [sources, 8]; and by node, which these are.
  std::vector<Index> node_;
  std::vector<float> hat_;  // whole multiples of a quantum, of each source 1 in all
  std::vector<Offset> entry_start_;
  std::vector<Index> entry_;
  // Cells of the finest lattice with phyxels of this rank, by their layers along x: their sources
  // and nodes; and by node, in which cells it is, times 8 plus its place there.
  std::vector<Offset> layer_start_, source_start_, cell_start_;
  std::vector<Index> source_, cell_;
  std::vector<std::array<Index, 8>> cell_node_;
  std::vector<double> factor_;       // of the coarsest stiffness, a lower triangle by columns
  std::vector<Nodes> right_, left_;  // of each level: right sides and solutions
  Nodes rest_, more_, shares_;
  std::vector<Vec3d> rounded_;  // r of each source
};

}  // namespace phyxel
