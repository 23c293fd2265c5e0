/// The data of a live page: the bodies at rest once, and their motion frame by frame.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "phyxel/cloud.hpp"
#include "report/replay_data.hpp"
#include "view/live_scene.hpp"

namespace phyxel::app {

/// A field by which a page colours bodies.
struct LiveField {
  std::string name, unit;
};

/// The phyxels and surfels of a scene that a page shows, and how surfels follow phyxels. A page
/// moves each surfel by X + Σ w (u + ∇u (X - X_phyxel)) over its carriers, equation (6) of Farias
/// et al. 2008 with the nearest carriers, so that frames hold phyxels alone. Of large scenes, it is
/// a part of the surfels and their carriers. Functions are collective.
class LivePicture {
 public:
  /// Largest number of surfels and of phyxels that are shown.
  static constexpr std::size_t most_surfels = 60'000, most_phyxels = 30'000;
  /// Numbers of a phyxel in a frame, in 16 bits: three displacements, a field, and three rows of
  /// gradients, each with a place to spare.
  static constexpr std::size_t numbers_each = 16;

  explicit LivePicture(const LiveScene& live);

  // On the first rank:
  const std::vector<Vec3d>& surfels() const { return surfels_; }  ///< At rest [m].
  const std::vector<Vec3d>& phyxels() const { return phyxels_; }  ///< At rest [m].
  const std::vector<Triangle>& triangles() const { return triangles_; }
  const Carriers& carriers() const { return carriers_; }  ///< Places in `phyxels`.
  const std::vector<std::uint16_t>& surfel_bodies() const { return surfel_bodies_; }
  const std::vector<std::uint16_t>& phyxel_bodies() const { return phyxel_bodies_; }
  const std::vector<std::uint32_t>& ids() const { return ids_; }  ///< Global ids of `phyxels`.
  double spacing() const { return spacing_; }                     ///< Between phyxels [m].

  /// The fields of the scene's phyxels.
  const std::vector<LiveField>& fields() const { return fields_; }

  /// A frame, on the first rank; empty on others. Little-endian: a `FrameHead`, `numbers_each`
  /// signed numbers for each phyxel, and twelve floats for each obstacle: its rotation, row by row,
  /// and its place [m].
  /// @param field place in `fields`; -1: none @param number of the frame
  std::shared_ptr<const std::string> frame(const LiveScene& live, std::int32_t field,
                                           std::uint32_t number) const;

 private:
  void choose_surfels(const LiveScene& live, const std::vector<Vec3d>& rest);
  void find_rows(const Model& model);

  std::vector<Vec3d> surfels_, phyxels_;
  std::vector<Triangle> triangles_;
  Carriers carriers_;
  std::vector<std::uint16_t> surfel_bodies_, phyxel_bodies_;
  std::vector<std::uint32_t> ids_;
  double spacing_ = 0;
  std::vector<LiveField> fields_;
  std::vector<Index> here_;         // phyxels of this rank that are shown
  std::vector<std::size_t> place_;  // of the phyxels that all ranks send, one rank after the other
};

/// The head of a frame, before its numbers.
struct FrameHead {
  std::uint32_t kind = 1;     ///< Of the message.
  std::uint32_t number = 0;   ///< Of the frame.
  std::uint32_t phyxels = 0;  ///< Their number.
  std::int32_t field = 0;     ///< Place of the field among the scene's; -1: none.
  double time = 0;            ///< [s]
  float middle[3]{};          ///< Middle of the displacements [m], and
  float half[3]{};            ///< half their range: of 32,767 steps.
  float gradient = 0;         ///< Largest entry of the gradients: 32,767 steps.
  float low = 0, high = 0;    ///< Range of the field: -32,768 to 32,767.
  std::uint32_t unused = 0;   ///< Fills the head to a multiple of 8 bytes.
};

}  // namespace phyxel::app
