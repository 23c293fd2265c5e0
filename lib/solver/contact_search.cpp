#include "solver/contact_search.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>

#include "model/spatial_hash.hpp"
#include "rank_exchange.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// A phyxel near a point, and the patch of its body's surface that it is in.
struct InPatch {
  Index phyxel = 0, patch = 0;
};

/// The phyxels near a point, of bodies that it may touch.
class Neighbours {
 public:
  Neighbours(const BodyContact& contact, std::span<const ContactCandidate> points, double skin)
      : contact_(contact),
        points_(points),
        skin_(skin),
        position_(tabulated(points.size(), [&](std::size_t k) { return points[k].now; })),
        hash_(position_, reach(points, skin)),
        reach_(reach(points, skin)) {}

  /// The numbers of the phyxels near a point, by bodies, then by their part of a list, ascending.
  std::vector<Index> of(std::size_t p) const {
    const ContactCandidate& point = points_[p];
    std::vector<Index> found;
    hash_.visit_ball(point.now, reach_, [&](const SpatialHash::Entry& entry) {
      const ContactCandidate& other = points_[static_cast<std::size_t>(entry.index)];
      if (!is_near(point, other, skin_)) return;
      if (contact_.law_of(point.body, other.body)) found.push_back(entry.index);
    });
    std::sort(found.begin(), found.end(), [&](Index a, Index b) {
      return std::tuple(points_[a].body, part_of_list(points_[a]), a) <
             std::tuple(points_[b].body, part_of_list(points_[b]), b);
    });
    return found;
  }

  /// The same by bodies, then by patches, then as `of`.
  std::vector<InPatch> in_patches(std::size_t p) const {
    std::vector<InPatch> all;
    for (const Index k : of(p)) all.push_back({k, 0});
    for (auto begin = all.begin(); begin != all.end();) {
      const auto body = points_[begin->phyxel].body;
      const auto end = std::find_if(
          begin, all.end(), [&](const InPatch& k) { return points_[k.phyxel].body != body; });
      find_patches(
          static_cast<Index>(end - begin),
          [&](Index k) -> const SurfaceSite& { return points_[begin[k].phyxel].site; },
          [&](Index k) -> Index& { return begin[k].patch; });
      std::stable_sort(begin, end,
                       [](const InPatch& a, const InPatch& b) { return a.patch < b.patch; });
      begin = end;
    }
    return all;
  }

 private:
  static double reach(std::span<const ContactCandidate> points, double skin) {
    double range = 0;
    for (const ContactCandidate& point : points) range = std::max(range, point.site.range);
    return range + skin;
  }

  const BodyContact& contact_;
  std::span<const ContactCandidate> points_;
  double skin_;
  std::vector<Vec3d> position_;
  SpatialHash hash_;
  double reach_;
};

}  // namespace

Csr grouped(std::size_t lists, std::span<const std::pair<Index, Index>> entries) {
  Csr csr;
  csr.offsets.assign(lists + 1, 0);
  for (const auto& [list, value] : entries) ++csr.offsets[static_cast<std::size_t>(list) + 1];
  for (std::size_t k = 0; k < lists; ++k) csr.offsets[k + 1] += csr.offsets[k];
  csr.indices.resize(entries.size());
  std::vector<Offset> next(csr.offsets.begin(), csr.offsets.end() - 1);
  for (const auto& [list, value] : entries) csr.indices[next[list]++] = value;
  return csr;
}

std::vector<ContactCandidate> of_all_ranks(const Model& model, std::vector<ContactCandidate> some) {
  if (!model.share) return some;
  const Communicator& ranks = *model.share->communicator;
  std::vector<ContactCandidate> all;
  for (const auto& of_rank :
       exchanged(ranks, std::vector(static_cast<std::size_t>(ranks.size()), some))) {
    all.insert(all.end(), of_rank.begin(), of_rank.end());
  }
  std::sort(all.begin(), all.end(),
            [](const ContactCandidate& a, const ContactCandidate& b) { return a.id < b.id; });
  return all;
}

ContactRows find_rows(const BodyContact& contact, std::span<const ContactCandidate> points,
                      double skin) {
  ContactRows found;
  std::vector<std::pair<Index, Index>> entries;
  if (points.empty()) return found;
  const Neighbours neighbours(contact, points, skin);
  const std::vector<std::vector<InPatch>> near =
      tabulated(points.size(), [&](std::size_t p) { return neighbours.in_patches(p); });
  for (std::size_t p = 0; p < points.size(); ++p) {
    for (const auto& [k, patch] : near[p]) {
      const Index body = points[k].body;
      const bool is_new = found.rows.empty() || found.rows.back().point != static_cast<Index>(p) ||
                          found.rows.back().body != body || found.rows.back().patch != patch;
      if (is_new) {
        found.rows.push_back(row_of(points[p], static_cast<Index>(p), body, patch,
                                    *contact.law_of(points[p].body, body)));
      }
      entries.emplace_back(
          contact_threads * static_cast<Index>(found.rows.size() - 1) + part_of_list(points[k]), k);
    }
  }
  found.near = grouped(contact_threads * found.rows.size(), entries);
  return found;
}

}  // namespace phyxel
