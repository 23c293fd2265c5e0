#include <algorithm>
#include <utility>

#include "model/assembly.hpp"
#include "model/closing_areas.hpp"
#include "model/neighbour_search.hpp"
#include "model/share_surveyor.hpp"
#include "mpi/share_pipeline.hpp"
#include "rank_sums.hpp"
#include "scene/scene_error.hpp"
#include "tabulated.hpp"

namespace phyxel {
// Two supports reach the neighbours of ghosts and the carriers of surfels.
LocalModel surroundings_of(const ShareSetup& setup, const WholeBodies& whole,
                           MigratingPhyxels own) {
  Surrounded all = surrounded(setup.ranks, own, remote_phyxels_within(setup, whole, own, 2));
  release(own);
  LocalModel local{.phyxels = std::move(all.phyxels),
                   .owner = std::move(all.owner),
                   .bodies = std::vector<Range>(whole.bodies.size()),
                   .model = {},
                   .around = {},
                   .surfel_id = {},
                   .areas = {},
                   .rank = setup.ranks.rank()};
  Model& m = local.model;
  setup.ranks.collectively([&] {
    m.position =
        tabulated(local.phyxels.size(), [&](std::size_t k) { return local.phyxels[k].position; });
    m.neighbourhood.support =
        tabulated(local.phyxels.size(), [&](std::size_t k) { return local.phyxels[k].support; });
    for (const auto& [first, last] : ranges_of_bodies(local.phyxels)) {
      local.bodies[static_cast<std::size_t>(local.phyxels[first].body)] = {
          static_cast<Index>(first), static_cast<Index>(last)};
    }
    Index before = 0;
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      Range& body = local.bodies[b];
      if (body.begin == body.end) body.begin = body.end = before;  // nobody is here
      before = body.end;
      const NeighbourhoodRule& rule = whole.bodies[b].rule;
      if (setup.options.surveyor) {
        if (rule.one_sided()) m.neighbourhood.symmetric = false;
        continue;
      }
      const std::span<const Vec3d> position = of_range(m.position, body);
      Neighbourhood hood = neighbours_within(position,
                                             {m.neighbourhood.support.begin() + body.begin,
                                              m.neighbourhood.support.begin() + body.end},
                                             rule);
      separate(hood, position, whole.bodies[b].walls, whole.bodies[b].pair_length);
      std::copy(hood.support.begin(), hood.support.end(),
                m.neighbourhood.support.begin() + body.begin);
      append_lists(m.neighbourhood, std::move(hood), body.begin);
    }
  });
  return local;
}

