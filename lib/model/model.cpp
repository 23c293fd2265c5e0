#include "phyxel/model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <numeric>

#include "exact_sum.hpp"
#include "model/host_memory.hpp"
#include "model/selection.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"

namespace phyxel {
namespace {

/// Rotation by |r| degrees about r (Rodrigues).
Mat3d rotation_matrix(Vec3d degrees) {
  const double angle = norm(degrees) * std::numbers::pi / 180;
  if (angle == 0) return identity<double>();
  const Vec3d a = normalised(degrees);
  Mat3d k;
  k(0, 1) = -a.z, k(0, 2) = a.y, k(1, 0) = a.z, k(1, 2) = -a.x, k(2, 0) = -a.y, k(2, 1) = a.x;
  return identity<double>() + std::sin(angle) * k + (1 - std::cos(angle)) * (k * k);
}

void place(Cloud& cloud, const BodyRequest& request) {
  const Mat3d rotation = rotation_matrix(request.rotation);
  const auto placed = [&](Vec3d p) { return rotation * (request.scale * p) + request.translation; };
  for (Vec3d& p : cloud.position) p = placed(p);
  for (double& v : cloud.volume) v *= request.scale * request.scale * request.scale;
  for (Vec3d& p : cloud.surface.position) p = placed(p);
  for (Vec3d& n : cloud.surface.normal) n = rotation * n;
}

struct Masses {
  std::vector<double> mass, volume;
  bool kernel = false;
};

bool wants_kernel_volumes(const Cloud& cloud, const BodyRequest& request) {
  const bool kernel = request.volume_rule == VolumeRule::kernel ||
                      (request.volume_rule == VolumeRule::automatic && cloud.volume.empty());
  if (kernel && cloud.position.size() < 2) {
    throw InputError(
        fmt::format("{}: body \"{}\" has a single phyxel: the kernel rule cannot tell its volume",
                    request.where, request.name));
  }
  if (!kernel && cloud.volume.empty()) {
    throw InputError(fmt::format(
        "{}: body \"{}\" carries no volumes, so volumes = \"geometry\" is impossible: allowed "
        "\"kernel\" or \"automatic\"",
        request.where, request.name));
  }
  return kernel;
}

/// r̄_i³ w_ii + Σ_j r̄_j³ w_ij.
std::vector<double> kernel_sums(const Cloud& cloud, const Neighbourhood& hood,
                                const std::vector<double>& spacing) {
  const auto cube = [&](std::size_t i) { return spacing[i] * spacing[i] * spacing[i]; };
  std::vector<double> sums(cloud.position.size());
#pragma omp parallel for
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const double h = hood.support[i];
    sums[i] = h > 0 ? cube(i) * weight(0, h) : 0;
    for (const Index j : hood.neighbours.row(static_cast<Index>(i))) {
      sums[i] += cube(j) * weight(norm(cloud.position[j] - cloud.position[i]), h);
    }
  }
  return sums;
}

/// The 2004 rule: m_i = s r̄_i³ ρ with s such that the mean kernel density Σ_j m_j w_ij is ρ
/// (the phyxel itself included), v_i = m_i / ρ_i. Source: Mueller et al. 2004, section 4.2.
Masses kernel_masses(const Survey& survey, double density) {
  const std::size_t n = survey.spacing.size();
  const std::vector<double>& relative = survey.kernel_sum;  // kernel density over ρ, for s = 1
  const double mean =
      std::accumulate(relative.begin(), relative.end(), 0.0) / static_cast<double>(n);
  Masses result{std::vector<double>(n), std::vector<double>(n), true};
  for (std::size_t i = 0; i < n; ++i) {
    const double r = survey.spacing[i];
    result.mass[i] = r * r * r * density / mean;
    result.volume[i] = result.mass[i] / (relative[i] / mean * density);
  }
  return result;
}

Masses geometric_masses(const Cloud& cloud, double density) {
  Masses result{std::vector<double>(cloud.volume.size()), cloud.volume, false};
  std::transform(cloud.volume.begin(), cloud.volume.end(), result.mass.begin(),
                 [&](double v) { return v * density; });
  return result;
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
    words =
        fmt::format("{} support, {:g} x the mean distance to the {} nearest",
                    rule.support == NeighbourhoodRule::Support::uniform ? "uniform" : "adaptive",
                    rule.factor, rule.nearest);
  }
  if (rule.max_neighbours) words += fmt::format(", at most {} neighbours", *rule.max_neighbours);
  return words;
}

