#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "model/assembly.hpp"
#include "model/host_memory.hpp"
#include "mpi/share_pipeline.hpp"
#include "scene/scene_error.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Makes a region of the phyxels that a boundary entry selects, and returns its number.
/// @param name of the region, or the entry's line if it has none. @param sets for each phyxel, the
/// number of its set of regions
int add_region(const std::string& name, std::span<const Index> members, WholeBody& body,
               std::vector<std::uint32_t>& sets) {
  const auto region = static_cast<Index>(body.regions.size());
  for (const Index i : members) sets[i] = body.region_sets.with(sets[i], region);
  body.regions.push_back(name);
  return region;
}

/// Returns the numbers of a piece's phyxels in the cloud; for an empty piece, one number that no
/// phyxel has.
std::vector<Index> numbers_of(const CloudPiece& piece) {
  std::vector<Index> number = tabulated(piece.cloud.position.size(), [&](std::size_t i) {
    return piece.first + static_cast<Index>(i);
  });
  if (number.empty()) number.push_back(piece.whole);  // none would mean all
  return number;
}

/// Returns, for each phyxel of a piece, the number of its set of regions in
/// `WholeBody::region_sets`; empty if the scene names no region. In bodies with inclusions, whose
/// phyxels are renumbered by material, selections by number become regions, too.
std::vector<std::uint32_t> find_region_sets(const BodyRequest& request, const CloudPiece& piece,
                                            WholeBody& body) {
  const Cloud& cloud = piece.cloud;
  std::vector<std::uint32_t> sets;
  const std::vector<const Selection*> selections = selections_of(request);
  BoundaryChoice choice;
  if (!request.inclusions.empty() && !selections.empty()) {
    choice = choose_boundary(request, cloud, numbers_of(piece), piece.whole);
  }
  for (std::size_t entry = 0; entry < selections.size(); ++entry) {
    const Selection& selection = *selections[entry];
    int region = -1;
    if (selection.region) {
      const auto found = cloud.regions.find(*selection.region);
      const auto known = std::find(body.regions.begin(), body.regions.end(), *selection.region);
      if (known != body.regions.end()) {
        region = static_cast<int>(known - body.regions.begin());
      } else if (found != cloud.regions.end()) {
        // An unknown region is refused later, when phyxels are chosen.
        sets.resize(cloud.position.size(), RegionSets::none);
        region = add_region(found->first, found->second, body, sets);
      }
    } else if (selection.indices && !choice.chosen.empty()) {
      sets.resize(cloud.position.size(), RegionSets::none);
      region = add_region(selection.where, choice.selected(entry), body, sets);
    }
    if (!choice.chosen.empty()) body.region_of_entry.push_back(region);
  }
  body.used_regions = body.regions.size();
  for (const auto& [name, members] : cloud.regions) {
    if (std::count(body.regions.begin(), body.regions.end(), name) == 0) {
      body.regions.push_back(name);
    }
  }
  return sets;
}

/// Gives the sets of regions the same numbers on all ranks.
void agree_on_regions(const ShareSetup& setup, WholeBodies& whole, MigratingPhyxels& own) {
  std::vector<RegionSets> sets;
  for (WholeBody& body : whole.bodies) sets.push_back(std::move(body.region_sets));
  const auto renumbered = RegionSets::agree(setup.ranks, sets);
  for (std::size_t b = 0; b < sets.size(); ++b) whole.bodies[b].region_sets = std::move(sets[b]);
  for (MigratingPhyxel& p : own) p.region_set = renumbered[p.body][p.region_set];
}

/// The materials of the phyxels in this rank's piece of a body with inclusions.
struct PieceMaterials {
  std::size_t body = 0;
  std::size_t begin = 0;  ///< Index of the piece's first phyxel among this rank's own.
  Index first = 0;        ///< Number of that phyxel in the cloud.
  MaterialChoice choice;
};

/// The number of phyxels of one material in a rank's piece of a body.
struct MaterialCount {
  Index body, first, material;  ///< `first`: the number of the piece's first phyxel in the cloud.
  std::int64_t size, selected;
};

