#include <algorithm>
#include <utility>

#include "exact_sum.hpp"
#include "model/assembly.hpp"
#include "model/neighbour_search.hpp"
#include "model/share_surveyor.hpp"
#include "mpi/share_pipeline.hpp"
#include "scene/scene_error.hpp"
#include "tabulated.hpp"

namespace phyxel {
/// As far as the neighbours of ghosts, and the carriers of surfels.
LocalModel surroundings_of(const ShareSetup& setup, const WholeBodies& whole,
                           MigratingPhyxels own) {
  Surrounded all = surrounded(setup.ranks, own, remote_phyxels_within(setup, whole, own, 2));
  release(own);
  LocalModel local{std::move(all.phyxels), std::move(all.owner), {}, {}, {}, setup.ranks.rank()};
  Model& m = local.model;
  setup.ranks.collectively([&] {
    m.position =
        tabulated(local.phyxels.size(), [&](std::size_t k) { return local.phyxels[k].position; });
    m.neighbourhood.support =
        tabulated(local.phyxels.size(), [&](std::size_t k) { return local.phyxels[k].support; });
    m.parts.resize(whole.bodies.size());
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) m.parts[b].body = static_cast<Index>(b);
    for (const auto& [first, last] : ranges_of_bodies(local.phyxels)) {
      Part& part = m.parts[static_cast<std::size_t>(local.phyxels[first].body)];
      part.begin = static_cast<Index>(first);
      part.end = static_cast<Index>(last);
    }
    Index before = 0;
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      Part& part = m.parts[b];
      if (part.begin == part.end) part.begin = part.end = before;  // nobody is here
      before = part.end;
      const NeighbourhoodRule& rule = setup.scene.bodies[b].neighbourhood;
      if (setup.options.surveyor) {
        if (rule.one_sided()) m.neighbourhood.symmetric = false;
        continue;
      }
      const Neighbourhood hood = neighbours_within(of_part(m.position, part),
                                                   {m.neighbourhood.support.begin() + part.begin,
                                                    m.neighbourhood.support.begin() + part.end},
                                                   rule);
      append_lists(m.neighbourhood, hood, part.begin);
      std::copy(hood.support.begin(), hood.support.end(),
                m.neighbourhood.support.begin() + part.begin);
    }
  });
  return local;
}

