#include "model/assembly.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "model/closing_areas.hpp"
#include "model/fracture.hpp"
#include "model/parts.hpp"
#include "model/row_moment.hpp"
#include "model/selection.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/custom_law.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/moment.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {

static constexpr double degree = std::numbers::pi / 180;

Motion motion_along(const MotionRequest& request) {
  return {.phyxels = {},
          .displacement = request.displacement,
          .rotation = degree * request.rotation,
          .about = request.about,
          .duration = request.duration,
          .velocity = request.velocity,
          .amplitude = request.amplitude,
          .frequency = request.frequency};
}

Mat3d rotation_by(Vec3d radians) {
  const double angle = norm(radians);
  if (angle == 0) return identity<double>();
  const Vec3d a = normalised(radians);
  Mat3d k;
  k(0, 1) = -a.z, k(0, 2) = a.y, k(1, 0) = a.z, k(1, 2) = -a.x, k(2, 0) = -a.y, k(2, 1) = a.x;
  return identity<double>() + std::sin(angle) * k + (1 - std::cos(angle)) * (k * k);
}

Mat3d rotation_of(const BodyRequest& request) { return rotation_by(degree * request.rotation); }

void place(std::vector<Vec3d>& points, const BodyRequest& request) {
  const Mat3d rotation = rotation_of(request);
#pragma omp parallel for schedule(static)
  for (Vec3d& p : points) p = rotation * (request.scale * p) + request.translation;
}

void place(Cloud& cloud, const BodyRequest& request) {
  const Mat3d rotation = rotation_of(request);
  place(cloud.position, request);
  for (double& v : cloud.volume) v *= request.scale * request.scale * request.scale;
  for (double& s : cloud.spacing) s *= request.scale;
  place_cuts(cloud, request);
  place(cloud.surface.position, request);
  for (Vec3d& n : cloud.surface.normal) n = rotation * n;
}

bool needs_lists_on_host(const BodyRequest& request) {
  const bool may_be_cut = has_rooms(source_of(request));
  const NeighbourhoodRule& rule = request.neighbourhood;
  // A cloud of the caller's is not known here.
  const bool may_have_spacing = request.source.grading || !request.source.cloud.empty() ||
                                (!request.source.file.empty() && has_spacing(request.source.file));
  const bool pairwise = rule.resolved(may_have_spacing).pairwise();
  const bool breaks = request.fracture.has_value() || !request.notches.empty();
  return !request.inclusions.empty() || breaks || may_be_cut || pairwise;
}

bool needs_lists_on_host(const BodyRequest& request, const Cloud& cloud) {
  return needs_lists_on_host(request) ||
         request.neighbourhood.resolved(!cloud.spacing.empty()).pairwise();
}

double hourglass_of(const BodyRequest& request) {
  return request.material.hourglass.value_or(default_hourglass(request));
}

void check_terms(const BodyRequest& request) {
  const auto check_law = [](const Material& material) {
    if (material.custom_law) check_custom_law(*material.custom_law, material.young);
  };
  check_law(request.material);
  for (const InclusionRequest& inclusion : request.inclusions) check_law(inclusion.material);
  check_fracture(request);
  const NeighbourhoodRule& rule = request.neighbourhood;
  if (rule.support == NeighbourhoodRule::Support::pairwise &&
      (rule.max_neighbours || rule.radius)) {
    throw InputError(fmt::format(
        "{}: body \"{}\" has neighbours.support = \"pairwise\" and {}; allowed: only one",
        request.where, request.name, rule.radius ? "a radius" : "max_neighbours"));
  }
  if (!request.neighbourhood.one_sided()) return;
  const auto refuse_if = [&](double value, const char* term, const char* key) {
    if (!(value > 0)) return;
    throw InputError(fmt::format(
        "{}: body \"{}\" has {} ({:g}), which needs symmetric lists: allowed are "
        "neighbours.support = \"uniform\" or \"pairwise\" without max_neighbours, or {} = 0",
        request.where, request.name, term, value, key));
  };
  refuse_if(hourglass_of(request), "hourglass control", "hourglass");
  refuse_if(request.closure.value_or(0), "closed gradients", "closure");
}

