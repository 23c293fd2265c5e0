#include "mesh/graded_filling.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "mesh/graded_volumes.hpp"
#include "mesh/repulsion.hpp"
#include "mesh/small_volumes.hpp"
#include "mesh/surface_points.hpp"
#include "model/graded_hash.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// Levels of an octave, each with a lattice and a size of samples of its own.
constexpr int levels_of_octave = 3;

/// Ranges of spacings, from fine to coarse.
class Levels {
 public:
  explicit Levels(const SpacingField& spacing)
      : spacing_(spacing),
        count_(1 +
               static_cast<int>(levels_of_octave *
                                std::log2(spacing.coarsest() / spacing.finest()) * (1 + 1e-9))) {}
  int count() const { return count_; }
  /// The smallest spacing of a level [m].
  double smallest(int level) const {
    return spacing_.finest() * std::exp2(static_cast<double>(level) / levels_of_octave);
  }
  int level_of(double spacing) const {
    const double octaves = std::log2(spacing / spacing_.finest());
    return std::clamp(static_cast<int>(std::floor(levels_of_octave * octaves)), 0, count_ - 1);
  }
  /// False if no place of a ball has a spacing of the level.
  bool may_reach(int level, Vec3d middle, double radius) const {
    // Outside the body the field may grow faster, in two directions at once.
    const double here = spacing_.at(middle),
                 change = std::numbers::sqrt2 * spacing_.growth() * radius;
    return level_of(std::max(here - change, spacing_.finest())) <= level &&
           level_of(here + change) >= level;
  }

 private:
  const SpacingField& spacing_;
  int count_;
};

/// Tests places for their distance from the surface, from cuts and from the phyxels on them.
class Clear {
 public:
  Clear(const LatticeRequest& request, const SpacingField& spacing) {
    std::vector<Vec3d> place = all_sites(request.sites);
    sites_ = place.size();
    for (const PointOn& p :
         points_over(request.surface, spacing, surface_samples, request.seed + 1)) {
      place.push_back(p.point);
    }
    place.insert(place.end(), request.sites.cut_points.begin(), request.sites.cut_points.end());
    std::vector<double> size = spacing.at(place);
    for (double& s : size) s *= 0.5;
    hash_.emplace(place, size);
  }

  /// The clearance of a place, in spacings; 1 for all that is farther.
  /// @param spacing the one wanted at the place [m]
  double at(Vec3d place, double spacing) const {
    double clearance = spacing;
    hash_->visit_ball(
        place, [&](double) { return spacing; },
        [&](const GradedHash::Entry& e) {
          const double factor = static_cast<std::size_t>(e.index) < sites_ ? 1 : sample_factor;
          clearance = std::min(clearance, factor * norm(e.position - place));
        });
    return clearance / spacing;
  }

 private:
  std::size_t sites_ = 0;
  std::optional<GradedHash> hash_;
};

struct Node {
  Vec3d position;
  float clearance;  ///< In spacings.
  float weight;     ///< Phyxels for this node: less than one where the lattice is too fine.
};

/// All nodes inside, level by level and task by task.
std::vector<Node> nodes_inside(const LatticeRequest& request, const SpacingField& spacing) {
  const Levels levels(spacing);
  const Clear clear(request, spacing);
  std::vector<Node> all;
  for (int level = 0; level < levels.count(); ++level) {
    // A little finer, since at most one phyxel is made of a node.
    const double constant = 0.97 * levels.smallest(level);
    std::vector<std::vector<Node>> by_task(InsideSampler::most_tasks);
    const auto wanted = [&](Vec3d middle, double half) {
      return levels.may_reach(level, middle, std::numbers::sqrt3 * half);
    };
    request.sampler.visit(
        {.voxel = constant,
         .seed = request.seed + static_cast<std::uint64_t>(level),
         .at_random = false,
         .turn = turn_of_lattice(),
         .wanted = wanted},
        [&](std::size_t task, const SampleBlock& block) {
          for (std::size_t k = 0; k < block.offset.size(); ++k) {
            const Vec3d p = block.position(k);
            const double s = spacing.at(p);
            if (levels.level_of(s) != level) continue;
            const double clearance = clear.at(p, s);
            if (clearance < least_clearance) continue;
            by_task[task].push_back(
                {p, static_cast<float>(clearance), static_cast<float>(std::pow(constant / s, 3))});
          }
        });
    for (std::vector<Node>& nodes : by_task) {
      all.insert(all.end(), nodes.begin(), nodes.end());
      nodes = {};
    }
  }
  return all;
}

double weight_of(const std::vector<Node>& nodes, double clearance) {
  double sum = 0;
  for (const Node& node : nodes) sum += node.clearance >= clearance ? node.weight : 0;
  return sum;
}

