#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

std::vector<char> prescribed_axes(const Model& model) {
  std::vector<char> axes(static_cast<std::size_t>(model.size()), 0);
  for (const Motion& motion : model.motions) {
    for (const Index i : motion.phyxels) axes[i] = static_cast<char>(axes[i] | motion.axes.bits());
  }
  return axes;
}

std::vector<char> supported_phyxels(const Model& model) {
  std::vector<char> axes = prescribed_axes(model);
  for (char& bits : axes) bits = bits == Axes{}.bits();
  return axes;
}

std::vector<char> held_phyxels(const Model& model) {
  std::vector<char> held(static_cast<std::size_t>(model.size()), 0);
  for (const Motion& motion : model.motions) {
    if (!motion.stands_still() || !motion.axes.all()) continue;
    for (const Index i : motion.phyxels) held[i] = 1;
  }
  return held;
}

}  // namespace phyxel
