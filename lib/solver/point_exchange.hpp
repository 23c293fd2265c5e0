/// The halo exchange of values of points that may touch.
#pragma once

#include <unordered_map>
#include <utility>
#include <vector>

#include "phyxel/communicator.hpp"
#include "phyxel/types.hpp"
#include "rank_exchange.hpp"

namespace phyxel {

/// Gives the points of other ranks the values that their owners have. Without ranks it does
/// nothing.
class PointExchange {
 public:
  PointExchange() = default;
  /// Plans it. Collective. @param wanted of each rank, the places in its layer of the points that
  ///   this rank has of it. @param number the numbers of these points here
  /// @param own places in the layer of this rank's points, by their numbers
  PointExchange(const Communicator& ranks, const std::vector<std::vector<Index>>& wanted,
                std::vector<std::vector<Index>> number, const std::vector<Index>& own)
      : ranks_(&ranks), receive_(std::move(number)), send_(exchanged(ranks, wanted)) {
    std::unordered_map<Index, Index> number_of;
    for (std::size_t p = 0; p < own.size(); ++p) number_of[own[p]] = static_cast<Index>(p);
    for (std::vector<Index>& places : send_) {
      for (Index& place : places) place = number_of.at(place);
    }
  }

  /// Collective. @param of_points shape [points]
  template <class T>
  void refresh(std::vector<T>& of_points) const {
    if (!ranks_) return;
    std::vector<std::vector<T>> sent(send_.size());
    for (std::size_t r = 0; r < send_.size(); ++r) {
      for (const Index p : send_[r]) sent[r].push_back(of_points[p]);
    }
    const auto received = exchanged(*ranks_, sent);
    for (std::size_t r = 0; r < receive_.size(); ++r) {
      for (std::size_t k = 0; k < receive_[r].size(); ++k) {
        of_points[receive_[r][k]] = received[r][k];
      }
    }
  }

 private:
  const Communicator* ranks_ = nullptr;
  std::vector<std::vector<Index>> receive_;  // points of other ranks, by rank
  std::vector<std::vector<Index>> send_;     // points of this rank, by rank
};

}  // namespace phyxel