/// Leaves nodes out such that each run of nodes keeps about the sum of its weights, and n are kept.
std::vector<Vec3d> thinned_out(const std::vector<Node>& nodes, double clearance, std::size_t n) {
  const double phyxels_for_weight = static_cast<double>(n) / weight_of(nodes, clearance);
  std::size_t candidates = 0;
  for (const Node& node : nodes) candidates += node.clearance >= clearance;
  std::vector<Vec3d> kept;
  double owed = 0.5;
  for (const Node& node : nodes) {
    if (node.clearance < clearance) continue;
    owed += node.weight * phyxels_for_weight;
    // The last nodes are all kept if they are needed.
    const bool needed = n - kept.size() >= candidates--;
    if (kept.size() < n && (owed >= 1 || needed)) {
      kept.push_back(node.position);
      owed -= 1;
    }
  }
  return kept;
}

/// The phyxels on the surface and on cuts, and those inside.
class GradedSkin {
 public:
  GradedSkin(const LatticeRequest& request, const SpacingField& spacing,
             const std::vector<Vec3d>& inside)
      : request_(request), spacing_(spacing), point_(all_sites(request.sites)) {
    first_inside_ = point_.size();
    point_.insert(point_.end(), inside.begin(), inside.end());
    ball_.resize(point_.size());
    repulsion_.emplace(point_, first_inside_, spacing_);
  }

  /// Moves each phyxel inside by the sum of the forces at the places before the sweep.
  void sweep() {
    std::vector<Vec3d> moved = point_;
    repulsion_->for_each([&](std::size_t k, auto&& step_of) {
      moved[k] = repelled_inside(request_, point_[k], ball_[k], step_of);
    });
    repulsion_->move_to(moved);
    point_.swap(moved);
  }

  Bulk<Vec3d> inside() const {
    return {point_.begin() + static_cast<std::ptrdiff_t>(first_inside_), point_.end()};
  }

  /// Shares of the inside by sample points [m³].
  std::vector<double> volumes(Stage& stage) const {
    std::vector<double> volume = graded_volumes(request_.sampler, point_, request_.sites.cuts,
                                                spacing_, request_.seed + 2, stage);
    raise_small_volumes(point_, request_.sites.cuts, request_.sites.spacing, volume);
    if (!request_.exact_volume) return volume;
    double sum = 0;
    for (const double v : volume) sum += v;
    for (double& v : volume) v *= request_.volume / sum;
    return volume;
  }

 private:
  const LatticeRequest& request_;
  const SpacingField& spacing_;
  std::vector<Vec3d> point_;
  std::vector<ClearBall> ball_;  ///< Ball of each point (`repelled_inside`).
  std::size_t first_inside_ = 0;
  std::optional<GradedRepulsion> repulsion_;
};

}  // namespace

LatticeFilling fill_graded(const LatticeRequest& request, SpacingField& spacing) {
  Stage placing("placing phyxels");
  const auto n = static_cast<std::size_t>(request.phyxels);
  spacing = request.sites.spacing;
  std::vector<Node> nodes;
  double clearance = usual_clearance;
  constexpr int most_attempts = 12;
  for (int attempt = 0;; ++attempt) {
    nodes = nodes_inside(request, spacing);
    const double ratio = weight_of(nodes, usual_clearance) / static_cast<double>(n);
    const auto enough =
        static_cast<std::size_t>(std::count_if(nodes.begin(), nodes.end(), [](const Node& node) {
          return node.clearance >= usual_clearance;
        }));
    if (enough >= n && std::abs(ratio - 1) < 0.02) break;
    if (attempt >= most_attempts && nodes.size() >= n) {
      clearance = enough >= n ? usual_clearance : least_clearance;
      break;
    }
    // Where a thin body has no room for more, finer distances make it.
    const double finer = ratio > 0 ? std::clamp(std::cbrt(ratio), 0.8, 1.25) : 0.8;
    spacing = spacing.with_coarsest(finer * (enough < n ? 0.99 : 1) * spacing.coarsest());
  }
  std::vector<Vec3d> inside = thinned_out(nodes, clearance, n);
  nodes = {};
  placing.finish();

  Stage relaxing("evening out distances");
  GradedSkin skin(request, spacing, inside);
  // Twice as many sweeps as beside a lattice: thinned out lattices are farther from even.
  const int sweeps = 2 * request.sweeps;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    skin.sweep();
    relaxing.reach((sweep + 1.0) / sweeps);
  }
  relaxing.finish();

  LatticeFilling filling;
  filling.spacing = spacing.finest();
  Stage measuring("volumes of phyxels");
  filling.volume = skin.volumes(measuring);
  measuring.finish();
  filling.position = skin.inside();
  return filling;
}

}  // namespace phyxel
