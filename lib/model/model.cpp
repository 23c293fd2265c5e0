#include "phyxel/model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "model/assembly.hpp"
#include "model/box.hpp"
#include "model/closing_areas.hpp"
#include "model/closure.hpp"
#include "model/contact.hpp"
#include "model/device_setup.hpp"
#include "model/following.hpp"
#include "model/fracture.hpp"
#include "model/growing_arrays.hpp"
#include "model/host_memory.hpp"
#include "model/inclusions.hpp"
#include "model/neighbour_search.hpp"
#include "phyxel/error.hpp"
#include "scene/scene_error.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

template <class T>
void append(std::vector<T>& to, const std::vector<T>& values) {
  to.insert(to.end(), values.begin(), values.end());
}

ListLengths lengths_of(const Csr& lists, Index begin, Index end) {
  ListLengths lengths;
  if (begin == end) return lengths;
  lengths.fewest = lengths.most = lists.length(begin);
  for (Index i = begin; i < end; ++i) {
    lengths.pairs += lists.length(i);
    lengths.fewest = std::min(lengths.fewest, lists.length(i));
    lengths.most = std::max(lengths.most, lists.length(i));
  }
  return lengths;
}

/// `Part::pair_length` of a body. @param support of its phyxels [m]
double pair_length_of(const NeighbourhoodRule& rule, std::span<const double> support) {
  return rule.pairwise() && !support.empty() ? median_of(support) : 0;
}

/// What a survey tells, found here along with the lists.
Survey survey_with_lists(const Cloud& cloud, const BodyRequest& request, bool kernel_volumes,
                         Neighbourhood& hood) {
  Survey survey;
  const NeighbourhoodRule& rule = request.neighbourhood;
  survey.spacing = mean_spacing(cloud.position, rule.nearest);
  hood = rule.pairwise()
             ? find_neighbours(cloud.position, graded_spacing(survey.spacing, cloud.spacing), rule)
             : find_neighbours(cloud.position, survey.spacing, rule);
  separate(hood, cloud.position, walls_of(request, cloud), pair_length_of(rule, hood.support));
  if (kernel_volumes) {
    survey.kernel_sum = kernel_sums(cloud.position, hood, survey.spacing, rule.pairwise());
  }
  survey.support = hood.support;
  survey.lists = lengths_of(hood.neighbours, 0, hood.neighbours.rows());
  return survey;
}

/// A surveyor's device finds neighbours within one support of unsorted phyxels, and no more.
/// @param closes true if the device closes gradients, too
/// @throws InputError if a body needs lists on the host
void check_surveyable(const BodyRequest& request, const Cloud& cloud, bool kernel_volumes,
                      bool closes) {
  if (!closes && may_close(request, cloud.surface, cloud.lattice, kernel_volumes)) {
    throw InputError(fmt::format(
        "{}: body \"{}\" has closed gradients (closure = {}), which are found from lists of "
        "neighbours on the host: allowed is a model built without a surveyor, or closure = 0",
        request.where, request.name,
        request.closure ? fmt::format("{:g}", *request.closure) : "\"auto\""));
  }
  refuse_pairs_surveyed(request, request.neighbourhood);
  if (!walls_of(request, cloud).regions.empty()) {
    throw InputError(fmt::format(
        "{}: a support of body \"{}\" ends inside the body, and its phyxels are parted from others "
        "in lists of neighbours on the host: allowed is a model built without a surveyor",
        request.where, request.name));
  }
  if (request.fracture || !request.notches.empty()) {
    throw InputError(fmt::format(
        "{}: body \"{}\" has {}, by which pairs break in lists of neighbours on the host: allowed "
        "is a model built without a surveyor",
        request.where, request.name, request.fracture ? "fracture" : "notches"));
  }
  if (!request.inclusions.empty()) {
    refuse_inclusions(request, "which are numbered on the host",
                      "a model built without a surveyor");
  }
}

