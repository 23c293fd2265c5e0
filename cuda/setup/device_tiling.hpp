/// A model's tiles in device memory: found there, or brought there where the host has the lists.
#pragma once

#include <optional>

#include "check.hpp"
#include "setup/tiling.hpp"

namespace phyxel::cuda {

/// `TileLists` in device memory.
struct DeviceTileLists {
  DeviceArray<Index> halo;
  int halo_stride = 0;
  DeviceArray<TileLists::Row> rows;
  DeviceArray<std::uint16_t> entries;

  int slots() const { return tile_size + far_slots + halo_stride; }
  std::size_t bytes() const { return halo.bytes() + rows.bytes() + entries.bytes(); }
};

struct DeviceTiling {
  std::vector<Index> phyxel, place, part;  ///< As in `Tiling`, on the host.
  Index own_tiles = 0, boundary_tiles = 0;
  DeviceArray<Index> phyxel_at;  ///< The same as `phyxel`, on the device.
  DeviceTileLists neighbours;
  std::optional<DeviceTileLists> inverse;  ///< Where the neighbours do not serve both passes.
  DeviceArray<Sym3d> inverse_moment;       ///< Shape [places]; zero where nobody is.
  DeviceArray<Vec3d> moment_offset;        ///< Shape [places].

  Index places() const { return static_cast<Index>(phyxel.size()); }
  Index tiles() const { return static_cast<Index>(part.size()); }
  const DeviceTileLists& second() const { return inverse ? *inverse : neighbours; }
};

/// On the current device. Lists that the model has are taken over; others are found, the same to
/// the last entry.
/// @throws DeviceError; InputError if a tile reaches more points than 16-bit slots can name.
DeviceTiling make_device_tiling(const Model& model);

/// The tiles and lists on the host, for plans made there.
Tiling fetched_tiling(const DeviceTiling& on_device);

}  // namespace phyxel::cuda
