#include <xxhash.h>

#include <array>
#include <memory>
#include <vector>

#include "phyxel/custom_law.hpp"
#include "phyxel/model.hpp"

namespace phyxel {
namespace {

template <class T>
void add(XXH3_state_t* state, const std::vector<T>& values) {
  XXH3_64bits_update(state, values.data(), values.size() * sizeof(T));
}

/// Returns the numbers of a load's curve: the duration of a ramp, else times and factors.
std::vector<double> numbers_of(const LoadCurve& curve) {
  const double duration = curve.points.empty() ? 0 : curve.points.back().time;
  if (curve == LoadCurve::of(duration, {})) return {duration};
  std::vector<double> numbers;
  for (const auto [time, factor] : curve.points) numbers.insert(numbers.end(), {time, factor});
  return numbers;
}

/// Adds the surface of a part, from which closing vectors follow beside the phyxels. The first part
/// of a body has its surface. @param surfaces of the bodies; empty: the model has them
void add_surface(XXH3_state_t* state, const Model& model, const Part& part,
                 std::span<const Surface> surfaces) {
  const auto add_triangle = [&](const Triangle& t, const std::vector<Vec3d>& position) {
    for (const Index s : t) XXH3_64bits_update(state, &position[s], sizeof(Vec3d));
  };
  if (!surfaces.empty()) {
    if (&part != &model.parts_of_body(part).front()) return;
    const Surface& surface = surfaces[static_cast<std::size_t>(part.body)];
    for (const Triangle& t : surface.triangle) add_triangle(t, surface.position);
    return;
  }
  for (const Triangle& t : model.surfels.triangles_of(part)) {
    add_triangle(t, model.surfels.position);
  }
}

void add_path(XXH3_state_t* state, const Motion& motion) {
  const Vec3d &d = motion.displacement, &v = motion.velocity, &a = motion.amplitude;
  add(state, std::vector<double>{d.x, d.y, d.z, v.x, v.y, v.z, a.x, a.y, a.z, motion.duration,
                                 motion.frequency});
  if (motion.rotation != Vec3d{}) {
    const Vec3d &r = motion.rotation, &c = motion.about;
    add(state, std::vector<double>{r.x, r.y, r.z, c.x, c.y, c.z});
  }
}

/// A sum over phyxels, so that ranks may each add theirs.
std::uint64_t digest_of_phyxels(const Model& model) {
  std::uint64_t sum = 0;
  const auto digest_of = [](const auto& values) {
    return XXH3_64bits(values.data(), values.size() * sizeof(values[0]));
  };
  for (const Part& part : model.parts) {
    const Index end = part.owned_end();
#pragma omp parallel for schedule(static) reduction(+ : sum)
    for (Index i = part.begin; i < end; ++i) {
      const Vec3d& x = model.position[i];
      // Kernel volumes are sums, whose last bits depend on who summed.
      sum += digest_of(std::array{static_cast<double>(model.global_id(i)), x.x, x.y, x.z,
                                  model.neighbourhood.support[i],
                                  part.kernel_volumes ? 0.0 : model.volume[i]});
      if (model.fracture.growth.empty()) continue;
      sum +=
          digest_of(std::array{static_cast<double>(model.global_id(i)), model.fracture.growth[i]});
    }
  }
  std::int64_t entry = 0;
  const auto add_entry = [&](const std::vector<Index>& phyxels) {
    ++entry;
    for (const Index i : phyxels) {
      if (model.owns(i)) sum += digest_of(std::array{entry, std::int64_t{model.global_id(i)}});
    }
  };
  for (const Motion& motion : model.motions) add_entry(motion.phyxels);
  for (const Load& load : model.loads) add_entry(load.phyxels);
  if (model.share) {
    auto whole = static_cast<std::int64_t>(sum);
    model.share->communicator->add({&whole, 1});
    sum = static_cast<std::uint64_t>(whole);
  }
  return sum;
}

}  // namespace

std::uint64_t model_digest_before_4(const Model& model, std::span<const Surface> surfaces) {
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(),
                                                                       &XXH3_freeState);
  XXH3_64bits_reset(state.get());
  add(state.get(), std::vector<std::uint64_t>{digest_of_phyxels(model)});
  for (const Part& part : model.parts) {
    const Material& m = part.material;
    add(state.get(), std::vector<char>(part.neighbourhood.begin(), part.neighbourhood.end()));
    add(state.get(), std::vector<Index>{part.size});
    add(state.get(), std::vector<double>{m.young, m.poisson, m.density, m.volume_stiffness,
                                         m.damping, m.hourglass.value_or(0), part.closure});
    add(state.get(), std::vector<char>(m.law.begin(), m.law.end()));
    for (const auto& [name, value] : m.parameters) {
      add(state.get(), std::vector<char>(name.begin(), name.end()));
      add(state.get(), std::vector<double>(value.numbers().begin(), value.numbers().end()));
    }
    if (m.viscosity > 0) add(state.get(), std::vector<double>{m.viscosity});
    if (m.custom_law) {
      const std::string name = m.custom_law->name();
      add(state.get(), std::vector<char>(name.begin(), name.end()));
    }
    if (part.closure > 0) add_surface(state.get(), model, part, surfaces);
  }
  for (const Motion& motion : model.motions) {
    add_path(state.get(), motion);
    if (!motion.axes.all()) {
      add(state.get(), std::vector<char>{motion.axes.x, motion.axes.y, motion.axes.z});
    }
  }
  for (const Load& load : model.loads) {
    add(state.get(), std::vector<Vec3d>{load.total, load.density});
    add(state.get(), numbers_of(load.curve));
    if (load.follows) add(state.get(), std::vector<double>{1, load.gas.value_or(-1)});
  }
  for (const Obstacle& obstacle : model.obstacles) {
    add(state.get(),
        std::vector<double>{static_cast<double>(obstacle.form.shape), obstacle.form.lengths[0],
                            obstacle.form.lengths[1], obstacle.form.lengths[2],
                            obstacle.hollow ? 1.0 : 0.0, obstacle.law.static_friction,
                            obstacle.law.kinetic_friction, obstacle.law.restitution});
    if (obstacle.penalty > 0) add(state.get(), std::vector<double>{obstacle.penalty});
    if (obstacle.surface) {
      add(state.get(), obstacle.surface->position);
      add(state.get(), obstacle.surface->triangle);
    }
    add(state.get(), std::vector<Mat3d>{obstacle.turn});
    add(state.get(), std::vector<Vec3d>{obstacle.place});
    add_path(state.get(), obstacle.motion);
    if (!obstacle.free) continue;
    const auto start = obstacle.start.numbers();
    add(state.get(), std::vector<double>(start.begin(), start.end()));
    add(state.get(), std::vector<double>{obstacle.free->mass});
  }
  return XXH3_64bits_digest(state.get());
}

std::uint64_t model_digest(const Model& model, std::span<const Surface> surfaces) {
  struct {
    std::uint64_t rest;
    Vec3d gravity;
  } const all{model_digest_before_4(model, surfaces), model.gravity};
  return XXH3_64bits(&all, sizeof(all));
}

}  // namespace phyxel
