/// The distance between phyxels that is wanted at each place of a body.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "mesh/point_tree.hpp"
#include "model/box.hpp"
#include "phyxel/space_region.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// A place at which a distance between phyxels is wanted.
struct SpacingSource {
  Vec3d place;     ///< [m]
  double spacing;  ///< [m]
};
/// A region in which phyxels are to be nearer to each other than elsewhere.
struct FinerRegion {
  SpaceRegion region;
  double ratio = 1;  ///< The coarsest spacing of the body over the one in the region.
};

/// Sources in a tree, for searches of those that may want a small spacing at a place.
class SourceTree {
 public:
  /// @param growth growth of a wanted spacing along the distance from its source
  SourceTree(std::span<const SpacingSource> sources, double growth);

  /// The spacing that source k wants at a place [m].
  double wanted_by(std::size_t k, Vec3d place) const {
    return sources_[k].spacing + growth_ * norm(place - sources_[k].place);
  }
  /// Calls visit(k) for sources of which some may want no more than a limit at a place [m].
  /// @param limit the limit, which a visit may make smaller
  template <class Visit>
  void search(Vec3d place, const double& limit, Visit&& visit) const {
    tree_.search(
        [&](std::size_t node) {
          return finest_[node] + growth_ * std::sqrt(distance2(place, tree_.box(node)));
        },
        limit, visit);
  }
  /// The sources but those that want the smallest spacing nowhere: another one wants less where
  /// they are.
  std::vector<SpacingSource> that_matter() const;

 private:
  double growth_;
  PointTree tree_;
  std::vector<SpacingSource> sources_;  ///< In the order of the tree.
  std::vector<double> finest_;          ///< The smallest spacing of each node of the tree [m].
};

/// The smallest of s + growth * |p - x| over sources at x with spacings s, by an octree of cubes:
/// each leaf has a list of the sources that may be the smallest somewhere in it. A cube is made
/// when a place in it is first asked for, by a search of a tree of the sources.
class SpacingCone {
 public:
  /// @param most spacings beyond this are not wanted [m]
  /// @param least distances below this may be resolved no further [m]
  /// @param box around all places that matter, sources included
  SpacingCone(std::span<const SpacingSource> sources, double growth, double least, double most,
              const Box& box);
  ~SpacingCone();

  /// The spacing wanted at a place [m]; `most` where no source asks for less. Outside the box it
  /// grows from the box's faces.
  double at(Vec3d place) const;

 private:
  struct Cube;
  std::unique_ptr<Cube> made_cube(Vec3d middle, double half, int depth) const;

  SourceTree sources_;
  double growth_, least_, most_;
  Vec3d middle_;
  double half_ = 0;  ///< Half the side of the octree's cube [m].
  std::unique_ptr<const Cube> root_;
};

/// The distance between phyxels that is wanted at each place: one throughout, or one between a
/// finest and a coarsest that grows with the distance from sources and finer regions by at most
/// `growth` times that distance.
class SpacingField {
 public:
  /// One spacing for all places [m].
  explicit SpacingField(double everywhere) : coarsest_(everywhere) {}
  /// @param cone may be null
  /// @param ratio the coarsest spacing over the finest
  SpacingField(std::shared_ptr<const SpacingCone> cone, std::vector<FinerRegion> regions,
               double growth, double ratio, double coarsest)
      : cone_(std::move(cone)),
        regions_(std::move(regions)),
        growth_(growth),
        ratio_(ratio),
        coarsest_(coarsest) {}

  /// The distance wanted at a place [m].
  double at(Vec3d place) const {
    return at(place, cone_ ? cone_->at(place) : std::numeric_limits<double>::infinity());
  }
  /// The distances wanted at many places [m].
  std::vector<double> at(std::span<const Vec3d> place) const;
  /// The parts of the distances at many places that do not depend on the coarsest spacing [m]: the
  /// distances that sources want.
  std::vector<double> of_sources(std::span<const Vec3d> place) const;
  /// The distance wanted at a place [m]. @param of_sources the distance that sources want there [m]
  double at(Vec3d place, double of_sources) const;
  bool is_uniform() const { return ratio_ == 1; }
  double coarsest() const { return coarsest_; }         ///< [m]
  double finest() const { return coarsest_ / ratio_; }  ///< [m]
  double growth() const { return growth_; }
  /// The same wishes with another coarsest spacing [m].
  SpacingField with_coarsest(double coarsest) const;

 private:
  std::shared_ptr<const SpacingCone> cone_;
  std::vector<FinerRegion> regions_;
  double growth_ = 0, ratio_ = 1, coarsest_;
};

}  // namespace phyxel
