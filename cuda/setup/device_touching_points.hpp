/// The search on the device for points of surfaces that may touch other bodies soon.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "check.hpp"
#include "pinned.hpp"
#include "setup/search_facts.hpp"
#include "solver/contact_search.hpp"
#include "solver/point_exchange.hpp"
#include "solver/surface_layer.hpp"

namespace phyxel::cuda {

struct FoundRows;
struct LayerView;

/// The points and lists of `phyxel::TouchingPoints` in device memory, with the same bits. The host
/// has only the boxes of bodies and, with ranks, the candidates.
class DeviceTouchingPoints {
 public:
  /// The points of this device, which come first, shape [count] each.
  struct Own {
    DeviceArray<Index> layer;  ///< Numbers in the layer.
    DeviceArray<Index> place;  ///< Tile slots.
    DeviceArray<Index> tiles;  ///< The tiles of these slots, ascending, each once; shape [tiles].
    /// Slots in the listed tiles: the number of a tile in `tiles` times its size, plus the slot in
    /// it.
    DeviceArray<Index> entry;
    DeviceArray<Index> body;      ///< Numbers of their bodies.
    DeviceArray<Vec3d> position;  ///< At rest [m].
    DeviceArray<Vec3d> centre;    ///< Centre of mass of their bodies, at rest [m].
  };
  /// Lists of `ContactPasses`, and the points that they name.
  struct Lists {
    DeviceArray<SurfaceSite> site;  ///< Shape [points].
    DeviceArray<Index> id;          ///< Shape [points].
    DeviceArray<ContactRow> rows;
    bool have_patches = false;  ///< True if a point of a row is beside several patches of a body.
    DeviceArray<Index> near, rows_naming, entries_of, rows_from;
    DeviceArray<Offset> near_start, entries_of_start, rows_from_start;
  };

  /// @param layer must outlive this. @param place tile slots of its phyxels
  /// @param tiles number of tiles. @param stream of the search and of those who use its lists; it
  /// must synchronise with CUDA's default stream
  DeviceTouchingPoints(const SurfaceLayer& layer, const std::vector<Index>& place, Index tiles,
                       cudaStream_t stream);

  /// Finds the points anew from places [m], shape [layer], which work on the stream has written.
  /// Launches on the stream may use them at once. Of a share: collective.
  /// @param dt size of the step [s]. @param skins of the bodies [m] (`skin_of`)
  void find(const DeviceArray<Vec3d>& position, double dt, const std::vector<double>& skins);

  /// The memory of the points, also for arrays of their values. It must outlive these.
  MemoryPool& pool() const { return *pool_; }
  const Own& own() const { return own_; }
  const Lists& lists() const { return lists_; }
  /// True if there are rows on any rank.
  bool any() const { return any_; }
  /// The extents of bodies when points were found.
  const BodyReach& reach() const { return reach_; }

  /// As of `phyxel::TouchingPoints`. Of a share: collective.
  DeviceArray<double> wave_moduli();
  DeviceArray<double> regains(double dt);
  /// Gives the points of other ranks the values that their owners have, through the host. Of a
  /// share: collective. @param of_points shape [points]
  template <class T>
  void refresh(const DeviceArray<T>& of_points) const {
    if (!layer_.model().share) return;
    std::vector<T> values(of_points.size());
    of_points.download(values.data());
    exchange_.refresh(values);
    of_points.upload(values.data());
  }

  std::size_t bytes() const;

 private:
  std::span<const Box> boxes_of_groups(const DeviceArray<Vec3d>& position);
  void send_reach(const std::vector<double>& skins);
  LayerView view(const DeviceArray<Vec3d>& position, double most_skin) const;
  /// Sets points and lists. @param chosen flags of the candidates that are points
  void set_points(const DeviceArray<ContactCandidate>& points, const DeviceArray<char>& chosen,
                  FoundRows found, int rank);
  void plan_exchange(const DeviceArray<ContactCandidate>& points, const DeviceArray<Index>& other);

  std::unique_ptr<MemoryPool> pool_;  // outlives the arrays
  const SurfaceLayer& layer_;
  Index tiles_;
  double dt_ = -1;         // of the gains [s]
  double regain_dt_ = -1;  // of the regains [s]
  NearBoxes near_bodies_;
  BodyReach reach_;
  PointExchange exchange_;
  bool any_ = false;
  std::size_t entry_room_ = 0;  // entries that the next search makes room for
  Own own_;
  Lists lists_;
  // Of the layer.
  DeviceArray<SurfaceSite> site_;
  DeviceArray<double> gain_;
  DeviceArray<double> modulus_, regain_;  // of penalties; empty without them
  DeviceArray<Index> place_, id_, body_;
  DeviceArray<Vec3d> rest_, centre_;
  DeviceArray<Index> group_begin_, group_end_;
  // Of the bodies: their boxes and whom they may touch.
  DeviceArray<Box> box_;
  DeviceArray<Offset> partner_start_;
  DeviceArray<Index> partner_;
  DeviceArray<ContactLaw> partner_law_;
  DeviceArray<double> skin_;
  // On the way between the host and the device.
  FactsOnDevice facts_;
  PinnedArray<Box> group_boxes_, sent_box_;
  PinnedArray<Offset> sent_start_;
  PinnedArray<Index> sent_partner_;
  PinnedArray<ContactLaw> sent_law_;
  PinnedArray<double> sent_skin_;
};

}  // namespace phyxel::cuda
