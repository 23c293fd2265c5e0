/// Neighbour search by devices for ranks that build a model together (`build_share`), so that no
/// lists are made on the host.
#pragma once

#include <span>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// A summary of the neighbourhoods of own phyxels of one body among the points around them.
struct Around {
  /// For each point, whether it neighbours an own phyxel, in either direction.
  std::vector<char> needed;
  std::vector<Index> length;       ///< Length of each own list; 0 for other points.
  std::vector<double> kernel_sum;  ///< Kernel sums of own phyxels (`Survey`), if asked for.
  Degenerate degenerate;           ///< Degenerate own phyxels.
};

/// Makes the summary from lists.
/// @param begin first point of the body in the neighbourhood. @param own for each point of the
/// body, whether this rank owns it
Around around_by_lists(const Neighbourhood& hood, Index begin, std::span<const char> own);

/// A neighbour search on a device.
class ShareSurveyor {
 public:
  virtual ~ShareSurveyor() = default;

  /// Returns the mean distance to the nearest points, as the function of neighbour_search.hpp does.
  virtual std::vector<double> mean_spacing(std::span<const Vec3d> position, int nearest,
                                           double* farthest) const = 0;

  /// Searches the neighbours of own points of one body.
  /// @param position of the body's points, in the order of their numbers
  /// @param spacing of each point; empty if no kernel sums are wanted
  /// @param own for each point, whether this rank owns it
  /// @param one_sided true if a point may list another that does not list it
  virtual Around around(std::span<const Vec3d> position, std::span<const double> support,
                        std::span<const double> spacing, std::span<const char> own,
                        bool one_sided) const = 0;
};

}  // namespace phyxel