void append(Csr& to, const Csr& rows, Index shift) {
  const Offset base = to.entries();
  for (std::size_t r = 1; r < rows.offsets.size(); ++r)
    to.offsets.push_back(base + rows.offsets[r]);
  to.indices.reserve(to.indices.size() + rows.indices.size());
  for (const Index j : rows.indices) to.indices.push_back(j + shift);
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& values) {
  to.insert(to.end(), values.begin(), values.end());
}

/// Moments A_i, their pseudo-inverses and the offsets b_i; notes what is degenerate.
void find_moments(Model& model) {
  if (!model.has_lists()) return;
  const Index n = model.size();
  model.inverse_moment.resize(static_cast<std::size_t>(n));
  model.moment_offset.resize(static_cast<std::size_t>(n));
  std::vector<signed char> rank(static_cast<std::size_t>(n));
  std::vector<char> coincident(static_cast<std::size_t>(n), 0);
#pragma omp parallel for schedule(static)
  for (Index i = 0; i < n; ++i) {
    Sym3d moment;
    Vec3d offset;
    const double h = model.neighbourhood.support[i];
    const double inverse_h_squared = 1 / (h * h);
    for (const Index j : model.neighbourhood.neighbours.row(i)) {
      const Vec3d x = model.position[j] - model.position[i];
      const double w = weight_shape(dot(x, x), inverse_h_squared);
      moment += moment_term(x, w);
      offset += w * x;
      if (dot(x, x) <= 1e-20 * h * h) coincident[i] = 1;
    }
    const PseudoInverse<double> inverse = pseudo_inverse(moment);
    model.inverse_moment[i] = inverse.matrix;
    model.moment_offset[i] = offset;
    rank[i] = static_cast<signed char>(inverse.rank);
  }
  for (Index i = 0; i < n; ++i) {
    if (coincident[i]) model.degenerate.coincident.push_back(i);
    if (rank[i] == 0) model.degenerate.isolated.push_back(i);
    if (rank[i] == 1) model.degenerate.collinear.push_back(i);
    if (rank[i] == 2) model.degenerate.coplanar.push_back(i);
  }
}

std::vector<Index> shifted(std::vector<Index> indices, Index shift) {
  for (Index& i : indices) i += shift;
  return indices;
}

Load make_load(const LoadRequest& request, const Model& model, const std::vector<Index>& phyxels) {
  Load load;
  load.phyxels = phyxels;
  load.total = request.force;
  load.density = request.force_density;
  load.ramp = request.ramp;
  double total_mass = 0;
  for (const Index i : phyxels) total_mass += model.mass[i];
  for (const Index i : phyxels) {
    load.force.push_back((model.mass[i] / total_mass) * request.force +
                         model.volume[i] * request.force_density);
  }
  return load;
}

/// Loads and motions of one body. A phyxel may follow only one motion.
void add_boundary(Model& model, const BodyRequest& request, const Cloud& cloud, Index shift) {
  std::vector<char> moved(cloud.position.size(), 0);
  const auto claim = [&](const Selection& selection) {
    const std::vector<Index> chosen = select(selection, cloud, request.name);
    for (const Index i : chosen) {
      if (moved[i]++) {
        throw InputError(fmt::format(
            "{}: phyxel {} of body \"{}\" is already fixed or moved by an earlier entry",
            selection.where, i, request.name));
      }
    }
    return shifted(chosen, shift);
  };
  for (const FixRequest& fix : request.fixed)
    model.motions.push_back({.phyxels = claim(fix.select)});
  for (const MotionRequest& m : request.motions) {
    model.motions.push_back({.phyxels = claim(m.select),
                             .displacement = m.displacement,
                             .duration = m.duration,
                             .velocity = m.velocity,
                             .amplitude = m.amplitude,
                             .frequency = m.frequency});
  }
  for (const LoadRequest& load : request.loads) {
    model.loads.push_back(
        make_load(load, model, shifted(select(load.select, cloud, request.name), shift)));
  }
}

