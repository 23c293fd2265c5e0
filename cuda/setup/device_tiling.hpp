/// A model's tiles in device memory.
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

/// `Tiling` in device memory, with the moments.
struct DeviceTiling {
  std::vector<Index> phyxel, place, part;  ///< As in `Tiling`, on the host.
  Index own_tiles = 0, boundary_tiles = 0;
  DeviceArray<Index> phyxel_at;  ///< Copy of `phyxel` on the device.
  DeviceTileLists neighbours;
  std::optional<DeviceTileLists>
      inverse;                        ///< For the second pass; unset if the lists are symmetric.
  DeviceArray<Sym3d> inverse_moment;  ///< [1/m²], shape [places]; zero at empty places.
  DeviceArray<Vec3d> moment_offset;   ///< [m], shape [places].

  Index places() const { return static_cast<Index>(phyxel.size()); }
  Index tiles() const { return static_cast<Index>(part.size()); }
  const DeviceTileLists& second() const { return inverse ? *inverse : neighbours; }
};

/// Makes the tiling on the current device, equal to that of `make_tiling`. Neighbours that the
/// model lists are sent there; otherwise the device searches for them.
/// @throws DeviceError; InputError if a tile reaches more points than 16-bit slots can address
DeviceTiling make_device_tiling(const Model& model);

/// Copies the tiles and lists to the host.
Tiling fetched_tiling(const DeviceTiling& on_device);

}  // namespace phyxel::cuda