namespace {

/// Adds the sums of all ranks, in place.
void total(const MpiCommunicator& ranks, const std::vector<ExactSum*>& sums) {
  std::vector<std::int64_t> words;
  for (ExactSum* sum : sums) {
    const std::span<std::int64_t> ready = sum->ready();
    words.insert(words.end(), ready.begin(), ready.end());
  }
  ranks.add(words);
  const std::int64_t* from = words.data();
  for (ExactSum* sum : sums) {
    std::copy_n(from, ExactSum::words, sum->ready().begin());
    from += ExactSum::words;
  }
}

void extend(std::vector<double>& values, std::vector<double>&& more) {
  if (values.empty()) {
    values = std::move(more);
  } else {
    values.insert(values.end(), more.begin(), more.end());
  }
}
static std::vector<double> values_of(const LocalModel& local, const Part& part,
                                     double MigratingPhyxel::*value) {
  return tabulated(static_cast<std::size_t>(part.end - part.begin), [&](std::size_t k) {
    return local.phyxels[static_cast<std::size_t>(part.begin) + k].*value;
  });
}

void collect_ghost_neighbours(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local,
                              std::size_t b) {
  Model& m = local.model;
  const Part& part = m.parts[b];
  const std::vector<double> spacing = whole.bodies[b].kernel_volumes
                                          ? values_of(local, part, &MigratingPhyxel::spacing)
                                          : std::vector<double>();
  const auto own = in_bulk(
      static_cast<std::size_t>(part.end - part.begin),
      [&](std::size_t k) -> char { return owns(local, static_cast<std::size_t>(part.begin) + k); });
  if (setup.options.surveyor) {
    Around& around = local.around.emplace_back(setup.options.surveyor->around(
        of_part(m.position, part), of_part(m.neighbourhood.support, part), spacing, own,
        setup.scene.bodies[b].neighbourhood.one_sided()));
    append(m.degenerate, around.degenerate, part.begin);
    return;
  }
  const Neighbourhood& hood = m.neighbourhood;
  Around& around = local.around.emplace_back(around_by_lists(hood, part.begin, own));
  if (whole.bodies[b].kernel_volumes) {
    around.kernel_sum = kernel_sums(m.position, hood, spacing, part.begin);
  }
}

/// `check_masses` of own phyxels, by their numbers in the body.
void check_own_masses(const BodyRequest& request, const LocalModel& local, const Part& part,
                      const Masses& masses) {
  for (Index i = part.begin; i < part.end; ++i) {
    if (!owns(local, static_cast<std::size_t>(i))) continue;
    const auto k = static_cast<std::size_t>(i - part.begin);
    check_mass(request, local.phyxels[i].number, masses.mass[k], masses.volume[k]);
  }
}

/// Of own phyxels. Others' follow from sums that only their owners have, if they are the
/// kernel's.
void find_masses(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  std::vector<ExactSum> sums(whole.bodies.size());
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    if (!whole.bodies[b].kernel_volumes) continue;
    const Part& part = m.parts[b];
    sums[b] = added_up<ExactSum>(part.begin, part.end, [&](ExactSum& sum, Index i) {
      if (!owns(local, static_cast<std::size_t>(i))) return;
      sum.add(local.around[b].kernel_sum[i - part.begin]);
    });
  }
  std::vector<ExactSum*> all;
  for (ExactSum& sum : sums) all.push_back(&sum);
  total(setup.ranks, all);
  std::vector<Masses> made;
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    const Part& part = m.parts[b];
    const double density = setup.scene.bodies[b].material.density;
    Masses masses =
        whole.bodies[b].kernel_volumes
            ? kernel_masses(values_of(local, part, &MigratingPhyxel::spacing),
                            local.around[b].kernel_sum, sums[b].value() / whole.bodies[b].size,
                            density)
            : geometric_masses(values_of(local, part, &MigratingPhyxel::volume), density);
    made.push_back(std::move(masses));
  }
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      check_own_masses(setup.scene.bodies[b], local, m.parts[b], made[b]);
    }
  });
  for (Masses& masses : made) {
    extend(m.mass, std::move(masses.mass));
    extend(m.volume, std::move(masses.volume));
  }
}

void describe_parts(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  std::vector<BodySums> sums(whole.bodies.size());
  std::vector<ListLengths> lists(whole.bodies.size());
  std::vector<ExactSum*> all;
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    const BodyRequest& request = setup.scene.bodies[b];
    Part& part = m.parts[b];
    part.name = request.name;
    part.material = request.material;
    part.material.law = law_of(request, request.material);
    part.material.hourglass = hourglass_of(request);
    part.neighbourhood = in_words(request.neighbourhood);
    part.kernel_volumes = whole.bodies[b].kernel_volumes;
    part.size = whole.bodies[b].size;
    part.surfels = static_cast<Index>(whole.surfaces[b].position.size());
    part.origin = whole.bodies[b].origin;
    part.farthest = whole.boxes[b].farthest();
    sums[b] = added_up<BodySums>(part.begin, part.end, [&](BodySums& sum, Index i) {
      if (owns(local, static_cast<std::size_t>(i))) {
        sum.add(m.mass[i], m.volume[i], m.position[i]);
      }
    });
    Offset pairs = 0;
    Index fewest = whole.bodies[b].size, most = 0;
#pragma omp parallel for schedule(static) reduction(+ : pairs) reduction(min : fewest) \
    reduction(max : most)
    for (Index i = part.begin; i < part.end; ++i) {
      if (!owns(local, static_cast<std::size_t>(i))) continue;
      const Index length = local.around[b].length[i - part.begin];
      pairs += length;
      fewest = std::min(fewest, length);
      most = std::max(most, length);
    }
    lists[b] = {pairs, fewest, most};
    BodySums& s = sums[b];
    all.insert(all.end(), {&s.mass, &s.volume, &s.moment.x, &s.moment.y, &s.moment.z});
  }
  total(setup.ranks, all);
  const std::vector<ListLengths> of_ranks = setup.ranks.gathered(std::span(std::as_const(lists)));
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    Part& part = m.parts[b];
    sums[b].tell(part);
    part.lists.fewest = whole.bodies[b].size;
    for (std::size_t k = b; k < of_ranks.size(); k += whole.bodies.size()) {
      part.lists.pairs += of_ranks[k].pairs;
      part.lists.fewest = std::min(part.lists.fewest, of_ranks[k].fewest);
      part.lists.most = std::max(part.lists.most, of_ranks[k].most);
    }
  }
}