/// Checks that a surveyor has answered for each of n phyxels.
/// @throws InputError naming the array, its value, and what is allowed
void check_survey(const Survey& survey, Index n, bool kernel_volumes) {
  const auto refuse = [](const std::string& fault) {
    throw InputError("survey of a device: " + fault);
  };
  const auto check = [&](const char* name, const std::vector<double>& values, bool wanted) {
    const auto size = static_cast<std::size_t>(wanted ? n : 0);
    if (wanted && values.size() != size) {
      refuse(fmt::format("{} has {} values for {} phyxels; allowed: one for each", name,
                         values.size(), size));
    }
    for (std::size_t i = 0; i < size; ++i) {
      if (values[i] >= 0 && std::isfinite(values[i])) continue;
      refuse(fmt::format("{} of phyxel {} is {}; allowed: >= 0, finite", name, i, values[i]));
    }
  };
  check("support", survey.support, true);
  check("spacing", survey.spacing, kernel_volumes);
  check("kernel_sum", survey.kernel_sum, kernel_volumes);
  const Degenerate& found = survey.degenerate;
  for (const auto* list : {&found.isolated, &found.collinear, &found.coplanar, &found.coincident}) {
    for (const Index i : *list) {
      if (i >= 0 && i < n) continue;
      refuse(fmt::format("phyxel {} is degenerate; allowed: 0 to {}", i, n - 1));
    }
  }
}

/// Adds the neighbour lists of a body, unless a surveyor leaves the lists to its device, and
/// returns the neighbour summary. @param surveyor null: the host searches
Survey add_neighbours(Model& model, const BodyRequest& request, const Cloud& cloud,
                      const Surveyor* surveyor, bool kernel_volumes) {
  const Index shift = model.size();
  if (surveyor) {
    Survey survey = in_stage("neighbours", [&] {
      return (*surveyor)(cloud.position, request.neighbourhood, kernel_volumes);
    });
    check_survey(survey, static_cast<Index>(cloud.position.size()), kernel_volumes);
    if (request.neighbourhood.one_sided()) model.neighbourhood.symmetric = false;
    append(model.degenerate, survey.degenerate, shift);
    return survey;
  }
  Neighbourhood hood;
  Survey survey = survey_with_lists(cloud, request, kernel_volumes, hood);
  append_lists(model.neighbourhood, std::move(hood), shift);
  return survey;
}

/// Masses and volumes of the phyxels of a body, by its volume rule and the densities of its
/// materials.
Masses masses_of(const BodyRequest& request, const Cloud& cloud, const Survey& survey,
                 std::span<const MaterialGroup> groups, bool kernel_volumes) {
  const double density = request.material.density;
  ExactSum kernel_sum;
  for (const double w : survey.kernel_sum) kernel_sum.add(w);
  Masses masses =
      kernel_volumes
          ? kernel_masses(survey.spacing, survey.kernel_sum,
                          kernel_sum.value() / static_cast<double>(survey.spacing.size()), density)
          : geometric_masses(cloud.volume, density);
  for (const MaterialGroup& group : groups.subspan(1)) {
    give_density(masses, group.begin, group.end, group.material.density, density, kernel_volumes);
  }
  check_masses(request, masses);
  return masses;
}

/// Adds the surfels of a body, and the phyxels that carry each. @param support of the body's
/// phyxels [m]. @param shift the body's first phyxel in the model
void add_surfels(Surfels& surfels, const Cloud& cloud, std::span<const double> support,
                 Index shift) {
  const auto surfel_shift = static_cast<Index>(surfels.position.size());
  Index unreached = 0;
  if (!cloud.surface.position.empty()) {
    append_rows(surfels.carriers,
                phyxels_near(cloud.surface.position, cloud.position, support, &unreached), shift);
  }
  surfels.unreached += unreached;
  append(surfels.position, cloud.surface.position);
  append(surfels.normal, cloud.surface.normal);
  for (const Triangle& t : cloud.surface.triangle) {
    surfels.triangle.push_back({t[0] + surfel_shift, t[1] + surfel_shift, t[2] + surfel_shift});
  }
}