/// Finds the parts of all bodies. @param counts of all ranks, body by body
void find_parts(const ShareSetup& setup, const std::vector<MaterialCount>& counts,
                WholeBodies& whole) {
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    const BodyRequest& request = setup.scene.bodies[b];
    std::vector<std::int64_t> size(request.inclusions.size() + 1, 0);
    std::vector<std::int64_t> selected(request.inclusions.size(), 0);
    if (request.inclusions.empty()) size[0] = whole.bodies[b].size;
    for (const MaterialCount& count : of_body(counts, b)) {
      size[count.material] += count.size;
      if (count.material > 0) selected[count.material - 1] += count.selected;
    }
    whole.bodies[b].first_part = whole.parts.size();
    naming(request, [&] {
      for (MaterialGroup& group : material_groups(request, size, selected, whole.boxes[b])) {
        whole.parts.push_back({.body = b, .material = std::move(group)});
      }
    });
  }
}

/// Finds the parts of all bodies, and numbers this rank's phyxels by material.
void number_by_material(const ShareSetup& setup, const std::vector<PieceMaterials>& pieces,
                        WholeBodies& whole, MigratingPhyxels& own) {
  std::vector<MaterialCount> here;
  for (const PieceMaterials& piece : pieces) {
    for (std::size_t k = 0; k < piece.choice.size.size(); ++k) {
      here.push_back({static_cast<Index>(piece.body), piece.first, static_cast<Index>(k),
                      piece.choice.size[k], k > 0 ? piece.choice.selected[k - 1] : 0});
    }
  }
  std::vector<MaterialCount> all = setup.ranks.gathered(std::span(std::as_const(here)));
  std::stable_sort(all.begin(), all.end(),
                   [](const MaterialCount& x, const MaterialCount& y) { return x.body < y.body; });
  setup.ranks.collectively([&] { find_parts(setup, all, whole); });
  for (const PieceMaterials& piece : pieces) {
    std::vector<Index> next(piece.choice.size.size(), 0);  // number in the body, of each material
    for (std::size_t q = whole.bodies[piece.body].first_part;
         q < whole.parts.size() && whole.parts[q].body == piece.body; ++q) {
      next[whole.parts[q].material.which] = whole.parts[q].material.begin;
    }
    for (const MaterialCount& count : of_body(all, piece.body)) {
      if (count.first < piece.first) next[count.material] += static_cast<Index>(count.size);
    }
    const std::vector<Index>& material_of = piece.choice.material_of;
    for (std::size_t i = 0; i < material_of.size(); ++i) {
      own[piece.begin + i].number = next[material_of[i]]++;
    }
  }
}

/// Finds the place of each body's first phyxel.
void find_origins(const ShareSetup& setup, const MigratingPhyxels& own, WholeBodies& whole) {
  struct Origin {
    std::size_t body;
    Vec3d at;
  };
  std::vector<Origin> origins;
  for (const MigratingPhyxel& p : own) {
    if (p.number == 0) origins.push_back({static_cast<std::size_t>(p.body), p.position});
  }
  for (const Origin& origin : setup.ranks.gathered(std::span(std::as_const(origins)))) {
    whole.bodies[origin.body].origin = origin.at;
  }
}

