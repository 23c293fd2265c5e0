#include "mesh/spacing_field.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>

#include "tabulated.hpp"

namespace phyxel {
namespace {

/// A number in single precision that is no larger.
float rounded_down(double value) { return static_cast<float>(value * (1 - 1e-6)); }

/// The middle of a cube's child.
Vec3d middle_of_child(Vec3d middle, double half, int child) {
  const auto side = [&](int bit) { return child & bit ? 0.5 * half : -0.5 * half; };
  return middle + Vec3d{side(1), side(2), side(4)};
}

}  // namespace

/// A cube: either a leaf, or one with eight children, made when a place in them is first asked for.
struct SpacingCone::Cube {
  using Children = std::array<std::atomic<const Cube*>, 8>;
  /// A source that may want the smallest spacing somewhere in the cube.
  struct Offer {
    float in_middle;  ///< The spacing that it wants in the middle of the cube, rounded down [m].
    std::uint32_t source;
  };

  std::vector<Offer> offers;           ///< Those of a leaf, the smallest first.
  std::unique_ptr<Children> children;  ///< Null for a leaf.

  Cube() = default;
  Cube(const Cube&) = delete;
  Cube& operator=(const Cube&) = delete;
  ~Cube() {
    if (!children) return;
    for (const std::atomic<const Cube*>& child : *children) delete child.load();
  }
};

SourceTree::SourceTree(std::span<const SpacingSource> sources, double growth)
    : growth_(growth),
      tree_(tabulated(sources.size(), [&](std::size_t k) { return sources[k].place; })),
      sources_(tabulated(sources.size(), [&](std::size_t k) { return sources[tree_.order()[k]]; })),
      finest_(tree_.summaries([&](std::size_t k) { return sources_[k].spacing; },
                              [](double a, double b) { return std::min(a, b); })) {}

std::vector<SpacingSource> SourceTree::that_matter() const {
  const auto wants_least = tabulated(sources_.size(), [&](std::size_t k) {
    // A little less, so that no rounding error lets the source win anywhere.
    double limit = sources_[k].spacing * (1 - 1e-9);
    bool least = true;
    search(sources_[k].place, limit, [&](std::size_t other) {
      if (wanted_by(other, sources_[k].place) > limit) return;
      least = false;
      limit = -1;
    });
    return static_cast<std::uint8_t>(least);
  });
  std::vector<SpacingSource> kept;
  for (std::size_t k = 0; k < sources_.size(); ++k) {
    if (wants_least[k]) kept.push_back(sources_[k]);
  }
  return kept;
}

SpacingCone::SpacingCone(std::span<const SpacingSource> sources, double growth, double least,
                         double most, const Box& box)
    : sources_(SourceTree(sources, growth).that_matter(), growth),
      growth_(growth),
      least_(least),
      most_(most),
      middle_(0.5 * (box.low + box.high)),
      half_(0.5 * box.extent() + least) {
  root_ = made_cube(middle_, half_, 0);
}

SpacingCone::~SpacingCone() = default;

std::unique_ptr<SpacingCone::Cube> SpacingCone::made_cube(Vec3d middle, double half,
                                                          int depth) const {
  constexpr std::size_t few_sources = 8;
  constexpr int deepest = 14;
  // Smaller cubes have shorter lists, of which a place still needs only the first few.
  constexpr double small = 1.25;  // half a side, in spacings
  // A source wins over the best of the middle only if it is within that of it by what both change
  // inside the cube.
  const double change = growth_ * std::numbers::sqrt3 * half;
  const auto most = [&](double best) {
    return std::min(best + 2 * change, most_ + change) * (1 + 1e-12);
  };
  double best = most_, limit = most(best);
  auto cube = std::make_unique<Cube>();
  std::vector<Cube::Offer>& offers = cube->offers;
  sources_.search(middle, limit, [&](std::size_t k) {
    const double wanted = sources_.wanted_by(k, middle);
    if (wanted > limit) return;
    offers.push_back({rounded_down(wanted), static_cast<std::uint32_t>(k)});
    if (wanted >= best) return;
    best = wanted;
    limit = most(best);
  });
  std::erase_if(offers, [&](const Cube::Offer& offer) { return offer.in_middle > limit; });
  if (offers.size() > few_sources && half > small * std::max(best, least_) && depth < deepest) {
    offers = {};
    cube->children = std::make_unique<Cube::Children>();
    return cube;
  }
  std::sort(offers.begin(), offers.end(),
            [](const Cube::Offer& a, const Cube::Offer& b) { return a.in_middle < b.in_middle; });
  offers.shrink_to_fit();
  return cube;
}

double SpacingCone::at(Vec3d place) const {
  const auto within = [&](double at, double middle_of_cube) {
    return std::clamp(at, middle_of_cube - half_, middle_of_cube + half_);
  };
  const Vec3d inside{within(place.x, middle_.x), within(place.y, middle_.y),
                     within(place.z, middle_.z)};
  if (!(inside == place)) return std::min(most_, at(inside) + growth_ * norm(place - inside));
  const Cube* cube = root_.get();
  Vec3d middle = middle_;
  double half = half_;
  for (int depth = 1; cube->children; ++depth) {
    const int child =
        (place.x > middle.x ? 1 : 0) + (place.y > middle.y ? 2 : 0) + (place.z > middle.z ? 4 : 0);
    middle = middle_of_child(middle, half, child);
    half *= 0.5;
    std::atomic<const Cube*>& found = (*cube->children)[child];
    cube = found.load(std::memory_order_acquire);
    if (cube != nullptr) continue;
    auto made = made_cube(middle, half, depth);
    // Another thread may have made the same one.
    if (found.compare_exchange_strong(cube, made.get(), std::memory_order_acq_rel)) {
      cube = made.release();
    }
  }
  double spacing = most_;
  const double change = growth_ * norm(place - middle) * (1 + 1e-9);
  for (const Cube::Offer& offer : cube->offers) {
    if (offer.in_middle - change >= spacing) break;
    spacing = std::min(spacing, sources_.wanted_by(offer.source, place));
  }
  return spacing;
}

std::vector<double> SpacingField::of_sources(std::span<const Vec3d> place) const {
  return tabulated(place.size(), [&](std::size_t k) {
    return cone_ ? cone_->at(place[k]) : std::numeric_limits<double>::infinity();
  });
}

std::vector<double> SpacingField::at(std::span<const Vec3d> place) const {
  return tabulated(place.size(), [&](std::size_t k) { return at(place[k]); });
}

double SpacingField::at(Vec3d place, double of_sources) const {
  if (is_uniform()) return coarsest_;
  double spacing = std::min(coarsest_, of_sources);
  for (const FinerRegion& finer : regions_) {
    const double beyond = std::max(0.0, finer.region.distance(place));
    spacing = std::min(spacing, coarsest_ / finer.ratio + growth_ * beyond);
  }
  return std::max(spacing, finest());
}

SpacingField SpacingField::with_coarsest(double coarsest) const {
  SpacingField other = *this;
  other.coarsest_ = coarsest;
  return other;
}

}  // namespace phyxel