namespace {

/// Returns the parts of a body.
std::span<const Part> model_parts_of(const WholeBodies& whole, const LocalModel& local,
                                     std::size_t b) {
  return local.model.parts_of_body(local.model.parts[whole.bodies[b].first_part]);
}

void extend(std::vector<double>& values, std::vector<double>&& more) {
  if (values.empty()) {
    values = std::move(more);
  } else {
    values.insert(values.end(), more.begin(), more.end());
  }
}
static std::vector<double> values_of(const LocalModel& local, const Range& body,
                                     double MigratingPhyxel::*value) {
  return tabulated(static_cast<std::size_t>(body.end - body.begin), [&](std::size_t k) {
    return local.phyxels[static_cast<std::size_t>(body.begin) + k].*value;
  });
}

void collect_ghost_neighbours(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local,
                              std::size_t b) {
  Model& m = local.model;
  const Range& body = local.bodies[b];
  const std::vector<double> spacing = whole.bodies[b].kernel_volumes
                                          ? values_of(local, body, &MigratingPhyxel::spacing)
                                          : std::vector<double>();
  const auto own = in_bulk(
      static_cast<std::size_t>(body.end - body.begin),
      [&](std::size_t k) -> char { return owns(local, static_cast<std::size_t>(body.begin) + k); });
  if (setup.options.surveyor) {
    Around& around = local.around.emplace_back(setup.options.surveyor->around(
        of_range(m.position, body), of_range(m.neighbourhood.support, body), spacing, own,
        whole.bodies[b].rule.one_sided()));
    append(m.degenerate, around.degenerate, body.begin);
    return;
  }
  const Neighbourhood& hood = m.neighbourhood;
  Around& around = local.around.emplace_back(around_by_lists(hood, body.begin, own));
  if (whole.bodies[b].kernel_volumes) {
    around.kernel_sum =
        kernel_sums(m.position, hood, spacing, whole.bodies[b].rule.pairwise(), body.begin);
  }
}

/// Checks the masses of own phyxels as `check_masses` does; messages have their numbers in the
/// body.
void check_own_masses(const BodyRequest& request, const LocalModel& local, const Range& body,
                      const Masses& masses) {
  for (Index i = body.begin; i < body.end; ++i) {
    if (!owns(local, static_cast<std::size_t>(i))) continue;
    const auto k = static_cast<std::size_t>(i - body.begin);
    check_mass(request, local.phyxels[i].number, masses.mass[k], masses.volume[k]);
  }
}

/// Finds the masses and volumes of own phyxels. With kernel volumes those of ghosts are wrong here:
/// only their owners have the sums from which they follow.
void find_masses(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  std::vector<ExactSum> sums(whole.bodies.size());
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    if (!whole.bodies[b].kernel_volumes) continue;
    const Range& body = local.bodies[b];
    sums[b] = added_up<ExactSum>(body.begin, body.end, [&](ExactSum& sum, Index i) {
      if (!owns(local, static_cast<std::size_t>(i))) return;
      sum.add(local.around[b].kernel_sum[i - body.begin]);
    });
  }
  add_over_ranks(setup.ranks, sums);
  std::vector<Masses> made;
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    const Range& body = local.bodies[b];
    const double density = setup.scene.bodies[b].material.density;
    Masses masses =
        whole.bodies[b].kernel_volumes
            ? kernel_masses(values_of(local, body, &MigratingPhyxel::spacing),
                            local.around[b].kernel_sum, sums[b].value() / whole.bodies[b].size,
                            density)
            : geometric_masses(values_of(local, body, &MigratingPhyxel::volume), density);
    for (const Part& part : model_parts_of(whole, local, b).subspan(1)) {
      give_density(masses, part.begin - body.begin, part.end - body.begin, part.material.density,
                   density, whole.bodies[b].kernel_volumes);
    }
    made.push_back(std::move(masses));
  }
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      check_own_masses(setup.scene.bodies[b], local, local.bodies[b], made[b]);
    }
  });
  for (Masses& masses : made) {
    extend(m.mass, std::move(masses.mass));
    extend(m.volume, std::move(masses.volume));
  }
}

/// Makes the parts, with everything that does not depend on masses.
void begin_parts(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  for (std::size_t q = 0; q < whole.parts.size(); ++q) {
    const WholePart& known = whole.parts[q];
    const WholeBody& body = whole.bodies[known.body];
    const BodyRequest& request = setup.scene.bodies[known.body];
    Part& part = local.model.parts.emplace_back();
    part.name = known.material.name;
    part.body = static_cast<Index>(known.body);
    const std::span<const MigratingPhyxel> here = of_range(local.phyxels, local.bodies[known.body]);
    const auto first_from = [&](Index number) {
      const auto first = std::partition_point(here.begin(), here.end(),
                                              [&](const auto& p) { return p.number < number; });
      return local.bodies[known.body].begin + static_cast<Index>(first - here.begin());
    };
    part.begin = first_from(known.material.begin);
    part.end = first_from(known.material.end);
    part.material = known.material.material;
    part.material.law = law_of(request, known.material.material);
    part.material.hourglass = hourglass_of(request);
    part.neighbourhood = in_words(body.rule);
    part.kernel_volumes = body.kernel_volumes;
    part.size = known.size();
    part.surfels =
        q == body.first_part ? static_cast<Index>(whole.surfaces[known.body].position.size()) : 0;
    part.origin = body.origin;
    part.farthest = whole.boxes[known.body].farthest();
    part.pair_length = body.pair_length;
  }
}