/// Returns how many pieces of a length hold `size` phyxels; 0 if the length is 0.
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
  std::vector<std::int64_t> with_volumes(whole.bodies.size()), lattices(whole.bodies.size()),
      with_spacings(whole.bodies.size());
  std::vector<PieceMaterials> materials;
  setup.ranks.collectively([&] {
    validate(setup.scene);
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      CloudPiece made = piece(b);
      Cloud& cloud = made.cloud;
      if (!cloud.position.empty()) {
        naming(setup.scene.bodies[b], [&] { check_cloud(setup.scene.bodies[b], cloud); });
      }
      WholeBody& body = whole.bodies[b];
      body.size = made.whole;
      with_volumes[b] = !cloud.volume.empty();
      with_spacings[b] = !cloud.spacing.empty();
      lattices[b] = cloud.lattice;
      const BodyRequest& request = setup.scene.bodies[b];
      body.walls = walls_of(request, cloud);
      body.cuts = cloud.cuts;
      const std::vector<std::uint32_t> sets =
          naming(request, [&] { return find_region_sets(request, made, body); });
      if (!request.inclusions.empty()) {
        naming(request, [&] {
          materials.push_back(
              {b, own.size(), made.first,
               choose_materials(request, {made.cloud, numbers_of(made), made.whole})});
        });
      }
      const std::size_t before = own.size(), more = cloud.position.size();
      own.resize(before + more);
#pragma omp parallel for schedule(static)
      for (std::size_t i = 0; i < more; ++i) {
        own[before + i] = {.position = cloud.position[i],
                           .volume = cloud.volume.empty() ? 0 : cloud.volume[i],
                           .support = cloud.spacing.empty() ? 0 : cloud.spacing[i],
                           .body = static_cast<Index>(b),
                           .number = made.first + static_cast<Index>(i),
                           .region_set = sets.empty() ? RegionSets::none : sets[i]};
      }
      whole.surfaces[b] = std::move(cloud.surface);
      for (std::string& warning : cloud.warnings) whole.warnings.push_back(std::move(warning));
    }
  });
  setup.ranks.add(with_volumes);
  setup.ranks.add(with_spacings);
  setup.ranks.add(lattices);
  whole.boxes = boxes_of(setup.ranks, own, whole.bodies.size(),
                         [](const MigratingPhyxel& p) { return static_cast<std::size_t>(p.body); });
  agree_on_regions(setup, whole, own);
  number_by_material(setup, materials, whole, own);
  find_origins(setup, own, whole);
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      check_terms(setup.scene.bodies[b]);
      whole.bodies[b].lattice = lattices[b] > 0;
      whole.bodies[b].has_spacing = with_spacings[b] > 0;
      whole.bodies[b].rule =
          setup.scene.bodies[b].neighbourhood.resolved(whole.bodies[b].has_spacing);
      if (setup.options.surveyor)
        refuse_pairs_surveyed(setup.scene.bodies[b], whole.bodies[b].rule);
      whole.bodies[b].kernel_volumes =
          wants_kernel_volumes(setup.scene.bodies[b], with_volumes[b] > 0,
                               static_cast<std::size_t>(whole.bodies[b].size));
    }
  });
  return own;
}

void count_bodies(const ShareSetup& setup, WholeBodies& whole) {
  Offset size = 0;
  for (const WholeBody& body : whole.bodies) size += body.size;
  // Bytes in use at the peak, with lists those of the local model and its copy, the share; closing
  // gradients comes after the local model is released and takes less.
  setup.ranks.collectively([&] {
    require_host_memory("the scene", static_cast<double>(size),
                        (setup.options.surveyor ? 280.0 : 1700.0) / setup.ranks.size());
    std::int64_t places = 0;  // in tiles, of which parts fill whole ones
    for (const WholePart& part : whole.parts)
      places += count_of(part.size(), setup.options.tile) * setup.options.tile;
    if (places > std::numeric_limits<Index>::max()) {
      throw InputError(fmt::format("the bodies fill {} places in tiles of {}: allowed are {}",
                                   places, setup.options.tile, std::numeric_limits<Index>::max()));
    }
  });
  const Index group = group_size(setup.options, static_cast<Index>(size));
  Index base = 0;
  for (WholeBody& body : whole.bodies) {
    body.base = base;
    base += body.size;
  }
  Index tiles = 0;
  for (WholePart& part : whole.parts) {
    part.group = whole.groups;
    part.tile = tiles;
    whole.groups += static_cast<Index>(count_of(part.size(), group));
    tiles += static_cast<Index>(count_of(part.size(), setup.options.tile));
  }
  whole.group_size = group;
  whole.size = static_cast<Index>(size);
}

}  // namespace phyxel