void refuse_pairs_surveyed(const BodyRequest& request, const NeighbourhoodRule& rule) {
  if (!rule.pairwise()) return;
  throw InputError(fmt::format(
      "{}: body \"{}\" has supports of pairs (neighbours.support = \"pairwise\"), whose lists are "
      "made on the host: allowed is a model built without a surveyor, or \"uniform\"",
      request.where, request.name));
}

bool wants_kernel_volumes(const BodyRequest& request, bool has_volumes, std::size_t phyxels) {
  const bool kernel = request.volume_rule == VolumeRule::kernel ||
                      (request.volume_rule == VolumeRule::automatic && !has_volumes);
  if (kernel && phyxels < 2) {
    throw InputError(
        fmt::format("{}: body \"{}\" has a single phyxel: the kernel rule cannot tell its volume",
                    request.where, request.name));
  }
  if (!kernel && !has_volumes) {
    throw InputError(fmt::format(
        "{}: body \"{}\" carries no volumes, so volumes = \"geometry\" is impossible: allowed "
        "\"kernel\" or \"automatic\"",
        request.where, request.name));
  }
  return kernel;
}

std::vector<double> kernel_sums(std::span<const Vec3d> position, const Neighbourhood& hood,
                                const std::vector<double>& spacing, bool pairwise, Index begin) {
  const auto cube = [&](Index i) {
    const double r = spacing[i - begin];
    return r * r * r;
  };
  const Index end = begin + static_cast<Index>(spacing.size());
  std::vector<double> sums(spacing.size());
#pragma omp parallel for
  for (Index i = begin; i < end; ++i) {
    const double h = hood.support[i];
    double& sum = sums[i - begin];
    sum = h > 0 ? cube(i) * weight(0, h) : 0;
    for (const Index j : hood.neighbours.row(i)) {
      const double of_pair = pairwise ? pair_support(h, hood.support[j]) : h;
      sum += cube(j) * weight(norm(position[j] - position[i]), of_pair);
    }
  }
  return sums;
}

Masses kernel_masses(const std::vector<double>& spacing, const std::vector<double>& kernel_sum,
                     double mean, double density) {
  const std::size_t n = spacing.size();
  Masses result{std::vector<double>(n), std::vector<double>(n)};
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < n; ++i) {
    const double r = spacing[i];
    result.mass[i] = r * r * r * density / mean;
    result.volume[i] = result.mass[i] / (kernel_sum[i] / mean * density);
  }
  return result;
}

void check_mass(const BodyRequest& request, Index i, double mass, double volume) {
  if (mass > 0 && volume > 0 && std::isfinite(mass) && std::isfinite(volume)) return;
  throw InputError(fmt::format(
      "{}: phyxel {} of body \"{}\" has a mass of {:g} kg and a volume of {:g} m^3 (does it lie "
      "where others lie?); allowed: both > 0, finite",
      request.where, i, request.name, mass, volume));
}

void check_masses(const BodyRequest& request, const Masses& masses) {
  for (std::size_t i = 0; i < masses.mass.size(); ++i) {
    check_mass(request, static_cast<Index>(i), masses.mass[i], masses.volume[i]);
  }
}

Masses geometric_masses(const std::vector<double>& volume, double density) {
  return {tabulated(volume.size(), [&](std::size_t i) { return volume[i] * density; }), volume};
}

void give_density(Masses& masses, Index begin, Index end, double density, double own_density,
                  bool kernel_volumes) {
  const double ratio = density / own_density;
  for (Index i = begin; i < end; ++i) {
    masses.mass[i] = kernel_volumes ? masses.mass[i] * ratio : masses.volume[i] * density;
  }
}

std::string in_words(const NeighbourhoodRule& rule) {
  std::string words;
  if (rule.radius) {
    words = fmt::format("support radius {:g} m", *rule.radius);
    // Kernel volumes still follow from the nearest.
    if (rule.nearest != NeighbourhoodRule{}.nearest) {
      words += fmt::format(", {} nearest", rule.nearest);
    }
  } else {
    words = fmt::format("{} support, {:g} x the mean distance to the {} nearest",
                        rule.pairwise()  ? "pairwise"
                        : rule.differs() ? "adaptive"
                                         : "uniform",
                        rule.factor, rule.nearest);
  }
  if (rule.max_neighbours) words += fmt::format(", at most {} neighbours", *rule.max_neighbours);
  return words;
}

