/// Phyxels of all bodies spread over ranks, each on one of them, while a model is built that no
/// rank has whole. Every function that takes the ranks is collective.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "bulk.hpp"
#include "model/box.hpp"
#include "mpi/communicator.hpp"

namespace phyxel {

/// What is known of a phyxel so far, as ranks send it to each other.
struct MigratingPhyxel {
  Vec3d position;      ///< [m]
  double volume = 0;   ///< [m³], where the cloud tells.
  double spacing = 0;  ///< r̄ [m], where it is wanted.
  double support = 0;  ///< h [m]
  Index body = 0;
  Index number = 0;           ///< In its body.
  Index along = 0;            ///< Where it stands in its body along Hilbert's curve.
  std::uint32_t regions = 0;  ///< A bit for each region that the scene names.
};
using MigratingPhyxels = Bulk<MigratingPhyxel>;

/// The box of each body.
std::vector<Box> boxes_of(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                          std::size_t bodies);

/// Brings phyxels into the order of their bodies, and within each of Hilbert's curve over its box,
/// that of `curve_order`; each rank gets a stretch of it, of whole groups and about equally many.
/// Sets `along`.
/// @param sizes of the bodies. @param group phyxels that stay together, counted from the start of
///   each body
MigratingPhyxels migrate_along_curve(const MpiCommunicator& ranks, MigratingPhyxels own,
                                     const std::vector<Index>& sizes, const std::vector<Box>& boxes,
                                     Index group);

/// Phyxels go to their owners, and are there in the order of bodies and numbers. @param owner of
///   each
MigratingPhyxels migrate_to_owners(const MpiCommunicator& ranks, MigratingPhyxels own,
                                   Bulk<int> owner);

/// First and last of each body that is there, which follow each other.
std::vector<std::pair<std::size_t, std::size_t>> ranges_of_bodies(const MigratingPhyxels& phyxels);

/// Other ranks' phyxels, in the order of bodies and numbers, and whose each is.
struct RemotePhyxels {
  MigratingPhyxels phyxels;
  Bulk<int> owner;
};
/// @param reach of each body [m]: all phyxels nearer than that to an own one are there, and others
RemotePhyxels remote_phyxels_around(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                                    const std::vector<double>& reach,
                                    const std::vector<Box>& boxes);

/// Own phyxels and those of other ranks around them, in the order of bodies and numbers.
struct Surrounded {
  MigratingPhyxels phyxels;
  std::vector<int> owner;  ///< Rank of each.
};
/// @param own in that order, too
Surrounded surrounded(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                      const RemotePhyxels& others);

/// The value in the middle of each list, as `median_of`; 0 for none. @param values [list], none
///   below 0
std::vector<double> medians_of(const MpiCommunicator& ranks, std::span<const Bulk<double>> values);

/// The largest of each over the ranks.
std::vector<double> largest_of(const MpiCommunicator& ranks, const std::vector<double>& values);

}  // namespace phyxel
