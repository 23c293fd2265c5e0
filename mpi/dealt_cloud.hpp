/// Clouds that one rank makes for all.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "model/cloud_piece.hpp"
#include "mpi/communicator.hpp"

namespace phyxel {

/// A cloud that one rank has made, of which every rank gets pieces. Functions are collective.
class DealtCloud {
 public:
  /// Gives all ranks the surface and the names of the cloud.
  /// @param cloud read on rank `maker`, which keeps its phyxels
  DealtCloud(const MpiCommunicator& ranks, Cloud cloud, int maker);

  /// Returns this rank's piece of the cloud, with the whole surface; warnings come with the first.
  /// @param number number(rank): the piece of a rank
  CloudPiece piece(const std::function<int(int rank)>& number);

 private:
  template <class T>
  std::vector<T> dealt(const std::vector<T>& values, const std::function<int(int)>& number) const;
  std::vector<Index> dealt_members(const std::function<int(int)>& number) const;

  const MpiCommunicator& ranks_;
  int maker_;
  Cloud phyxels_;  ///< On the maker: positions, volumes, spacings and members of regions.
  Cloud common_;   ///< The surface, cuts and warnings, which have no values for each phyxel.
  std::vector<std::string> regions_;  ///< Names of the regions.
  Index size_ = 0;                    ///< Number of phyxels.
};

}  // namespace phyxel