void append_rows(Csr& to, Csr&& rows, Index shift) {
  if (shift == 0 && to.rows() == 0) {
    to = std::move(rows);
    return;
  }
  const std::size_t rows_before = to.offsets.size(), entries_before = to.indices.size();
  const Offset base = to.entries();
  to.offsets.resize(rows_before + rows.offsets.size() - 1);
  to.indices.resize(entries_before + rows.indices.size());
#pragma omp parallel for schedule(static)
  for (std::size_t r = 1; r < rows.offsets.size(); ++r) {
    to.offsets[rows_before + r - 1] = base + rows.offsets[r];
  }
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < rows.indices.size(); ++k) {
    to.indices[entries_before + k] = rows.indices[k] + shift;
  }
}

void append_lists(Neighbourhood& all, Neighbourhood&& hood, Index shift) {
  if (all.symmetric && !hood.symmetric) {
    all.inverse_lists = all.neighbours;
    all.symmetric = false;
  }
  if (!all.symmetric) {
    append_rows(all.inverse_lists,
                hood.symmetric ? Csr(hood.neighbours) : std::move(hood.inverse_lists), shift);
  }
  append_rows(all.neighbours, std::move(hood.neighbours), shift);
}

void append(Degenerate& to, const Degenerate& found, Index shift) {
  const auto append_shifted = [&](std::vector<Index>& all, const std::vector<Index>& some) {
    for (const Index i : some) all.push_back(i + shift);
  };
  append_shifted(to.isolated, found.isolated);
  append_shifted(to.collinear, found.collinear);
  append_shifted(to.coplanar, found.coplanar);
  append_shifted(to.coincident, found.coincident);
}

void find_moments(Model& model) {
  if (!model.has_lists()) return;
  Stage stage("moments");
  const Index n = model.size();
  model.inverse_moment.resize(static_cast<std::size_t>(n));
  model.moment_offset.resize(static_cast<std::size_t>(n));
  std::vector<signed char> rank(static_cast<std::size_t>(n));
  std::vector<char> coincident(static_cast<std::size_t>(n), 0);
  constexpr Index part = 4096;
  stage.expect(static_cast<std::size_t>(n / part));
#pragma omp parallel for schedule(static)
  for (Index i = 0; i < n; ++i) {
    const double h = model.neighbourhood.support[i];
    const RowMoment sums = moment_of_row(model, i, [&](Index j) {
      const Vec3d x = model.position[j] - model.position[i];
      if (dot(x, x) <= 1e-20 * h * h) coincident[i] = 1;
      return true;
    });
    const PseudoInverse<double> inverse = pseudo_inverse(sums.moment);
    model.inverse_moment[i] = inverse.matrix;
    model.moment_offset[i] = sums.offset;
    rank[i] = static_cast<signed char>(inverse.rank);
    if ((i + 1) % part == 0) stage.count();
  }
  const std::vector<char> supported = supported_phyxels(model);
  for (Index i = 0; i < n; ++i) {
    if (rank[i] == 3 && !coincident[i]) continue;
    // A phyxel that moves with all its neighbours has nothing to resist.
    const std::span<const Index> beside = model.neighbourhood.neighbours.row(i);
    if (supported[i] &&
        std::all_of(beside.begin(), beside.end(), [&](Index j) { return supported[j] != 0; })) {
      continue;
    }
    if (coincident[i]) model.degenerate.coincident.push_back(i);
    if (rank[i] == 0) model.degenerate.isolated.push_back(i);
    if (rank[i] == 1) model.degenerate.collinear.push_back(i);
    if (rank[i] == 2) model.degenerate.coplanar.push_back(i);
  }
  stage.finish();
}