/// What a survey tells, found here along with the lists.
Survey survey_with_lists(const Cloud& cloud, const BodyRequest& request, bool kernel_volumes,
                         Neighbourhood& hood) {
  Survey survey;
  survey.spacing = mean_spacing(cloud.position, request.neighbourhood.nearest);
  hood = find_neighbours(cloud.position, survey.spacing, request.neighbourhood);
  if (kernel_volumes) survey.kernel_sum = kernel_sums(cloud, hood, survey.spacing);
  survey.support = hood.support;
  survey.lists.pairs = hood.neighbours.entries();
  const Index rows = hood.neighbours.rows();
  if (rows > 0) survey.lists.fewest = survey.lists.most = hood.neighbours.length(0);
  for (Index i = 1; i < rows; ++i) {
    survey.lists.fewest = std::min(survey.lists.fewest, hood.neighbours.length(i));
    survey.lists.most = std::max(survey.lists.most, hood.neighbours.length(i));
  }
  return survey;
}

/// Inverse lists are stored for all bodies as soon as one body needs them.
void append_lists(Neighbourhood& all, const Neighbourhood& hood, Index shift) {
  if (all.symmetric && !hood.symmetric) {
    all.inverse_lists = all.neighbours;
    all.symmetric = false;
  }
  append(all.neighbours, hood.neighbours, shift);
  if (!all.symmetric) append(all.inverse_lists, hood.inverse(), shift);
}

void append(Degenerate& to, const Degenerate& found, Index shift) {
  append(to.isolated, shifted(found.isolated, shift));
  append(to.collinear, shifted(found.collinear, shift));
  append(to.coplanar, shifted(found.coplanar, shift));
  append(to.coincident, shifted(found.coincident, shift));
}

/// Mass, volume and centre of a body; its origin.
void weigh(Part& part, const Model& model) {
  if (part.begin == part.end) return;
  part.origin = model.position[part.begin];
  ExactSum mass, volume;
  ExactVector moment;
  for (Index i = part.begin; i < part.end; ++i) {
    mass.add(model.mass[i]);
    volume.add(model.volume[i]);
    moment.add(model.mass[i] * model.position[i]);
  }
  part.mass = mass.value();
  part.volume = volume.value();
  if (part.mass > 0) part.centre = moment.value() / part.mass;
}

/// @param surveyor null: lists and moments are made here.
void add_body(Model& model, const BodyRequest& request, const Cloud& cloud,
              const Surveyor* surveyor) {
  // The most that a phyxel takes at any time. With its neighbour lists and the CPU's arrays:
  // measured while the time step is found, in `phyxel check` of a block of two million. Without:
  // its cloud, its share of the model and of two states.
  require_host_memory(
      fmt::format("body \"{}\"", request.name),
      static_cast<double>(model.size()) + static_cast<double>(cloud.position.size()),
      surveyor ? 300 : 950);
  const Index shift = model.size();
  const auto surfel_shift = static_cast<Index>(model.surfels.position.size());
  const bool kernel_volumes = wants_kernel_volumes(cloud, request);
  Survey survey;
  if (surveyor) {
    survey = (*surveyor)(cloud.position, request.neighbourhood, kernel_volumes);
    if (request.neighbourhood.one_sided()) model.neighbourhood.symmetric = false;
    append(model.degenerate, survey.degenerate, shift);
  } else {
    Neighbourhood hood;
    survey = survey_with_lists(cloud, request, kernel_volumes, hood);
    append_lists(model.neighbourhood, hood, shift);
  }
  const Masses masses = kernel_volumes ? kernel_masses(survey, request.material.density)
                                       : geometric_masses(cloud, request.material.density);
  append(model.neighbourhood.support, survey.support);
  append(model.position, cloud.position);
  append(model.mass, masses.mass);
  append(model.volume, masses.volume);

  Surfels& surfels = model.surfels;
  Index unreached = 0;
  if (!cloud.surface.position.empty()) {
    append(surfels.carriers,
           phyxels_near(cloud.surface.position, cloud.position, survey.support, &unreached), shift);
  }
  surfels.unreached += unreached;
  append(surfels.position, cloud.surface.position);
  append(surfels.normal, cloud.surface.normal);
  for (const Triangle& t : cloud.surface.triangle) {
    surfels.triangle.push_back({t[0] + surfel_shift, t[1] + surfel_shift, t[2] + surfel_shift});
  }
  model.parts.push_back({.name = request.name,
                         .begin = shift,
                         .end = model.size(),
                         .surfel_begin = surfel_shift,
                         .surfel_end = static_cast<Index>(surfels.position.size()),
                         .material = request.material,
                         .neighbourhood = in_words(request.neighbourhood),
                         .lists = survey.lists,
                         .kernel_volumes = masses.kernel,
                         .size = model.size() - shift});
  weigh(model.parts.back(), model);
  add_boundary(model, request, cloud, shift);
}

