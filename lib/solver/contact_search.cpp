#include "solver/contact_search.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>

#include "model/body_contact.hpp"
#include "model/box_overlaps.hpp"
#include "model/contact_groups.hpp"
#include "model/parts.hpp"
#include "model/spatial_hash.hpp"
#include "rank_exchange.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

Box together(const Box& a, const Box& b) {
  return {
      {std::min(a.low.x, b.low.x), std::min(a.low.y, b.low.y), std::min(a.low.z, b.low.z)},
      {std::max(a.high.x, b.high.x), std::max(a.high.y, b.high.y), std::max(a.high.z, b.high.z)}};
}

/// Parts of one body that are nearer to each other at rest, in ranges, do not touch.
constexpr double ranges_apart = 2;

/// The part of a list that a phyxel is in.
int part_of_list(const ContactCandidate& point) { return point.id % contact_threads; }

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
      const double range = common_range(point.site.range, other.site.range);
      if (norm(other.now - point.now) > range + skin_) return;
      if (!contact_.law_of(point.body, other.body)) return;
      const bool are_apart = point.body != other.body ||
                             norm(other.site.rest - point.site.rest) > ranges_apart * range;
      if (are_apart) found.push_back(entry.index);
    });
    std::sort(found.begin(), found.end(), [&](Index a, Index b) {
      return std::tuple(points_[a].body, part_of_list(points_[a]), a) <
             std::tuple(points_[b].body, part_of_list(points_[b]), b);
    });
    return found;
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

std::vector<Box> boxes_of_bodies(const Model& model, std::span<const Vec3d> position,
                                 std::span<const SurfaceSite> sites, double skin) {
  const BodyContact& contact = model.body_contact;
  std::vector<Box> boxes(contact.distances.size(), no_box);
  for (std::size_t k = 0; k < position.size(); ++k) {
    Box& box = boxes[part_of(model, contact.layer.phyxels[k]).body];
    box = together(box, grown({position[k], position[k]}, sites[k].range + 0.5 * skin));
  }
  if (!model.share) return boxes;
  const Communicator& ranks = *model.share->communicator;
  const std::vector<std::vector<Box>> all =
      exchanged(ranks, std::vector(static_cast<std::size_t>(ranks.size()), boxes));
  for (const std::vector<Box>& some : all) {
    for (std::size_t b = 0; b < boxes.size(); ++b) boxes[b] = together(boxes[b], some[b]);
  }
  return boxes;
}

ContactRows find_rows(const BodyContact& contact, std::span<const ContactCandidate> points,
                      double skin) {
  ContactRows found;
  std::vector<std::pair<Index, Index>> entries;
  if (points.empty()) return found;
  const Neighbours neighbours(contact, points, skin);
  const std::vector<std::vector<Index>> near =
      tabulated(points.size(), [&](std::size_t p) { return neighbours.of(p); });
  for (std::size_t p = 0; p < points.size(); ++p) {
    for (const Index k : near[p]) {
      // Points far apart would press on a fine surface like nails; it has points of its own.
      constexpr double coarser = 1.5;
      if (points[p].site.range > coarser * points[k].site.range) continue;
      const Index body = points[k].body;
      const bool is_new = found.rows.empty() || found.rows.back().point != static_cast<Index>(p) ||
                          found.rows.back().body != body;
      if (is_new) {
        const bool is_own = body == points[p].body;
        found.rows.push_back({static_cast<Index>(p), body, *contact.law_of(points[p].body, body),
                              is_own ? ranges_apart * points[p].site.range : 0});
      }
      entries.emplace_back(
          contact_threads * static_cast<Index>(found.rows.size() - 1) + part_of_list(points[k]), k);
    }
  }
  found.near = grouped(contact_threads * found.rows.size(), entries);
  return found;
}

}  // namespace phyxel