void add_warnings(Model& model, std::size_t surfels) {
  if (!model.degenerate.none()) {
    const char* more = model.body_contact.acts() ? "; bodies may pass single layers" : "";
    model.warnings.push_back(model.degenerate.describe() +
                             "; such phyxels resist only in the directions their neighbours span. "
                             "A larger neighbours.factor, or support = \"adaptive\", helps" +
                             more);
  }
  if (model.surfels.unreached > 0) {
    model.warnings.push_back(
        fmt::format("{} of {} surfels lie outside every phyxel's support and follow the nearest "
                    "phyxel; more phyxels or a larger neighbours.factor reach them",
                    model.surfels.unreached, surfels));
  }
}

ExactSum sum_of_cubes(std::span<const double> support) {
  ExactSum sum;
  for (const double h : support) sum.add(h * h * h);
  return sum;
}

void BodySums::tell(Part& part) const {
  part.mass = mass.value();
  part.volume = volume.value();
  if (part.mass > 0) part.centre = moment.value() / part.mass;
}

std::vector<const Selection*> selections_of(const BodyRequest& request) {
  std::vector<const Selection*> all;
  for (const FixRequest& fix : request.fixed) all.push_back(&fix.select);
  for (const MotionRequest& motion : request.motions) all.push_back(&motion.select);
  for (const LoadRequest& load : request.loads) all.push_back(&load.select);
  for (const ProbeRequest& probe : request.probes) {
    if (probe.select) all.push_back(&*probe.select);
  }
  return all;
}

std::vector<Axes> axes_of_supports(const BodyRequest& request) {
  std::vector<Axes> axes;
  for (const FixRequest& fix : request.fixed) axes.push_back(fix.axes);
  for (const MotionRequest& motion : request.motions) axes.push_back(motion.axes);
  return axes;
}

BoundaryChoice choose_boundary(const BodyRequest& request, const Cloud& cloud,
                               std::span<const Index> number, Index size) {
  BoundaryChoice choice = BoundaryChoice::empty_of(request);
  std::vector<char> moved(cloud.position.size(), 0);  // a bit for each axis
  const std::vector<Axes> axes = axes_of_supports(request);
  const SomePhyxels here{cloud, number, size};
  const std::vector<const Selection*> selections = selections_of(request);
  for (const Selection* selection : selections) {
    choice.chosen.push_back(select(*selection, here, request, choice.faces_of_next()));
  }
  choice.share_boundaries(request, here);
  for (std::size_t entry = 0; entry < choice.first_load; ++entry) {
    const int bits = axes[entry].bits();
    for (const Index i : choice.chosen[entry]) {
      if (moved[i] & bits) {
        std::size_t first = 0;
        while (!(axes[first].bits() & bits) ||
               !std::ranges::binary_search(choice.chosen[first], i)) {
          ++first;
        }
        throw InputError(fmt::format(
            "{}: phyxel {} of body \"{}\" is already fixed or moved by {}; allowed: one motion for "
            "each of its axes",
            selections[entry]->where, here.number_of(i), request.name,
            name_of_support(request, first)));
      }
      moved[i] = static_cast<char>(moved[i] | bits);
    }
  }
  return choice;
}

void BoundaryChoice::add_planes(const BodyRequest& request, std::span<const Vec3d> position,
                                std::vector<SymmetryPlane> symmetry) {
  planes = std::move(symmetry);
  std::vector<char> moved(planes.empty() ? 0 : position.size(), 0);  // a bit for each axis
  const std::vector<Axes> axes = axes_of_supports(request);
  for (std::size_t entry = 0; entry < axes.size() && !planes.empty(); ++entry) {
    for (const Index i : chosen[entry]) moved[i] = static_cast<char>(moved[i] | axes[entry].bits());
  }
  for (const SymmetryPlane& plane : planes) {
    const char bit = plane.axes().bits();
    std::vector<Index>& held = at_plane.emplace_back();
    for (std::size_t i = 0; i < position.size(); ++i) {
      if ((moved[i] & bit) || !plane.holds(position[i])) continue;
      held.push_back(static_cast<Index>(i));
      moved[i] = static_cast<char>(moved[i] | bit);
    }
  }
}

void BoundaryChoice::renumber(const std::vector<Index>& place) {
  for (auto* list : {&chosen, &at_plane}) {
    for (std::vector<Index>& phyxels : *list) {
      for (Index& i : phyxels) i = place[i];
      std::sort(phyxels.begin(), phyxels.end());
    }
  }
}