/// Returns the number of pairs, the shortest and the longest list of own phyxels of a part.
ListLengths own_lengths(const WholeBodies& whole, const LocalModel& local, const Part& part) {
  const auto b = static_cast<std::size_t>(part.body);
  const Index begin = local.bodies[b].begin;
  Offset pairs = 0;
  Index fewest = whole.bodies[b].size, most = 0;
#pragma omp parallel for schedule(static) reduction(+ : pairs) reduction(min : fewest) \
    reduction(max : most)
  for (Index i = part.begin; i < part.end; ++i) {
    if (!owns(local, static_cast<std::size_t>(i))) continue;
    const Index length = local.around[b].length[i - begin];
    pairs += length;
    fewest = std::min(fewest, length);
    most = std::max(most, length);
  }
  return {pairs, fewest, most};
}

/// Finds mass, volume, centre and list lengths of each part, over all ranks.
void add_up_parts(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  std::vector<BodySums> sums(m.parts.size());
  std::vector<ListLengths> lists(m.parts.size());
  std::vector<ExactSum> cubes(m.parts.size());  // of supports, with weights of pairs
  std::vector<ExactSum*> all;
  for (std::size_t q = 0; q < m.parts.size(); ++q) {
    const Part& part = m.parts[q];
    sums[q] = added_up<BodySums>(part.begin, part.end, [&](BodySums& sum, Index i) {
      if (owns(local, static_cast<std::size_t>(i))) {
        sum.add(m.mass[i], m.volume[i], m.position[i]);
      }
    });
    if (part.pair_length > 0) {
      cubes[q] = added_up<ExactSum>(part.begin, part.end, [&](ExactSum& sum, Index i) {
        const double h = m.neighbourhood.support[i];
        if (owns(local, static_cast<std::size_t>(i))) sum.add(h * h * h);
      });
    }
    lists[q] = own_lengths(whole, local, part);
    BodySums& s = sums[q];
    all.insert(all.end(), {&s.mass, &s.volume, &s.moment.x, &s.moment.y, &s.moment.z, &cubes[q]});
  }
  add_over_ranks(setup.ranks, all);
  const std::vector<ListLengths> of_ranks = setup.ranks.gathered(std::span(std::as_const(lists)));
  std::vector<BodySums> of_bodies(whole.bodies.size());
  for (std::size_t q = 0; q < m.parts.size(); ++q) {
    of_bodies[static_cast<std::size_t>(m.parts[q].body)].add(sums[q]);
  }
  for (std::size_t q = 0; q < m.parts.size(); ++q) {
    Part& part = m.parts[q];
    sums[q].tell(part);
    part.support_cubes = cubes[q].value();
    Part body;
    of_bodies[static_cast<std::size_t>(part.body)].tell(body);
    part.centre = body.centre;
    part.lists.fewest = whole.bodies[static_cast<std::size_t>(part.body)].size;
    for (std::size_t k = q; k < of_ranks.size(); k += m.parts.size()) {
      part.lists.pairs += of_ranks[k].pairs;
      part.lists.fewest = std::min(part.lists.fewest, of_ranks[k].fewest);
      part.lists.most = std::max(part.lists.most, of_ranks[k].most);
    }
  }
}

/// Finds which bodies have closed gradients.
void choose_closures(const ShareSetup& setup, WholeBodies& whole, LocalModel& local) {
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      const BodyRequest& request = setup.scene.bodies[b];
      WholeBody& body = whole.bodies[b];
      if (body.size == 0) continue;
      const std::span<Part> parts =
          std::span(local.model.parts)
              .subspan(body.first_part, model_parts_of(whole, local, b).size());
      double volume = 0;
      for (const Part& part : parts) volume += part.volume;
      body.closure = naming(request, [&] {
        return closure_of(request, whole.surfaces[b], body.lattice, body.size,
                          body.kernel_volumes ? std::nullopt : std::optional(volume),
                          whole.warnings);
      });
      for (Part& part : parts) {
        part.closure = body.closure;
        part.automatic_closure = !request.closure;
      }
    }
  });
}

