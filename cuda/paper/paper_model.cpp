#include "paper_model.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "paper_backend.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/laws/st_venant_kirchhoff.hpp"
#include "phyxel/physics/weight.hpp"

namespace phyxel::paper {
namespace {

/// The support and the stiffness of a body. Section 6.1 gives the range 1e4 to 1e6 Pa.
struct Hanging {
  const char* name;
  const char* region;
  Vec3d rotation;  ///< [degrees]
  double young;    ///< [Pa]
};
constexpr Hanging hangings[] = {{"horn_bug", "leg", {180, 0, 0}, 5e5},
                                {"alien_head", "neck", {150, 0, 0}, 8e4},
                                {"dino", "mouth", {0, 0, 0}, 6e5}};
constexpr double poisson = 0.34;  // section 6.1

/// Keeps the `most` nearest carriers of each surfel; ties go to the smaller index.
void limit_carriers(Model& model, int most) {
  Csr limited;
  std::vector<std::pair<double, Index>> nearest;
  for (Index s = 0; s < model.surfels.carriers.rows(); ++s) {
    nearest.clear();
    for (const Index i : model.surfels.carriers.row(s)) {
      const Vec3d x = model.surfels.position[s] - model.position[i];
      nearest.emplace_back(dot(x, x), i);
    }
    const auto kept = std::min(nearest.size(), static_cast<std::size_t>(most));
    const auto end = nearest.begin() + static_cast<std::ptrdiff_t>(kept);
    std::partial_sort(nearest.begin(), end, nearest.end());
    std::sort(nearest.begin(), end, [](auto& a, auto& b) { return a.second < b.second; });
    for (auto it = nearest.begin(); it != end; ++it) limited.indices.push_back(it->second);
    limited.offsets.push_back(static_cast<Offset>(limited.indices.size()));
  }
  model.surfels.carriers = std::move(limited);
}

}  // namespace

const std::vector<std::string>& body_names() {
  static const std::vector<std::string> names{"horn_bug", "alien_head", "dino"};
  return names;
}

void use_paper_rules(BodyRequest& body) {
  body.neighbourhood = {.support = NeighbourhoodRule::Support::adaptive,
                        .nearest = 10,
                        .factor = 3,
                        .max_neighbours = max_neighbours};
  body.volume_rule = VolumeRule::kernel;
}

Scene body_scene(const std::string& name, int copies) {
  const auto* hanging = std::find_if(std::begin(hangings), std::end(hangings),
                                     [&](const Hanging& h) { return name == h.name; });
  if (hanging == std::end(hangings)) {
    throw InputError(fmt::format("body \"{}\": not one of the paper's{}; allowed: {}", name,
                                 did_you_mean(name, body_names()), fmt::join(body_names(), ", ")));
  }
  Scene scene;
  scene.title = fmt::format("{} of Farias et al. 2008", name);
  scene.gravity = {0, 0, -9.81};
  scene.time.end = 1;
  for (int c = 0; c < copies; ++c) {
    BodyRequest body;
    body.name = copies == 1 ? name : fmt::format("{} {}", name, c + 1);
    body.where = "phyxel paper";
    body.source.shape.name = name;
    body.rotation = hanging->rotation;
    body.material = {.young = hanging->young,
                     .poisson = poisson,
                     .density = 1000,
                     .law = StVenantKirchhoff<double>::name,
                     .hourglass = 0};
    use_paper_rules(body);
    body.fixed.push_back({.select = {.region = hanging->region, .where = "phyxel paper"}});
    scene.bodies.push_back(body);
  }
  return scene;
}

Model paper_model(const Scene& scene) {
  Model model = build_model(scene);
  limit_carriers(model, max_neighbours);
  return model;
}

Model paper_model(const Scene& scene, const Cloud& cloud) {
  return paper_model(scene, std::span(&cloud, 1));
}

Model paper_model(const Scene& scene, std::span<const Cloud> clouds) {
  Model model = build_model(scene, clouds);
  limit_carriers(model, max_neighbours);
  return model;
}

void check_paper_model(const Model& model) {
  const auto refuse = [](const std::string& what) {
    throw InputError("the 2008 kernels: " + what);
  };
  check_model(model);
  if (model.fracture.acts()) refuse("a body that breaks, or has notches; allowed: neither");
  if (model.has_inclusions()) refuse("a body of several materials; allowed: one");
  if (model.parts.size() != 1) {
    refuse(fmt::format("{} bodies in one model; allowed: one body per launch", model.parts.size()));
  }
  const Part& part = model.with_lists().parts[0];
  if (model.size() > most_phyxels) {
    refuse(
        fmt::format("body \"{}\" has {} phyxels, but neighbour indices have 16 bits "
                    "(unsigned short); allowed: at most {}",
                    part.name, model.size(), most_phyxels));
  }
  if (!part.kernel_volumes) {
    refuse(
        fmt::format("body \"{}\" has geometric volumes; allowed: volumes = \"kernel\"", part.name));
  }
  if (part.material.damping > 0 || part.material.volume_stiffness > 0 ||
      part.material.hourglass.value_or(0) > 0) {
    refuse(
        fmt::format("body \"{}\" has damping, volume conservation or hourglass control; allowed: "
                    "none of them",
                    part.name));
  }
  const std::string& law = part.material.law;
  if (part.material.custom_law ||
      (law != StVenantKirchhoff<double>::name && law != SmallStrain<double>::name)) {
    refuse(fmt::format("body \"{}\" has another law than the paper; allowed: {}, {}", part.name,
                       StVenantKirchhoff<double>::name, SmallStrain<double>::name));
  }
  if (part.closure > 0) {
    refuse(fmt::format("body \"{}\" has closed gradients; allowed: closure = 0", part.name));
  }
  if (part.pair_length > 0) {
    refuse(
        fmt::format("body \"{}\" has supports of pairs; allowed: neighbours.support = "
                    "\"uniform\" or \"adaptive\"",
                    part.name));
  }
  if (!model.loads.empty()) refuse("loads; allowed: gravity");
  for (const Motion& motion : model.motions) {
    if (!motion.stands_still()) refuse("prescribed motion; allowed: fixed phyxels");
    if (!motion.axes.all()) {
      refuse("phyxels that are fixed along some axes only; allowed: along all axes");
    }
  }
}

std::vector<double> surfel_weights(const Model& model) {
  const Csr& carriers = model.surfels.carriers;
  std::vector<double> weights;
  weights.reserve(carriers.indices.size());
  for (Index s = 0; s < carriers.rows(); ++s) {
    for (const Index i : carriers.row(s)) {
      const double w = weight(norm(model.surfels.position[s] - model.position[i]),
                              model.neighbourhood.support[i]);
      weights.push_back(carriers.length(s) == 1 ? 1 : w);
    }
  }
  return weights;
}

std::vector<double> material_tensor(const Material& material) {
  const double nu = material.poisson;
  const double scale = material.young / ((1 + nu) * (1 - 2 * nu));
  std::vector<double> c(36, 0.0);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      c[row * 6 + column] = scale * (row == column ? 1 - nu : nu);
    }
    c[(row + 3) * 6 + row + 3] = scale * (1 - 2 * nu);
  }
  return c;
}

}  // namespace phyxel::paper