std::vector<std::int64_t> BoundaryChoice::counts() const {
  std::vector<std::int64_t> counts;
  for (const auto* lists : {&chosen, &left}) {
    for (const std::vector<Index>& phyxels : *lists) {
      counts.push_back(static_cast<std::int64_t>(phyxels.size()));
    }
  }
  return counts;
}

std::vector<LoadSums> BoundaryChoice::load_sums(const Model& model, Index shift,
                                                Vec3d origin) const {
  std::vector<LoadSums> sums;
  for (std::size_t entry = first_load; entry < first_probe; ++entry) {
    LoadSums& sum = sums.emplace_back();
    for (const Index i : chosen[entry]) {
      sum.add(model.mass[shift + i], model.position[shift + i] - origin);
    }
  }
  return sums;
}

void BoundaryChoice::refuse_empty(const BodyRequest& request,
                                  const std::vector<std::int64_t>& counts, const Box& box) const {
  const std::vector<const Selection*> selections = selections_of(request);
  for (std::size_t entry = 0; entry < selections.size(); ++entry) {
    if (counts[entry] > 0) continue;
    const bool shares = entry < first_load && counts[chosen.size() + entry] > 0;
    refuse_selection(*selections[entry], request.name, box,
                     shares ? "; another support holds all that it would select: leave this entry "
                              "out, or let it select more"
                            : "");
  }
}

void BoundaryChoice::warn_of_few(const BodyRequest& request,
                                 const std::vector<std::int64_t>& counts,
                                 std::vector<std::string>& warnings) const {
  const std::vector<const Selection*> selections = selections_of(request);
  for (std::size_t entry = 0; entry < first_load; ++entry) {
    if (counts[entry] > 2 || !region_of(*selections[entry])) continue;
    const char* region = selections[entry]->box ? "box" : "ball";
    warnings.push_back(fmt::format(
        "body \"{}\", {}: only {} of its phyxels {} in the {}, and a body can turn about so few: a "
        "larger {}, or more phyxels, hold it",
        request.name, name_of_support(request, entry), counts[entry],
        counts[entry] == 1 ? "lies" : "lie", region, region));
  }
}

void BoundaryChoice::add_to(Model& model, const BodyRequest& request, Index shift,
                            const std::vector<LoadSums>& loaded, Vec3d origin,
                            const std::vector<std::optional<BodyPiece>>& pieces) const {
  auto entry = chosen.begin();
  const auto in_model = [&](std::vector<Index> phyxels) {
    for (Index& i : phyxels) i += shift;
    return phyxels;
  };
  const auto next = [&] { return in_model(*entry++); };
  const auto numbered = [](const char* kind, const auto& one, const auto& all) {
    return entry_name(kind, static_cast<std::size_t>(&one - all.data()));
  };
  for (const FixRequest& fix : request.fixed) {
    model.motions.push_back({.phyxels = next(),
                             .axes = fix.axes,
                             .body = request.name,
                             .set = numbered("fixed", fix, request.fixed)});
  }
  for (const MotionRequest& m : request.motions) {
    Motion motion = motion_along(m);
    motion.phyxels = next();
    motion.axes = m.axes;
    motion.body = request.name;
    motion.set = numbered("motion", m, request.motions);
    model.motions.push_back(std::move(motion));
  }
  for (std::size_t k = 0; k < planes.size(); ++k) {
    model.motions.push_back({.phyxels = in_model(at_plane[k]),
                             .axes = planes[k].axes(),
                             .body = request.name,
                             .set = entry_name("symmetry", k)});
  }
  for (std::size_t l = 0; l < request.loads.size(); ++l) {
    std::vector<Index> phyxels = next();
    model.loads.push_back(
        load_of(request, l, std::move(phyxels), model, loaded[l], origin, pieces[l]));
  }
  for (const ProbeRequest& probe : request.probes) {
    model.probes.push_back({.name = probe.name,
                            .body = request.name,
                            .points = probe.points,
                            .phyxels = probe.select ? next() : std::vector<Index>{},
                            .where = probe.where});
  }
}

}  // namespace phyxel
