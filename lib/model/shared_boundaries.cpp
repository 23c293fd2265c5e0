/// Phyxels that several supports of a body share, and faces that have moved to layers of a lattice.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "model/assembly.hpp"
#include "model/selection.hpp"
#include "phyxel/error.hpp"
#include "shapes/lattice_cuts.hpp"
#include "sort_unique.hpp"

namespace phyxel {
namespace {

constexpr const char* axis_names[] = {"x", "y", "z"};

std::string names_of(int axes) {
  std::string names;
  for (int axis = 0; axis < 3; ++axis) {
    if (axes >> axis & 1) names += axis_names[axis];
  }
  return names;
}

/// An entry that holds or moves phyxels.
struct Support {
  std::size_t entry;           ///< Its entry, in the order of `selections_of`.
  const Selection* selection;  ///< What the scene selects.
  /// Where it acts, and where the scene has it; unset unless it is given by a region of space.
  std::optional<SpaceRegion> region, asked;
  int axes = 0;                           ///< A bit for each axis that it holds or moves.
  const MotionRequest* motion = nullptr;  ///< Null for a fixed entry.

  /// True if it leaves everything where it is.
  bool is_at_rest() const {
    return !motion || (motion->displacement == Vec3d{} && motion->rotation == Vec3d{} &&
                       motion->velocity == Vec3d{} && motion->amplitude == Vec3d{});
  }
};

/// The supports of a body, in the order of their entries.
std::vector<Support> supports_of(const BodyRequest& request, const SupportCuts& cuts) {
  const std::vector<const Selection*> selections = selections_of(request);
  const std::vector<Axes> axes = axes_of_supports(request);
  std::vector<Support> supports;
  for (std::size_t entry = 0; entry < axes.size(); ++entry) {
    const std::size_t fixed = request.fixed.size();
    supports.push_back({entry, selections[entry], acting_region(*selections[entry], cuts),
                        region_of(*selections[entry]), axes[entry].bits(),
                        entry < fixed ? nullptr : &request.motions[entry - fixed]});
  }
  return supports;
}

/// Calls visit(first, second) for each pair of supports that hold or move a common axis.
template <class Visit>
void visit_pairs_of(const std::vector<Support>& supports, Visit&& visit) {
  for (std::size_t second = 1; second < supports.size(); ++second) {
    for (std::size_t first = 0; first < second; ++first) {
      if (supports[first].axes & supports[second].axes) visit(supports[first], supports[second]);
    }
  }
}

/// The kind of a selection as a number, by which supports with the same axes share phyxels: names
/// before regions of space, and these before the whole body.
int kind_of(const Selection& selection) {
  if (selection.region) return 0;
  if (selection.indices) return 1;
  if (!selection.mesh.empty()) return 2;
  return selection.all ? 4 : 3;
}

/// True if the regions of two supports touch each other and may share phyxels on their boundaries,
/// but do not overlap.
bool may_share_face(const SpaceRegion& a, const SpaceRegion& b, const SupportCuts& cuts) {
  const auto one = ranges_along_axes(a), other = ranges_along_axes(b);
  if (!one || !other) return true;
  bool touches = false;
  for (int axis = 0; axis < 3; ++axis) {
    const double begin = std::max((*one)[axis][0], (*other)[axis][0]);
    const double end = std::min((*one)[axis][1], (*other)[axis][1]);
    constexpr double digits = 4e-12;
    const double slack = std::max(4 * cuts.depth, digits * std::abs(begin));
    if (end - begin < -slack) return false;
    touches = touches || end - begin <= slack;
  }
  return touches;
}

/// The phyxels of a cloud that two supports choose and may share: all, if both are at rest, and
/// else those that lie on the boundaries of both.
std::vector<Index> shared_by(const Support& a, const Support& b,
                             const std::vector<std::vector<Index>>& chosen, const Cloud& cloud) {
  std::vector<Index> both;
  const bool rest = a.is_at_rest() && b.is_at_rest();
  if (!rest && (!a.region || !b.region)) return both;
  if (!rest && !may_share_face(*a.region, *b.region, cloud.cuts)) return both;
  std::set_intersection(chosen[a.entry].begin(), chosen[a.entry].end(), chosen[b.entry].begin(),
                        chosen[b.entry].end(), std::back_inserter(both));
  if (rest) return both;
  const auto is_inside = [&](const SpaceRegion& region, Vec3d p) {
    return region.distance(p) < -boundary_tolerance(region, p, cloud.cuts);
  };
  std::erase_if(both, [&](Index i) {
    return is_inside(*a.region, cloud.position[i]) || is_inside(*b.region, cloud.position[i]);
  });
  return both;
}

/// True if two supports prescribe the same displacements to phyxels.
bool move_alike(const Support& a, const Support& b) {
  if (a.is_at_rest() || b.is_at_rest()) return a.is_at_rest() && b.is_at_rest();
  const MotionRequest &one = *a.motion, &other = *b.motion;
  const bool turns_alike =
      one.rotation == other.rotation && (one.about == other.about || one.rotation == Vec3d{});
  return turns_alike && one.displacement == other.displacement && one.duration == other.duration &&
         one.velocity == other.velocity && one.amplitude == other.amplitude &&
         one.frequency == other.frequency;
}

/// True if a support leaves the phyxels that it shares to another one.
bool gives_way(const Support& a, const Support& to) {
  if (a.axes != to.axes) return (a.axes & to.axes) == a.axes;
  if (!move_alike(a, to)) return false;
  const auto key = [](const Support& support) {
    return std::pair(kind_of(*support.selection), support.selection->region.value_or(""));
  };
  if (key(a) != key(to)) return key(to) < key(a);
  // Where faces of both have moved to the same places, the regions may be the same.
  for (const auto region : {&Support::region, &Support::asked}) {
    const auto &own = a.*region, &other = to.*region;
    if (!own || !other) break;
    if (comes_before(*other, *own) || comes_before(*own, *other)) return comes_before(*other, *own);
  }
  return to.entry < a.entry;
}

[[noreturn]] void refuse_shared(const BodyRequest& request, const Support& first,
                                const Support& second, Index phyxel) {
  const std::string which =
      fmt::format("{}: {} of body \"{}\" shares {} with {}", second.selection->where,
                  name_of_support(request, second.entry), request.name,
                  first.is_at_rest() && second.is_at_rest() ? "phyxels" : "a face",
                  name_of_support(request, first.entry));
  if (first.axes == second.axes) {
    throw InputError(
        fmt::format("{}, and phyxels there, such as {}, cannot follow both along \"{}\"; allowed: "
                    "the same motion, or none, in both, or regions a spacing apart",
                    which, phyxel, names_of(first.axes)));
  }
  throw InputError(fmt::format(
      "{}: axes \"{}\" and \"{}\" found, and phyxels there, such as {}, would be held twice along "
      "\"{}\"; allowed: axes of one entry that include the other's, no axis in common, or regions "
      "a spacing apart",
      which, names_of(second.axes), names_of(first.axes), phyxel,
      names_of(first.axes & second.axes)));
}

/// The distance between two boxes with parallel edges that face each other inside a body, or of a
/// ball from another region [m]; unset for others. @param box around the body
std::optional<double> gap_between(const SpaceRegion& a, const SpaceRegion& b, const Box& box) {
  if (a.is_ball) return std::max(0.0, b.distance(a.centre) - a.radius);
  if (b.is_ball) return gap_between(b, a, box);
  const auto one = ranges_along_axes(a), other = ranges_along_axes(b);
  if (!one || !other) return std::nullopt;
  std::optional<double> gap;
  const Vec3d ends[] = {box.low, box.high};
  for (int axis = 0; axis < 3; ++axis) {
    const auto& p = (*one)[axis];
    const auto& q = (*other)[axis];
    const double begin = std::max(p[0], q[0]), end = std::min(p[1], q[1]);
    const double from = component(ends[0], axis), to = component(ends[1], axis);
    if (begin > end) {
      if (gap || end < from || begin > to) return std::nullopt;
      gap = begin - end;
    } else if (begin > to || end < from) {
      return std::nullopt;
    }
  }
  return gap.value_or(0);
}

}  // namespace

std::string name_of_support(const BodyRequest& request, std::size_t entry) {
  return entry < request.fixed.size() ? entry_name("fixed", entry)
                                      : entry_name("motion", entry - request.fixed.size());
}

BoundaryChoice BoundaryChoice::empty_of(const BodyRequest& request) {
  BoundaryChoice choice;
  choice.first_load = request.fixed.size() + request.motions.size();
  choice.first_probe = choice.first_load + request.loads.size();
  return choice;
}

std::vector<Index> BoundaryChoice::selected(std::size_t entry) const {
  std::vector<Index> all = chosen[entry];
  if (entry < left.size()) all.insert(all.end(), left[entry].begin(), left[entry].end());
  sort_unique(all);
  return all;
}

void BoundaryChoice::share_boundaries(const BodyRequest& request, const SomePhyxels& here) {
  const std::vector<Support> supports = supports_of(request, here.cloud.cuts);
  const auto visit_pairs = [&](auto&& visit) { visit_pairs_of(supports, visit); };
  left.assign(supports.size(), {});
  visit_pairs([&](const Support& a, const Support& b) {
    const bool first = gives_way(a, b);
    if (!first && !gives_way(b, a)) return;
    const std::vector<Index> both = shared_by(a, b, chosen, here.cloud);
    std::vector<Index>& to = left[(first ? a : b).entry];
    to.insert(to.end(), both.begin(), both.end());
  });
  for (std::size_t entry = 0; entry < left.size(); ++entry) {
    std::vector<Index>& leaves = left[entry];
    std::sort(leaves.begin(), leaves.end());
    std::erase_if(chosen[entry],
                  [&](Index i) { return std::binary_search(leaves.begin(), leaves.end(), i); });
  }
  visit_pairs([&](const Support& a, const Support& b) {
    const std::vector<Index> both = shared_by(a, b, chosen, here.cloud);
    if (!both.empty()) {
      refuse_shared(request, a, b, here.number_of(both[0]));
    }
  });
}

void BoundaryChoice::warn_of_moved(const BodyRequest& request, const SupportCuts& cuts,
                                   std::vector<std::string>& warnings) const {
  const std::vector<const Selection*> selections = selections_of(request);
  constexpr double noticeable = 0.05;  // spacings
  for (std::size_t entry = 0; entry < first_load; ++entry) {
    const auto region = region_of(*selections[entry]);
    const auto acting = acting_region(*selections[entry], cuts);
    if (!region || *region == *acting) continue;
    const auto asked = ranges_along_axes(*region), found = ranges_along_axes(*acting);
    for (int face = 0; asked && found && face < 6; ++face) {
      const int axis = face / 2, side = face % 2;
      const bool is_layer = (*found)[axis][0] == (*found)[axis][1];  // that of a thin box
      if (is_layer && side == 1) continue;
      const double from =
          is_layer ? 0.5 * ((*asked)[axis][0] + (*asked)[axis][1]) : (*asked)[axis][side];
      const double to = (*found)[axis][side];
      if (std::abs(from - to) <= noticeable * cuts.spacing) continue;
      warnings.push_back(fmt::format(
          "body \"{0}\", {1}: box: its {6} at {2} = {3:g} m acts at {2} = {4:g} m, where the "
          "nearest layer or end of the lattice is, as a layer of its own would be too near to that "
          "for a spacing of {5:g} m; a face there, or phyxels nearer to each other, act where the "
          "box ends",
          request.name, name_of_support(request, entry), axis_names[axis], from, to, cuts.spacing,
          is_layer ? "middle" : "face"));
    }
  }
}

void BoundaryChoice::warn_of_gaps(const BodyRequest& request, const SupportCuts& cuts,
                                  const Box& box, std::vector<std::string>& warnings) const {
  visit_pairs_of(supports_of(request, cuts), [&](const Support& a, const Support& b) {
    if (!a.region || !b.region || (a.is_at_rest() && b.is_at_rest())) return;
    const std::optional<double> gap = gap_between(*a.region, *b.region, box);
    constexpr double touching = 1e-6;  // spacings
    if (!gap || *gap <= touching * cuts.spacing || *gap >= cuts.spacing) return;
    warnings.push_back(fmt::format(
        "body \"{}\": {} and {} are {:.3g} m apart, less than a spacing of {:.3g} m: the body "
        "between them has no phyxels of its own, and the force of one on the other may be several "
        "times too small; phyxels nearer to each other carry it",
        request.name, name_of_support(request, a.entry), name_of_support(request, b.entry), *gap,
        cuts.spacing));
  });
}

}  // namespace phyxel
