/// Neighbour lists and inverse neighbour lists as compressed rows.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// Compressed rows: row i is indices[offsets[i] .. offsets[i+1]), ascending.
struct Csr {
  std::vector<Offset> offsets{0};  ///< shape [rows + 1]
  std::vector<Index> indices;      ///< shape [entries]

  /// Number of rows.
  Index rows() const { return static_cast<Index>(offsets.size() - 1); }
  /// Number of entries of all rows.
  Offset entries() const { return offsets.back(); }
  /// Number of entries of one row.
  Index length(Index row) const { return static_cast<Index>(offsets[row + 1] - offsets[row]); }
  /// Entries of row i, ascending.
  std::span<const Index> row(Index i) const {
    return {indices.data() + offsets[i], indices.data() + offsets[i + 1]};
  }
};

/// The transpose of a pattern: row i of the result contains j if row j of `csr` contains i. Takes
/// linear time. @throws InputError for an index that is no column
Csr transpose(const Csr& csr, Index columns);

/// How the support radius h of each phyxel is chosen. Source: Mueller et al. 2004, section 4.2:
/// h_i = factor * (mean distance to the `nearest` nearest phyxels).
struct NeighbourhoodRule {
  /// The scope of a support radius: a body or a phyxel.
  enum class Support {
    automatic,  ///< `pairwise` for a cloud with spacings of its own (`Cloud::spacing`), unless
                ///< `radius` or `max_neighbours` is set; else `uniform`.
    uniform,    ///< One h for the body, from the median of the mean distances. Lists are symmetric,
                ///< and serve both passes.
    adaptive,   ///< A different h for each phyxel, as in the 2004 paper (with a factor of 3).
    pairwise,   ///< A different h for each phyxel, and for a pair their mean. Lists and weights
                ///< (`pair_weight`) are symmetric, as for one support.
  };
  Support support = Support::automatic;
  int nearest = 10;
  double factor = 1.8;           ///< 1.8 gives about 32 neighbours in a uniform cloud.
  std::optional<double> radius;  ///< h [m], in place of the rule.
  std::optional<int>
      max_neighbours;  ///< Limit to the nearest (maxNeighbors in the 2008 paper); one-sided lists.

  /// True if i may be a neighbour of j without j being a neighbour of i.
  bool one_sided() const { return max_neighbours || (!radius && support == Support::adaptive); }
  /// True if supports and weights are those of pairs. An automatic rule is not, until `resolved`.
  bool pairwise() const { return !radius && support == Support::pairwise; }
  /// True if supports differ from phyxel to phyxel.
  bool differs() const {
    return !radius && (support == Support::adaptive || support == Support::pairwise);
  }
  /// This rule for a cloud, with `uniform` or `pairwise` in place of `automatic`.
  /// @param has_spacing true if the cloud has spacings of its own
  NeighbourhoodRule resolved(bool has_spacing) const;
};

/// The support h_ij [m] of a pair of phyxels whose supports differ (`Support::pairwise`).
inline double pair_support(double h_i, double h_j) { return 0.5 * (h_i + h_j); }

/// Neighbour lists of all phyxels: N(i) contains j ≠ i if |x_j - x_i| < h_i (h_ij for the supports
/// of pairs), except pairs across the boundary of a support (`Cloud::cuts`). The lists are empty if
/// the device finds them; `support` is always set.
struct Neighbourhood {
  Csr neighbours;               ///< N(i)
  Csr inverse_lists;            ///< {j : i in N(j)}; empty if `symmetric`.
  bool symmetric = true;        ///< True if N is its own inverse, which `inverse()` then returns.
  std::vector<double> support;  ///< h_i [m], shape [n_phyxels].
  /// The inverse lists, {j : i in N(j)}.
  const Csr& inverse() const { return symmetric ? neighbours : inverse_lists; }
};

/// Mean distance from each phyxel to the `nearest` nearest phyxels [m], shape [n_phyxels]; with
/// fewer phyxels, to all others (0 for a single phyxel).
/// @throws InputError for a position that is not finite, or `nearest` < 1
std::vector<double> mean_spacing(std::span<const Vec3d> position, int nearest);

/// The distances between phyxels from which supports follow [m]: the cloud's own, times the median
/// of their ratios to the mean ones; the mean ones if it has none of its own.
/// @param mean result of `mean_spacing`. @param own `Cloud::spacing`
std::vector<double> graded_spacing(std::span<const double> mean, std::span<const double> own);

/// Neighbour search through the spatial hash of Teschner et al. 2003, in time linear in the number
/// of phyxels. @param spacing result of `mean_spacing`, or of `graded_spacing` for a graded cloud
/// @throws InputError for a position or spacing that is not finite, or another number of spacings
Neighbourhood find_neighbours(std::span<const Vec3d> position, std::span<const double> spacing,
                              const NeighbourhoodRule& rule);

/// For each point, the phyxels i with |x_i - point| < support[i]. A point outside all supports gets
/// the nearest phyxel. @param unreached receives the number of such points; may be null
/// @throws InputError for values that are not finite, or another number of supports than positions
Csr phyxels_near(std::span<const Vec3d> point, std::span<const Vec3d> position,
                 std::span<const double> support, Index* unreached = nullptr);

}  // namespace phyxel
