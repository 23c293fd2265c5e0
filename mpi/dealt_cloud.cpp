#include "mpi/dealt_cloud.hpp"

#include <map>
#include <utility>

namespace phyxel {
namespace {

/// The texts of rank `from`, on each rank.
std::vector<std::string> broadcast_texts(const MpiCommunicator& ranks,
                                         const std::vector<std::string>& texts, int from) {
  std::vector<std::size_t> sizes;
  std::vector<char> all;
  for (const std::string& text : texts) {
    sizes.push_back(text.size());
    all.insert(all.end(), text.begin(), text.end());
  }
  sizes = ranks.broadcast(std::move(sizes), from);
  all = ranks.broadcast(std::move(all), from);
  std::vector<std::string> received;
  auto at = all.begin();
  for (const std::size_t size : sizes) {
    const auto end = at + static_cast<std::ptrdiff_t>(size);
    received.emplace_back(at, end);
    at = end;
  }
  return received;
}

/// The names of regions or groups, in their order.
std::vector<std::string> names_of(const std::map<std::string, std::vector<Index>>& lists) {
  std::vector<std::string> names;
  for (const auto& [name, members] : lists) names.push_back(name);
  return names;
}

/// The surface of rank `from`, on each rank.
Surface broadcast_surface(const MpiCommunicator& ranks, Surface surface, int from) {
  Surface received;
  received.position = ranks.broadcast(std::move(surface.position), from);
  received.normal = ranks.broadcast(std::move(surface.normal), from);
  received.triangle = ranks.broadcast(std::move(surface.triangle), from);
  for (const std::string& name : broadcast_texts(ranks, names_of(surface.groups), from)) {
    received.groups[name] = ranks.broadcast(std::move(surface.groups[name]), from);
  }
  return received;
}

}  // namespace

DealtCloud::DealtCloud(const MpiCommunicator& ranks, Cloud cloud, int maker)
    : ranks_(ranks), maker_(maker) {
  common_.surface = broadcast_surface(ranks, std::move(cloud.surface), maker);
  common_.warnings = broadcast_texts(ranks, cloud.warnings, maker);
  common_.cuts.list = ranks.broadcast(std::move(cloud.cuts.list), maker);
  common_.cuts.moved = ranks.broadcast(std::move(cloud.cuts.moved), maker);
  const SupportCuts& cuts = cloud.cuts;
  const std::vector<double> lengths =
      ranks.broadcast(std::vector{cuts.depth, cuts.spacing, cuts.shift}, maker);
  common_.cuts.depth = lengths[0];
  common_.cuts.spacing = lengths[1];
  common_.cuts.shift = lengths[2];
  const std::vector<Index> numbers = ranks.broadcast(
      std::vector{static_cast<Index>(cloud.position.size()), Index{cloud.lattice}}, maker);
  size_ = numbers[0];
  common_.lattice = numbers[1] != 0;
  regions_ = broadcast_texts(ranks, names_of(cloud.regions), maker);
  phyxels_.position = std::move(cloud.position);
  phyxels_.volume = std::move(cloud.volume);
  phyxels_.spacing = std::move(cloud.spacing);
  phyxels_.regions = std::move(cloud.regions);
}

/// Deals out the values of phyxels, if the cloud has such values.
template <class T>
std::vector<T> DealtCloud::dealt(const std::vector<T>& values,
                                 const std::function<int(int)>& number) const {
  std::vector<std::vector<T>> send(static_cast<std::size_t>(ranks_.size()));
  if (!values.empty()) {
    for (int r = 0; r < ranks_.size(); ++r) {
      const auto [first, last] = range_of({number(r), ranks_.size()}, size_);
      send[static_cast<std::size_t>(r)] = {values.begin() + first, values.begin() + last};
    }
  }
  return std::move(ranks_.alltoallv(send)[static_cast<std::size_t>(maker_)]);
}

/// Deals out the members of regions, region by region: their number, and their indices in the
/// piece.
std::vector<Index> DealtCloud::dealt_members(const std::function<int(int)>& number) const {
  std::vector<std::vector<Index>> send(static_cast<std::size_t>(ranks_.size()));
  if (ranks_.rank() == maker_) {
    for (int r = 0; r < ranks_.size(); ++r) {
      const auto [first, last] = range_of({number(r), ranks_.size()}, size_);
      for (const auto& [name, members] : phyxels_.regions) {
        const std::vector<Index> here = members_within(members, first, last);
        std::vector<Index>& to = send[static_cast<std::size_t>(r)];
        to.push_back(static_cast<Index>(here.size()));
        to.insert(to.end(), here.begin(), here.end());
      }
    }
  }
  return std::move(ranks_.alltoallv(send)[static_cast<std::size_t>(maker_)]);
}

CloudPiece DealtCloud::piece(const std::function<int(int)>& number) {
  const Piece own{number(ranks_.rank()), ranks_.size()};
  CloudPiece made{common_, static_cast<Index>(range_of(own, size_).first), size_};
  common_.warnings.clear();
  made.cloud.position = dealt(phyxels_.position, number);
  made.cloud.volume = dealt(phyxels_.volume, number);
  made.cloud.spacing = dealt(phyxels_.spacing, number);
  const std::vector<Index> members = dealt_members(number);
  auto at = members.begin();
  for (const std::string& name : regions_) {
    const auto end = at + 1 + *at;
    made.cloud.regions[name] = {at + 1, end};
    at = end;
  }
  return made;
}

}  // namespace phyxel
