/// The phyxels of surfaces by which bodies touch each other, and which bodies are near each other.
#pragma once

#include <span>
#include <vector>

#include "model/box.hpp"
#include "model/contact_groups.hpp"
#include "model/near_boxes.hpp"
#include "phyxel/model.hpp"
#include "phyxel/neighbourhood.hpp"
#include "phyxel/physics/body_contact.hpp"

namespace phyxel {

/// The extent of each body of the scene and its neighbours, equal on all ranks.
struct BodyReach {
  /// The box of the layer's phyxels of each body of the scene, grown by their ranges.
  std::vector<Box> boxes;
  /// The bodies within their skins of each body that it touches if they meet, ascending; with the
  /// body itself if its parts touch each other.
  Csr partners;
};

/// The contact layer of a model's bodies.
class SurfaceLayer {
 public:
  /// @param model must outlive this. Of a share: collective.
  explicit SurfaceLayer(const Model& model);

  const Model& model() const { return model_; }
  /// The phyxels of the layer, ascending.
  const std::vector<Index>& phyxels() const { return model_.body_contact.layer.phyxels; }
  /// Constants of each phyxel; the mobility is 1 along free axes and 0 along prescribed ones.
  const std::vector<SurfaceSite>& sites() const { return sites_; }
  /// The body that each belongs to.
  const std::vector<Index>& bodies() const { return bodies_; }
  /// Groups of the layer, in its order.
  const std::vector<LayerGroup>& groups() const { return groups_; }
  /// The body of each group.
  const std::vector<Index>& bodies_of_groups() const { return body_of_group_; }
  /// The smallest range of the phyxels of each body of the scene [m]; infinity without any.
  const std::vector<double>& ranges_of_bodies() const { return ranges_; }
  /// The smallest skin, and the largest that is worth its time where a step does not need more [m]:
  /// contact lists stay valid until phyxels have moved by it against each other. In heaps of dinos
  /// that fall onto each other, both half and twice the largest take a tenth more time or more, on
  /// the host and on a device.
  double least_skin() const { return 0.25 * least_range_; }
  double most_skin() const { return 0.5 * least_range_; }

  /// The change of velocity of each by a force over a step of `dt` [s], along free axes [m/s/N].
  std::vector<double> gains(double dt) const;
  /// 1 over what the damping of a step of `dt` [s] keeps of the velocity of each.
  std::vector<double> regains(double dt) const;
  /// The modulus of pressure waves of each [Pa].
  std::vector<double> wave_moduli() const;

  /// The box of a group, grown by the ranges of its phyxels. @param position shape [phyxels] [m]
  Box box_of(const LayerGroup& group, std::span<const Vec3d> position) const;
  /// The extents of bodies. Of a share: collective. @param boxes of the groups (`box_of`)
  /// @param near has served earlier calls, or none
  BodyReach reach_of(std::span<const Box> boxes, std::span<const double> skins,
                     NearBoxes& near) const;
  /// The same from places [m], shape [phyxels].
  BodyReach reach_at(std::span<const Vec3d> position, std::span<const double> skins,
                     NearBoxes& near) const;
  /// The same skin for all bodies.
  std::vector<double> skins(double skin) const { return std::vector(ranges_.size(), skin); }

  std::size_t bytes() const {
    return sites_.size() * sizeof(SurfaceSite) + bodies_.size() * sizeof(Index);
  }

 private:
  const Model& model_;
  std::vector<SurfaceSite> sites_;
  std::vector<Index> bodies_;
  std::vector<LayerGroup> groups_;
  std::vector<Index> body_of_group_;
  std::vector<double> ranges_;  // as of `ranges_of_bodies`
  double least_range_ = 0;      // of all phyxels [m]
};

}  // namespace phyxel
