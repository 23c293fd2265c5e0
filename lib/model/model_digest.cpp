#include <xxhash.h>

#include <memory>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {
namespace {

template <class T>
void add(XXH3_state_t* state, const std::vector<T>& values) {
  XXH3_64bits_update(state, values.data(), values.size() * sizeof(T));
}

}  // namespace

std::uint64_t model_digest(const Model& model) {
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(),
                                                                       &XXH3_freeState);
  XXH3_64bits_reset(state.get());
  add(state.get(), model.position);
  add(state.get(), model.neighbourhood.support);
  for (const Part& part : model.parts) {
    const Material& m = part.material;
    // Kernel volumes are sums, whose last bits depend on who summed.
    if (!part.kernel_volumes) {
      add(state.get(),
          std::vector<double>(model.volume.begin() + part.begin, model.volume.begin() + part.end));
    }
    add(state.get(), std::vector<char>(part.neighbourhood.begin(), part.neighbourhood.end()));
    add(state.get(), std::vector<double>{m.young, m.poisson, m.density, m.volume_stiffness,
                                         m.damping, m.strain == Strain::green ? 1.0 : 0.0});
  }
  for (const Motion& motion : model.motions) {
    add(state.get(), motion.phyxels);
    const Vec3d &d = motion.displacement, &v = motion.velocity, &a = motion.amplitude;
    add(state.get(), std::vector<double>{d.x, d.y, d.z, v.x, v.y, v.z, a.x, a.y, a.z,
                                         motion.duration, motion.frequency});
  }
  for (const Load& load : model.loads) {
    add(state.get(), load.phyxels);
    add(state.get(), std::vector<Vec3d>{load.total, load.density});
    add(state.get(), std::vector<double>{load.ramp});
  }
  return XXH3_64bits_digest(state.get());
}

}  // namespace phyxel