/// Adds a part for each material of a body whose phyxels, from `shift`, and surfels, from
/// `surfel_shift`, are the model's last. The first part has the surfels.
/// @returns the volume of the body [m³]
double add_parts(Model& model, const BodyRequest& request, std::span<const MaterialGroup> groups,
                 const Survey& survey, bool kernel_volumes, Index shift, Index surfel_shift) {
  BodySums whole;
  whole.add(model, shift, model.size());
  Part body;  // of all materials
  whole.tell(body);
  const double farthest = box_around(std::span(model.position).subspan(shift)).farthest();
  const double pair_length = pair_length_of(request.neighbourhood, survey.support);
  const Index number = model.parts.empty() ? 0 : model.parts.back().body + 1;
  const auto surfel_end = static_cast<Index>(model.surfels.position.size());
  for (const MaterialGroup& group : groups) {
    const Index surfel_begin = group.begin == 0 ? surfel_shift : surfel_end;
    Part& part = model.parts.emplace_back();
    part = {.name = group.name,
            .body = number,
            .begin = shift + group.begin,
            .end = shift + group.end,
            .surfel_begin = surfel_begin,
            .surfel_end = surfel_end,
            .material = group.material,
            .neighbourhood = in_words(request.neighbourhood),
            .lists = groups.size() == 1 ? survey.lists
                                        : lengths_of(model.neighbourhood.neighbours,
                                                     shift + group.begin, shift + group.end),
            .kernel_volumes = kernel_volumes,
            .size = group.end - group.begin,
            .surfels = surfel_end - surfel_begin};
    part.material.law = law_of(request, group.material);
    part.material.hourglass = hourglass_of(request);
    if (shift < model.size()) part.origin = model.position[shift];
    BodySums sums;
    sums.add(model, part.begin, part.end);
    sums.tell(part);
    part.centre = body.centre;
    part.farthest = farthest;
    part.pair_length = pair_length;
    if (pair_length > 0) {
      part.support_cubes =
          sum_of_cubes(std::span(model.neighbourhood.support).subspan(part.begin, part.size))
              .value();
    }
  }
  return body.volume;
}

/// Adds the fixed, moved, loaded and probed phyxels of a body, which its scene selects by the order
/// of `given`. @param sorted the cloud in the model's order; null: that of `given`
void add_boundary(Model& model, const BodyRequest& request, const Cloud& given,
                  const SortedCloud* sorted, Index shift) {
  BoundaryChoice choice =
      choose_boundary(request, given, {}, static_cast<Index>(given.position.size()));
  const Box box = box_around(given.position);
  if (!request.symmetries.empty()) {
    const BodyExtent extent =
        extent_of(box, given.surface, static_cast<Index>(given.position.size()));
    std::vector<double> spacing{extent.spacing};
    const auto begin = static_cast<std::size_t>(shift);
    if (model.parts.back().pair_length > 0) {
      spacing = tabulated(given.position.size(), [&](std::size_t i) {
        return local_spacing(request.neighbourhood, model.neighbourhood.support[begin + i]);
      });
    }
    const std::vector<PlaneCounts> counts = count_at_planes(
        request, spacing, std::span(model.position).subspan(begin, given.position.size()));
    choice.add_planes(request, given.position,
                      symmetry_planes(request, extent, counts, model.warnings));
  }
  if (sorted) choice.renumber(sorted->place);
  choice.refuse_empty(request, choice.counts(), box);
  choice.warn_of_few(request, choice.counts(), model.warnings);
  choice.warn_of_moved(request, given.cuts, model.warnings);
  choice.warn_of_gaps(request, given.cuts, box, model.warnings);
  const Vec3d origin = model.position[shift];
  choice.add_to(model, request, shift, choice.load_sums(model, shift, origin), origin,
                loaded_pieces(request, given.surface));
}

