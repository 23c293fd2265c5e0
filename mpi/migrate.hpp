/// Migration of phyxels between ranks, while a model is built that no single rank holds. Each
/// phyxel is on one rank. Functions with the parameter `ranks` are collective.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "bulk.hpp"
#include "model/box.hpp"
#include "mpi/communicator.hpp"

namespace phyxel {

/// Data of a phyxel during the build, as ranks send it to each other.
struct MigratingPhyxel {
  Vec3d position;      ///< [m]
  double volume = 0;   ///< [m³], if the cloud has volumes.
  double spacing = 0;  ///< r̄ [m], if needed.
  double support = 0;  ///< h [m]; until it is found, the cloud's own spacing (`Cloud::spacing`).
  Index body = 0;
  Index number = 0;              ///< Index in its body.
  Index along = 0;               ///< Index in its part along Hilbert's curve.
  std::uint32_t region_set = 0;  ///< Number of its set in `RegionSets`.
};
using MigratingPhyxels = Bulk<MigratingPhyxel>;

/// The number of the body of a phyxel, or of its part.
using WhichOf = std::function<std::size_t(const MigratingPhyxel&)>;

/// Returns the bounding boxes of `count` bodies or parts.
std::vector<Box> boxes_of(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                          std::size_t count, const WhichOf& which);

/// Sorts phyxels over all ranks by part, and within a part along Hilbert's curve over its box, as
/// `curve_order` does. Each rank gets a contiguous range of whole groups, of about equal size. Sets
/// `along`.
/// @param sizes number of phyxels of each part. @param boxes of the parts. @param group number of
/// phyxels that stay together, counted from the start of each part
MigratingPhyxels migrate_along_curve(const MpiCommunicator& ranks, MigratingPhyxels own,
                                     const WhichOf& part_of, const std::vector<Index>& sizes,
                                     const std::vector<Box>& boxes, Index group);

/// Sends phyxels to their owners, which hold them in the order of bodies and numbers. @param owner
/// rank of each phyxel
MigratingPhyxels migrate_to_owners(const MpiCommunicator& ranks, MigratingPhyxels own,
                                   Bulk<int> owner);

/// Returns the range [begin, end) of each body or part that has phyxels here; each is contiguous.
template <class Which>
std::vector<std::pair<std::size_t, std::size_t>> ranges_by(const MigratingPhyxels& phyxels,
                                                           Which&& which) {
  std::vector<std::pair<std::size_t, std::size_t>> stretches;
  for (auto first = phyxels.begin(), last = first; first != phyxels.end(); first = last) {
    last = std::partition_point(
        first, phyxels.end(), [&](const MigratingPhyxel& p) { return which(p) == which(*first); });
    stretches.emplace_back(first - phyxels.begin(), last - phyxels.begin());
  }
  return stretches;
}
inline std::vector<std::pair<std::size_t, std::size_t>> ranges_of_bodies(
    const MigratingPhyxels& phyxels) {
  return ranges_by(phyxels, [](const MigratingPhyxel& p) { return p.body; });
}

/// Phyxels of other ranks, in the order of bodies and numbers, with their owners.
struct RemotePhyxels {
  MigratingPhyxels phyxels;
  Bulk<int> owner;
};
/// Returns all phyxels of other ranks within reach of an own one, and possibly more. @param reach
/// distance for each body [m]
RemotePhyxels remote_phyxels_around(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                                    const std::vector<double>& reach,
                                    const std::vector<Box>& boxes);

/// Own phyxels and phyxels of other ranks around them, in the order of bodies and numbers.
struct Surrounded {
  MigratingPhyxels phyxels;
  std::vector<int> owner;  ///< Rank of each.
};
/// Merges own and remote phyxels. @param own own phyxels, in the order of bodies and numbers
Surrounded surrounded(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                      const RemotePhyxels& others);

/// Returns the median of each list over all ranks, as `median_of` does; 0 for an empty list. @param
/// values values of each list, none negative
std::vector<double> medians_of(const MpiCommunicator& ranks, std::span<const Bulk<double>> values);

/// Returns the element-wise largest values over the ranks.
std::vector<double> largest_of(const MpiCommunicator& ranks, const std::vector<double>& values);

}  // namespace phyxel
