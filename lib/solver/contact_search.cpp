#include "solver/contact_search.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "model/lists_from_pairs.hpp"
#include "model/spatial_hash.hpp"
#include "rank_exchange.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// The phyxels near a point, of bodies that it may touch.
class Neighbours {
 public:
  Neighbours(const BodyContact& contact, std::span<const ContactCandidate> points,
             std::span<const double> skins)
      : contact_(contact),
        points_(points),
        skins_(skins),
        range_(largest_range(points)),
        position_(tabulated(points.size(), [&](std::size_t k) { return points[k].now; })),
        hash_(position_, range_ + *std::ranges::min_element(skins)) {}

  /// The numbers of the phyxels near a point, by bodies, then by their part of a list, ascending.
  std::vector<Index> of(std::size_t p) const {
    const ContactCandidate& point = points_[p];
    std::vector<Index> found;
    const double reach = range_ + skins_[static_cast<std::size_t>(point.body)];
    hash_.visit_ball(point.now, reach, [&](const SpatialHash::Entry& entry) {
      const ContactCandidate& other = points_[static_cast<std::size_t>(entry.index)];
      if (!is_near(point, other, skins_.data())) return;
      if (contact_.law_of(point.body, other.body)) found.push_back(entry.index);
    });
    std::sort(found.begin(), found.end(), [&](Index a, Index b) {
      return std::tuple(points_[a].body, part_of_list(points_[a]), a) <
             std::tuple(points_[b].body, part_of_list(points_[b]), b);
    });
    return found;
  }

 private:
  static double largest_range(std::span<const ContactCandidate> points) {
    double range = 0;
    for (const ContactCandidate& point : points) range = std::max(range, point.site.range);
    return range;
  }

  const BodyContact& contact_;
  std::span<const ContactCandidate> points_;
  std::span<const double> skins_;
  double range_;  ///< The largest one [m].
  std::vector<Vec3d> position_;
  SpatialHash hash_;
};

/// The phyxels of one body near a point, as lists have them.
struct Beside {
  std::span<const Index> near;  ///< Their numbers.
  Index patches = 1;            ///< The rows that the point has there.
};

/// The phyxels near a point, body by body. @param near as of `Neighbours`
std::vector<Beside> by_bodies(std::span<const ContactCandidate> points, std::size_t p,
                              std::span<const Index> near) {
  std::vector<Beside> all;
  while (!near.empty()) {
    const auto end = std::find_if(near.begin(), near.end(), [&](Index k) {
      return points[k].body != points[near.front()].body;
    });
    const auto count = static_cast<std::size_t>(end - near.begin());
    Beside beside{near.first(count)};
    const auto site_of = [&](std::size_t k) -> const SurfaceSite& {
      return points[beside.near[k]].site;
    };
    for (std::size_t k = 0; k < count && beside.patches == 1; ++k) {
      if (is_far_from_others(points[p].site.range, site_of(k), count, site_of)) {
        beside.patches = most_patches;
      }
    }
    all.push_back(beside);
    near = near.subspan(count);
  }
  return all;
}

}  // namespace

bool ContactRows::have_patches() const {
  return std::any_of(rows.begin(), rows.end(), [](const ContactRow& r) { return r.patches > 1; });
}

Csr grouped(std::size_t lists, std::span<const std::pair<Index, Index>> entries) {
  Csr csr;
  group(lists, entries, csr.offsets, csr.indices);
  return csr;
}

std::vector<ContactCandidate> of_all_ranks(const Model& model, std::vector<ContactCandidate> some) {
  if (!model.share) return some;
  const Communicator& ranks = *model.share->communicator;
  std::vector<ContactCandidate> all;
  for (const auto& of_rank : allgathered(ranks, some)) {
    all.insert(all.end(), of_rank.begin(), of_rank.end());
  }
  std::sort(all.begin(), all.end(),
            [](const ContactCandidate& a, const ContactCandidate& b) { return a.id < b.id; });
  return all;
}

ContactRows find_rows(const BodyContact& contact, std::span<const ContactCandidate> points,
                      std::span<const double> skins) {
  ContactRows found;
  std::vector<std::pair<Index, Index>> entries;
  if (points.empty()) return found;
  const Neighbours neighbours(contact, points, skins);
  const std::vector<std::vector<Index>> near =
      tabulated(points.size(), [&](std::size_t p) { return neighbours.of(p); });
  const std::vector<std::vector<Beside>> beside =
      tabulated(points.size(), [&](std::size_t p) { return by_bodies(points, p, near[p]); });
  for (std::size_t p = 0; p < points.size(); ++p) {
    for (const Beside& one : beside[p]) {
      const Index body = points[one.near.front()].body;
      for (Index patch = 0; patch < one.patches; ++patch) {
        const auto row = static_cast<Index>(found.rows.size());
        found.rows.push_back(row_of(points[p], static_cast<Index>(p), body, patch, one.patches,
                                    *contact.law_of(points[p].body, body)));
        for (const Index k : one.near) {
          entries.emplace_back(contact_threads * row + part_of_list(points[k]), k);
        }
      }
    }
  }
  found.near = grouped(contact_threads * found.rows.size(), entries);
  return found;
}

}  // namespace phyxel
