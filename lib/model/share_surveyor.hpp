/// What a device finds out for ranks that build a model together (`build_share`), so that no lists
/// are made on the host.
#pragma once

#include <span>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// What is known of the neighbourhoods of own phyxels, one body's, among points around them.
struct Around {
  std::vector<char> needed;        ///< Whether a point is in an own list, or has an own one in its.
  std::vector<Index> length;       ///< Of own lists; 0 for others.
  std::vector<double> kernel_sum;  ///< Of own ones, where spacings were given (see `Survey`).
  Degenerate degenerate;           ///< Own ones.
};

/// What lists tell: who is needed, and the lengths.
/// @param begin the first point of the body in the neighbourhood. @param own of the body's points
Around around_by_lists(const Neighbourhood& hood, Index begin, std::span<const char> own);

class ShareSurveyor {
 public:
  virtual ~ShareSurveyor() = default;

  /// As the function of that name in neighbour_search.hpp.
  virtual std::vector<double> mean_spacing(std::span<const Vec3d> position, int nearest,
                                           double* farthest) const = 0;

  /// @param position of one body's points, in the order of their numbers
  /// @param spacing empty: no kernel sums are wanted
  /// @param own whether each point is
  /// @param one_sided whether a point may have another in its list that has not it
  virtual Around around(std::span<const Vec3d> position, std::span<const double> support,
                        std::span<const double> spacing, std::span<const char> own,
                        bool one_sided) const = 0;
};

}  // namespace phyxel