/// @param device without a survey: lists and moments are made here.
void add_body(Model& model, BodyRequest request, const Cloud& given, const DeviceSetup& device) {
  const Surveyor* const surveyor = device.survey ? &device.survey : nullptr;
  check_terms(request);
  check_cloud(request, given);
  request.neighbourhood = request.neighbourhood.resolved(!given.spacing.empty());
  std::optional<SortedCloud> sorted;
  if (!request.inclusions.empty()) sorted = sort_by_material(request, given);
  const Cloud& cloud = sorted ? sorted->cloud : given;
  // The most that a phyxel takes at any time. With its neighbour lists and the CPU's arrays:
  // measured in `phyxel run --dry-run` of a block of two million. Without:
  // its cloud, its share of the model and of two states.
  require_host_memory(
      fmt::format("body \"{}\"", request.name),
      static_cast<double>(model.size()) + static_cast<double>(cloud.position.size()),
      surveyor ? 300 : 950);
  const bool kernel_volumes =
      wants_kernel_volumes(request, !cloud.volume.empty(), cloud.position.size());
  if (surveyor) {
    check_surveyable(request, cloud, kernel_volumes, static_cast<bool>(device.close));
  }
  const Index shift = model.size();
  const auto surfel_shift = static_cast<Index>(model.surfels.position.size());
  const Survey survey = add_neighbours(model, request, cloud, surveyor, kernel_volumes);
  const std::vector<MaterialGroup> groups =
      sorted
          ? sorted->groups
          : material_groups(request, std::vector<std::int64_t>{std::ssize(cloud.position)}, {}, {});
  const Masses masses = masses_of(request, cloud, survey, groups, kernel_volumes);
  append(model.neighbourhood.support, survey.support);
  append(model.position, cloud.position);
  append(model.mass, masses.mass);
  append(model.volume, masses.volume);
  add_surfels(model.surfels, cloud, survey.support, shift);
  const double volume =
      add_parts(model, request, groups, survey, kernel_volumes, shift, surfel_shift);
  const double closure =
      closure_of(request, cloud.surface, cloud.lattice, model.size() - shift,
                 kernel_volumes ? std::nullopt : std::optional(volume), model.warnings);
  for (Part& part : std::span(model.parts).last(groups.size())) {
    part.closure = closure;
    part.automatic_closure = !request.closure;
  }
  add_boundary(model, request, given, sorted ? &*sorted : nullptr, shift);
  model.walls.push_back(walls_of(request, cloud));
  model.surfels.groups.push_back(cloud.surface.groups);
}

}  // namespace

std::span<const Triangle> Surfels::triangles_of(const Part& first_part) const {
  const auto before = [&](Index surfel) {
    return std::partition_point(triangle.begin(), triangle.end(),
                                [&](const Triangle& t) { return t[0] < surfel; });
  };
  return {before(first_part.surfel_begin), before(first_part.surfel_end)};
}

bool Degenerate::none() const {
  return isolated.empty() && collinear.empty() && coplanar.empty() && coincident.empty();
}