/// Returns the local phyxels, ghosts included, that the boundary of a body selects.
BoundaryChoice choice_of(const ShareSetup& setup, const WholeBodies& whole, const LocalModel& local,
                         std::size_t b) {
  const BodyRequest& request = setup.scene.bodies[b];
  const WholeBody& body = whole.bodies[b];
  const std::span<const MigratingPhyxel> here = of_range(local.phyxels, local.bodies[b]);
  Cloud cloud;
  cloud.position = tabulated(here.size(), [&](std::size_t k) { return here[k].position; });
  cloud.cuts = body.cuts;
  const auto in_region = [&](Index region) {
    std::vector<Index> chosen;
    for (std::size_t k = 0; k < here.size(); ++k) {
      if (body.region_sets.contains(here[k].region_set, region)) {
        chosen.push_back(static_cast<Index>(k));
      }
    }
    return chosen;
  };
  if (!body.region_of_entry.empty()) {  // its piece has been checked
    BoundaryChoice choice = BoundaryChoice::empty_of(request);
    for (const Selection* selection : selections_of(request)) {
      const int region = body.region_of_entry[choice.chosen.size()];
      choice.chosen.push_back(region >= 0 ? in_region(region)
                                          : select(*selection, {cloud, {}, body.size}, request,
                                                   choice.faces_of_next()));
    }
    choice.share_boundaries(request, {cloud, {}, body.size});
    return choice;
  }
  auto number = tabulated(here.size(), [&](std::size_t k) { return here[k].number; });
  for (const std::string& name : body.regions) cloud.regions[name];
  for (std::size_t r = 0; r < body.used_regions; ++r) {
    cloud.regions[body.regions[r]] = in_region(static_cast<Index>(r));
  }
  // An empty list of numbers would mean all phyxels.
  if (number.empty()) number.push_back(body.size);
  return naming(request, [&] { return choose_boundary(request, cloud, number, body.size); });
}

/// Finds the planes of symmetry of each body from its phyxels on all ranks.
std::vector<std::vector<SymmetryPlane>> planes_of_bodies(const ShareSetup& setup,
                                                         WholeBodies& whole,
                                                         const LocalModel& local) {
  std::vector<BodyExtent> extents(whole.bodies.size());
  std::vector<std::int64_t> sums;  // of `PlaneCounts::on` and `near`, plane by plane
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    const BodyRequest& request = setup.scene.bodies[b];
    if (request.symmetries.empty()) continue;
    extents[b] = extent_of(whole.boxes[b], whole.surfaces[b], whole.bodies[b].size);
    std::vector<Vec3d> own;
    std::vector<double> spacing;
    const bool graded = whole.bodies[b].rule.pairwise();
    if (!graded) spacing = {extents[b].spacing};
    for (Index i = local.bodies[b].begin; i < local.bodies[b].end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (!owns(local, k)) continue;
      own.push_back(local.phyxels[k].position);
      if (graded) spacing.push_back(local_spacing(request.neighbourhood, local.phyxels[k].support));
    }
    for (const PlaneCounts& count : count_at_planes(request, spacing, own)) {
      sums.insert(sums.end(), {count.on, count.near});
    }
  }
  setup.ranks.add(sums);
  std::vector<std::vector<SymmetryPlane>> planes(whole.bodies.size());
  setup.ranks.collectively([&] {
    auto sum = sums.begin();
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      const BodyRequest& request = setup.scene.bodies[b];
      std::vector<PlaneCounts> counts;
      for (std::size_t k = 0; k < request.symmetries.size(); ++k, sum += 2) {
        counts.push_back({sum[0], sum[1]});
      }
      planes[b] = naming(
          request, [&] { return symmetry_planes(request, extents[b], counts, whole.warnings); });
    }
  });
  return planes;
}