/// What is done once all bodies are in.
void finish(Model& model) {
  find_moments(model);
  if (!model.degenerate.none()) {
    model.warnings.push_back(model.degenerate.describe() +
                             "; such phyxels resist only in the directions their neighbours span. "
                             "A larger neighbours.factor, or support = \"adaptive\", helps");
  }
  if (model.surfels.unreached > 0) {
    model.warnings.push_back(
        fmt::format("{} of {} surfels lie outside every phyxel's support and follow the nearest "
                    "phyxel; more phyxels or a larger neighbours.factor reach them",
                    model.surfels.unreached, model.surfels.position.size()));
  }
}

}  // namespace

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

Vec3d Motion::displacement_at(double time) const {
  const double s = duration > 0 ? std::clamp(time / duration, 0.0, 1.0) : 1.0;
  const double smoothstep = s * s * (3 - 2 * s);
  const double wave = std::sin(2 * std::numbers::pi * frequency * time);
  return smoothstep * displacement + time * velocity + wave * amplitude;
}

namespace {

/// The cloud of a source, before it is scaled and moved.
Cloud rest_cloud(const BodySource& source) {
  if (!source.file.empty()) return read_body(source.file);
  if (!source.mesh.empty()) {
    const Surface surface = read_mesh(source.mesh);
    try {
      return sample_surface(
          surface,
          {.phyxels = source.phyxels, .seed = source.seed, .relaxations = source.relaxations});
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", source.mesh.string(), error.what()));
    }
  }
  ShapeRequest shape = source.shape;
  shape.seed = source.seed;
  if (shape.spacing == 0 && !is_paper_shape(shape.name)) {
    shape.spacing = spacing_for(shape, source.phyxels);
  }
  return make_shape(shape);
}

}  // namespace

Cloud make_cloud(const BodyRequest& request) {
  Cloud cloud = rest_cloud(request.source);
  place(cloud, request);
  return cloud;
}

namespace {

Model model_from_sources(const Scene& scene, const Surveyor* surveyor) {
  Model model;
  model.gravity = scene.gravity;
  // Copies of a body follow one another; filling a mesh once serves them all.
  const BodySource* made = nullptr;
  Cloud rest;
  for (const BodyRequest& request : scene.bodies) {
    if (!made || !(*made == request.source)) rest = rest_cloud(request.source);
    made = &request.source;
    Cloud cloud = rest;
    place(cloud, request);
    add_body(model, request, cloud, surveyor);
  }
  finish(model);
  return model;
}

Model model_from_clouds(const Scene& scene, std::span<const Cloud> clouds,
                        const Surveyor* surveyor) {
  if (clouds.size() != scene.bodies.size()) {
    throw InputError(fmt::format("{} clouds for a scene of {} bodies: one each is allowed",
                                 clouds.size(), scene.bodies.size()));
  }
  Model model;
  model.gravity = scene.gravity;
  for (std::size_t b = 0; b < clouds.size(); ++b) {
    add_body(model, scene.bodies[b], clouds[b], surveyor);
  }
  finish(model);
  return model;
}

}  // namespace

const Model& Model::with_lists() const {
  if (!has_lists()) {
    throw InputError(
        "the neighbour lists of this model were left to the device that surveyed it: allowed is a "
        "backend on that device, or a model built without a surveyor");
  }
  return *this;
}

Offset Model::pairs() const {
  Offset sum = 0;
  for (const Part& part : parts) sum += part.lists.pairs;
  return sum;
}

Model build_model(const Scene& scene) { return model_from_sources(scene, nullptr); }
Model build_model(const Scene& scene, std::span<const Cloud> clouds) {
  return model_from_clouds(scene, clouds, nullptr);
}
Model build_model(const Scene& scene, const Surveyor& survey) {
  return model_from_sources(scene, &survey);
}
Model build_model(const Scene& scene, std::span<const Cloud> clouds, const Surveyor& survey) {
  return model_from_clouds(scene, clouds, &survey);
}

std::vector<char> held_phyxels(const Model& model) {
  std::vector<char> held(static_cast<std::size_t>(model.size()), 0);
  for (const Motion& motion : model.motions) {
    if (!motion.stands_still()) continue;
    for (const Index i : motion.phyxels) held[i] = 1;
  }
  return held;
}

}  // namespace phyxel