std::string Degenerate::describe() const {
  std::vector<std::string> kinds;
  const auto add = [&](const char* kind, const std::vector<Index>& which) {
    if (which.empty()) return;
    const std::size_t shown = std::min<std::size_t>(which.size(), 5);
    kinds.push_back(fmt::format(
        "{} {} ({}{})", which.size(), kind,
        fmt::join(which.begin(), which.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
        which.size() > shown ? ", ..." : ""));
  };
  add("isolated", isolated);
  add("with collinear neighbours", collinear);
  add("with coplanar neighbours", coplanar);
  add("coincident with another", coincident);
  return fmt::format("degenerate phyxels: {}", fmt::join(kinds, "; "));
}

namespace {

const Cloud& named_cloud(const BodyRequest& request, const std::map<std::string, Cloud>& named) {
  const std::string& name = request.source.cloud;
  if (const auto found = named.find(name); found != named.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& [known, cloud] : named) names.push_back(known);
  throw InputError(fmt::format("{}: key body.cloud: \"{}\" found{}; allowed: {}", request.where,
                               name, did_you_mean(name, names),
                               names.empty() ? "shape, mesh or file, as no clouds were passed"
                                             : fmt::format("{}", fmt::join(names, ", "))));
}

/// `use(request, cloud, copies)` of every body of the scene, its cloud in place, and how many more
/// bodies of the same source follow.
template <class Use>
void for_each_cloud(const Scene& scene, const std::map<std::string, Cloud>& named, Use&& use) {
  for (const SharedSource& source : shared_sources(scene)) {
    const BodyRequest& first = scene.bodies[source.bodies.front()];
    Cloud rest = naming(first, [&] {
      return first.source.cloud.empty() ? rest_cloud(source.from) : named_cloud(first, named);
    });
    std::size_t copies = source.bodies.size();
    for (const std::size_t b : source.bodies) {
      Cloud cloud = rest;
      rest.warnings.clear();  // once is enough
      place(cloud, scene.bodies[b]);
      use(scene.bodies[b], std::move(cloud), --copies);
    }
  }
}

/// Adds what needs all bodies of a model.
void finish(Model& model, const Scene& scene, const ClosingSearch& close) {
  add_tractions(model, scene);
  find_moments(model);
  close_gradients(model, close ? close : search_on_host);
  find_following(model);
  add_contact(model, scene);
  find_fracture(model, scene);
  add_warnings(model, model.surfels.position.size());
}

Model model_from_sources(const Scene& scene, const DeviceSetup& device) {
  validate(scene);
  Model model;
  model.gravity = scene.gravity;
  for_each_cloud(scene, {}, [&](const BodyRequest& request, const Cloud& cloud, std::size_t more) {
    append(model.warnings, cloud.warnings);
    const std::vector<std::size_t> before = sizes_of(model);
    naming(request, [&] { add_body(model, request, cloud, device); });
    reserve_for_copies(model, before, more);
  });
  finish(model, scene, device.close);
  return model;
}

Model model_from_clouds(const Scene& scene, std::span<const Cloud> clouds,
                        const DeviceSetup& device) {
  if (clouds.size() != scene.bodies.size()) {
    throw InputError(fmt::format("{} clouds for a scene of {} bodies: one each is allowed",
                                 clouds.size(), scene.bodies.size()));
  }
  validate(scene);
  Model model;
  model.gravity = scene.gravity;
  for (std::size_t b = 0; b < clouds.size(); ++b) {
    append(model.warnings, clouds[b].warnings);
    naming(scene.bodies[b], [&] { add_body(model, scene.bodies[b], clouds[b], device); });
  }
  finish(model, scene, device.close);
  return model;
}

}  // namespace

std::vector<Cloud> make_clouds(const Scene& scene, const std::map<std::string, Cloud>& named) {
  std::vector<Cloud> clouds;
  naming(scene, [&] {
    for_each_cloud(scene, named, [&](const BodyRequest&, Cloud&& cloud, std::size_t) {
      clouds.push_back(std::move(cloud));
    });
  });
  return clouds;
}

const Model& Model::with_lists() const {
  if (!has_lists()) {
    throw InputError(
        "the neighbour lists of this model were left to the device that surveyed it: allowed is a "
        "backend on that device, or a model built without a surveyor");
  }
  return *this;
}

bool Model::has_inclusions() const {
  return !parts.empty() && parts.back().body + 1 < static_cast<Index>(parts.size());
}

std::span<const Part> Model::parts_of_body(const Part& part) const {
  auto first = parts.begin() + (&part - parts.data()), last = first + 1;
  while (first != parts.begin() && (first - 1)->body == part.body) --first;
  while (last != parts.end() && last->body == part.body) ++last;
  return {first, last};
}

Index Model::global_surfel_count() const {
  if (!share) return static_cast<Index>(surfels.position.size());
  Index sum = 0;
  for (const Part& part : parts) sum += part.surfels;
  return sum;
}

Offset Model::pairs() const {
  Offset sum = 0;
  for (const Part& part : parts) sum += part.lists.pairs;
  return sum;
}

Model build_model(const Scene& scene) { return build_model(scene, DeviceSetup{}); }
Model build_model(const Scene& scene, std::span<const Cloud> clouds) {
  return build_model(scene, clouds, DeviceSetup{});
}
Model build_model(const Scene& scene, const Surveyor& survey) {
  return build_model(scene, DeviceSetup{survey, {}});
}
Model build_model(const Scene& scene, std::span<const Cloud> clouds, const Surveyor& survey) {
  return build_model(scene, clouds, DeviceSetup{survey, {}});
}
Model build_model(const Scene& scene, const DeviceSetup& device) {
  return naming(scene, [&] { return model_from_sources(scene, device); });
}
Model build_model(const Scene& scene, std::span<const Cloud> clouds, const DeviceSetup& device) {
  return naming(scene, [&] { return model_from_clouds(scene, clouds, device); });
}

}  // namespace phyxel