void add_boundary(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  std::vector<BoundaryChoice> choices(whole.bodies.size());
  std::vector<std::int64_t> counts;
  std::vector<ExactSum> masses;
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      if (selections_of(setup.scene.bodies[b]).empty()) continue;
      const Part& part = m.parts[b];
      const std::span<const MigratingPhyxel> here = of_part(local.phyxels, part);
      Cloud cloud;
      cloud.position = tabulated(here.size(), [&](std::size_t k) { return here[k].position; });
      auto number = tabulated(here.size(), [&](std::size_t k) { return here[k].number; });
      for (const std::string& name : whole.bodies[b].regions) cloud.regions[name];
      for (std::size_t r = 0; r < whole.bodies[b].used_regions; ++r) {
        std::vector<Index>& region = cloud.regions[whole.bodies[b].regions[r]];
        for (std::size_t k = 0; k < here.size(); ++k) {
          if (here[k].regions >> r & 1) region.push_back(static_cast<Index>(k));
        }
      }
      BoundaryChoice& choice = choices[b];
      // No phyxel here: an empty list of numbers would mean all.
      if (number.empty()) number.push_back(whole.bodies[b].size);
      choice = naming(setup.scene.bodies[b], [&] {
        return choose_boundary(setup.scene.bodies[b], cloud, number, whole.bodies[b].size);
      });
      BoundaryChoice own = choice;
      for (std::vector<Index>& chosen : own.chosen) {
        std::erase_if(chosen, [&](Index i) {
          return !owns(local, static_cast<std::size_t>(part.begin + i));
        });
      }
      for (const std::int64_t count : own.counts()) counts.push_back(count);
      for (const ExactSum& mass : own.loaded_masses(m, part.begin)) masses.push_back(mass);
    }
  });
  setup.ranks.add(counts);
  std::vector<ExactSum*> sums;
  for (ExactSum& mass : masses) sums.push_back(&mass);
  total(setup.ranks, sums);
  setup.ranks.collectively([&] {
    auto count = counts.begin();
    auto mass = masses.begin();
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      const BodyRequest& request = setup.scene.bodies[b];
      const auto entries = static_cast<std::ptrdiff_t>(choices[b].chosen.size());
      naming(request, [&] {
        choices[b].refuse_empty(request, {count, count + entries}, whole.boxes[b]);
      });
      count += entries;
      std::vector<double> loaded;
      for (std::size_t l = 0; l < request.loads.size(); ++l) loaded.push_back((mass++)->value());
      naming(request, [&] { choices[b].add_to(m, request, m.parts[b].begin, loaded); });
    }
  });
}

/// Of own phyxels, by their numbers in the whole; then of all ranks.
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

void complete_model(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  m.gravity = setup.scene.gravity;
  find_moments(m);
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      collect_ghost_neighbours(setup, whole, local, b);
    }
  });
  find_masses(setup, whole, local);
  describe_parts(setup, whole, local);
  add_boundary(setup, whole, local);
  gather_degenerate(setup, whole, local);
  add_surfels(setup, whole, local);
  std::size_t surfels = 0;
  for (const Surface& surface : whole.surfaces) surfels += surface.position.size();
  m.warnings = whole.warnings;
  add_warnings(m, surfels);
}

}  // namespace phyxel