void add_boundary(const ShareSetup& setup, WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  std::vector<BoundaryChoice> choices(whole.bodies.size());
  std::vector<std::int64_t> counts;
  std::vector<std::vector<LoadSums>> sums(whole.bodies.size());
  const std::vector<std::vector<SymmetryPlane>> planes = planes_of_bodies(setup, whole, local);
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      if (selections_of(setup.scene.bodies[b]).empty() && planes[b].empty()) continue;
      const Index begin = local.bodies[b].begin;
      choices[b] = choice_of(setup, whole, local, b);
      const std::span<const MigratingPhyxel> here = of_range(local.phyxels, local.bodies[b]);
      choices[b].add_planes(setup.scene.bodies[b],
                            tabulated(here.size(), [&](std::size_t k) { return here[k].position; }),
                            planes[b]);
      BoundaryChoice own = choices[b];
      for (auto* lists : {&own.chosen, &own.left}) {
        for (std::vector<Index>& phyxels : *lists) {
          std::erase_if(phyxels,
                        [&](Index i) { return !owns(local, static_cast<std::size_t>(begin + i)); });
        }
      }
      for (const std::int64_t count : own.counts()) counts.push_back(count);
      sums[b] = own.load_sums(m, begin, whole.bodies[b].origin);
    }
  });
  setup.ranks.add(counts);
  std::vector<ExactSum*> all;
  for (std::vector<LoadSums>& of_body : sums) {
    for (LoadSums& of_load : of_body) {
      for (ExactSum* sum : of_load.all()) all.push_back(sum);
    }
  }
  add_over_ranks(setup.ranks, all);
  setup.ranks.collectively([&] {
    auto count = counts.begin();
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      const BodyRequest& request = setup.scene.bodies[b];
      const auto entries = static_cast<std::ptrdiff_t>(choices[b].counts().size());
      naming(request, [&] {
        choices[b].refuse_empty(request, {count, count + entries}, whole.boxes[b]);
        if (entries > 0) {
          choices[b].warn_of_few(request, {count, count + entries}, whole.warnings);
          choices[b].warn_of_moved(request, whole.bodies[b].cuts, whole.warnings);
          choices[b].warn_of_gaps(request, whole.bodies[b].cuts, whole.boxes[b], whole.warnings);
        }
      });
      count += entries;
      naming(request, [&] {
        choices[b].add_to(m, request, local.bodies[b].begin, sums[b], whole.bodies[b].origin,
                          loaded_pieces(request, whole.surfaces[b]));
      });
    }
  });
}

/// Finds the degenerate phyxels of all ranks, by their global ids.
void gather_degenerate(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  Degenerate& d = local.model.degenerate;
  for (std::vector<Index>* kind : {&d.isolated, &d.collinear, &d.coplanar, &d.coincident}) {
    std::vector<Index> own;
    for (const Index i : *kind) {
      if (owns(local, static_cast<std::size_t>(i))) own.push_back(global_id_of(whole, local, i));
    }
    *kind = setup.ranks.gathered(std::span(std::as_const(own)));
    std::sort(kind->begin(), kind->end());
  }
}

}  // namespace

void complete_model(const ShareSetup& setup, WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  m.gravity = setup.scene.gravity;
  for (const WholeBody& body : whole.bodies) m.walls.push_back(body.walls);
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      collect_ghost_neighbours(setup, whole, local, b);
    }
  });
  begin_parts(setup, whole, local);
  find_masses(setup, whole, local);
  add_up_parts(setup, whole, local);
  choose_closures(setup, whole, local);
  add_boundary(setup, whole, local);
  find_moments(m);
  gather_degenerate(setup, whole, local);
  add_surfels(setup, whole, local);
  find_areas(setup, whole, local);
  add_tractions(setup, whole, local);
  find_contact_layer(setup, whole, local);
}

}  // namespace phyxel
