#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "model/assembly.hpp"
#include "model/host_memory.hpp"
#include "mpi/share_pipeline.hpp"
#include "scene/scene_error.hpp"

namespace phyxel {
namespace {

/// Of each phyxel of a piece; empty if the scene names no region.
std::vector<std::uint32_t> region_bits(const ShareSetup& setup, WholeBodies& whole, std::size_t b,
                                       const Cloud& cloud) {
  WholeBody& body = whole.bodies[b];
  std::vector<std::uint32_t> bits;
  for (const Selection* selection : selections_of(setup.scene.bodies[b])) {
    if (!selection->region) continue;
    const auto found = cloud.regions.find(*selection->region);
    // One that is not there is refused once phyxels are chosen.
    if (found == cloud.regions.end() ||
        std::count(body.regions.begin(), body.regions.end(), found->first) > 0) {
      continue;
    }
    if (body.regions.size() == 32) {
      throw InputError(fmt::format(
          "{}: body \"{}\" has more than 32 regions that are fixed, moved or loaded: allowed "
          "are 32 where several ranks share it",
          selection->where, setup.scene.bodies[b].name));
    }
    bits.resize(cloud.position.size(), 0);
    for (const Index i : found->second) bits[i] |= std::uint32_t{1} << body.regions.size();
    body.regions.push_back(found->first);
  }
  body.used_regions = body.regions.size();
  for (const auto& [name, members] : cloud.regions) {
    if (std::count(body.regions.begin(), body.regions.end(), name) == 0) {
      body.regions.push_back(name);
    }
  }
  return bits;
}

/// Pieces of a length that hold `size`; none of no length.
static std::int64_t count_of(std::int64_t size, std::int64_t length) {
  return length > 0 ? (size + length - 1) / length : 0;
}

Index group_size(const ShareOptions& options, Index size) {
  const Index tile = std::max(1, options.tile);
  const std::int64_t tiles = count_of(size, tile);
  return tile * std::max(1, static_cast<Index>(count_of(tiles, options.most_groups)));
}

}  // namespace

void check_alike(const MpiCommunicator& ranks, std::uint64_t digest) {
  const auto alike = static_cast<std::int64_t>(digest);
  if (ranks.smallest(alike) == ranks.largest(alike)) return;
  throw AgreedError(ExitCode::bad_input,
                    "the ranks have different bodies: allowed are the same files for all, on a "
                    "file system that all see");
}

MigratingPhyxels make_pieces(const ShareSetup& setup, const Pieces& piece, WholeBodies& whole) {
  MigratingPhyxels own;
  whole.surfaces.resize(whole.bodies.size());
  std::vector<std::int64_t> with_volumes(whole.bodies.size());
  struct Origin {
    std::size_t body;
    Vec3d at;
  };
  std::vector<Origin> origins;
  std::uint64_t digest = 0;  // of what each rank has made or read for itself
  setup.ranks.collectively([&] {
    validate(setup.scene);
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      CloudPiece made = piece(b, digest);
      Cloud& cloud = made.cloud;
      if (!cloud.position.empty()) {
        naming(setup.scene.bodies[b], [&] { check_cloud(setup.scene.bodies[b], cloud); });
      }
      WholeBody& body = whole.bodies[b];
      body.size = made.whole;
      with_volumes[b] = !cloud.volume.empty();
      if (made.first == 0 && !cloud.position.empty()) origins.push_back({b, cloud.position[0]});
      const std::vector<std::uint32_t> bits = region_bits(setup, whole, b, cloud);
      const std::size_t before = own.size(), more = cloud.position.size();
      own.resize(before + more);
#pragma omp parallel for schedule(static)
      for (std::size_t i = 0; i < more; ++i) {
        own[before + i] = {.position = cloud.position[i],
                           .volume = cloud.volume.empty() ? 0 : cloud.volume[i],
                           .body = static_cast<Index>(b),
                           .number = made.first + static_cast<Index>(i),
                           .regions = bits.empty() ? 0 : bits[i]};
      }
      whole.surfaces[b] = std::move(cloud.surface);
      for (std::string& warning : cloud.warnings) whole.warnings.push_back(std::move(warning));
    }
  });
  check_alike(setup.ranks, digest);
  setup.ranks.add(with_volumes);
  for (const Origin& origin : setup.ranks.gathered(std::span(std::as_const(origins)))) {
    whole.bodies[origin.body].origin = origin.at;
  }
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      check_terms(setup.scene.bodies[b]);
      whole.bodies[b].kernel_volumes =
          wants_kernel_volumes(setup.scene.bodies[b], with_volumes[b] > 0,
                               static_cast<std::size_t>(whole.bodies[b].size));
    }
  });
  return own;
}

/// Numbers, groups and tiles of bodies.
void count_bodies(const ShareSetup& setup, WholeBodies& whole) {
  Offset size = 0;
  for (const WholeBody& body : whole.bodies) size += body.size;
  // At any time, with lists: those around and the copy that a share is included.
  setup.ranks.collectively([&] {
    require_host_memory("the scene", static_cast<double>(size),
                        (setup.options.surveyor ? 280.0 : 1700.0) / setup.ranks.size());
    std::int64_t places = 0;  // in tiles, of which bodies fill whole ones
    for (const WholeBody& body : whole.bodies)
      places += count_of(body.size, setup.options.tile) * setup.options.tile;
    if (places > std::numeric_limits<Index>::max()) {
      throw InputError(fmt::format("the bodies fill {} places in tiles of {}: allowed are {}",
                                   places, setup.options.tile, std::numeric_limits<Index>::max()));
    }
  });
  const Index group = group_size(setup.options, static_cast<Index>(size));
  WholeBody next;
  for (WholeBody& body : whole.bodies) {
    body.base = next.base;
    body.group = next.group;
    body.tile = next.tile;
    next.base += body.size;
    next.group += static_cast<Index>(count_of(body.size, group));
    next.tile += static_cast<Index>(count_of(body.size, setup.options.tile));
  }
  whole.groups = next.group;
  whole.group_size = group;
  whole.size = static_cast<Index>(size);
}

}  // namespace phyxel
