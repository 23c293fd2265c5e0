#include "shapes/paper_bodies.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "phyxel/mesh.hpp"
#include "shapes/surface_remesh.hpp"

// Lengths are in metres; x points forwards, y to the left, z up. A limb must be at least two
// spacings thick (0.09 m for the head, 0.055 m for the other bodies), or its phyxels would lie in a
// row and could not resist bending.
namespace phyxel {
namespace {

PaperBody alien_head() {
  using Limb = ImplicitBody::Limb;
  using Ellipsoid = ImplicitBody::Ellipsoid;
  ImplicitBody form;
  // Cranium, chin, neck and shoulders.
  form.add(Ellipsoid{{-0.05, 0, 0.21}, {0.34, 0.33, 0.29}}, 0);
  form.add(Limb{{0.07, 0, 0.06}, 0.23, {0.17, 0, -0.24}, 0.075}, 0.12);
  form.add(Limb{{-0.07, 0, -0.05}, 0.16, {-0.08, 0, -0.37}, 0.135}, 0.08);
  form.add(Ellipsoid{{-0.08, 0, -0.43}, {0.17, 0.21, 0.07}}, 0.08);
  // Eyes (each a bulge in a socket), nostrils and mouth.
  const Vec3d inner{0.315, 0.062, -0.08}, middle{0.30, 0.145, 0.0}, outer{0.22, 0.245, 0.115};
  form.cut_pair(Limb{middle, 0.105, inner, 0.045}, 0.03);
  form.cut_pair(Limb{middle, 0.105, outer, 0.045}, 0.03);
  const Vec3d back{-0.045, -0.02, 0};
  form.add_pair(Limb{middle + back, 0.085, inner + back, 0.025}, 0.03);
  form.add_pair(Limb{middle + back, 0.085, outer + back, 0.025}, 0.03);
  form.cut_pair(Limb{{0.285, 0.02, -0.145}, 0.014, {0.285, 0.026, -0.125}, 0.014}, 0.01);
  form.cut(Limb{{0.25, -0.04, -0.22}, 0.016, {0.25, 0.04, -0.22}, 0.016}, 0.012);
  return {"alien_head", 238, 16000, form, "neck", {-0.07, 0, -0.5}, 12};
}

PaperBody horn_bug() {
  using Limb = ImplicitBody::Limb;
  ImplicitBody form;
  form.add(ImplicitBody::Ellipsoid{{-0.20, 0, 0.0}, {0.34, 0.22, 0.20}, -0.1}, 0);
  form.add(ImplicitBody::Ellipsoid{{0.17, 0, 0.01}, {0.15, 0.18, 0.16}}, 0.02);
  form.add(ImplicitBody::Ellipsoid{{0.36, 0, -0.03}, {0.12, 0.11, 0.10}}, 0.02);
  // Legs: hip, knee, foot.
  const Vec3d leg[3][3] = {{{0.20, 0.10, -0.06}, {0.34, 0.33, 0.02}, {0.46, 0.42, -0.42}},
                           {{-0.04, 0.14, -0.06}, {-0.04, 0.42, 0.02}, {-0.04, 0.52, -0.42}},
                           {{-0.26, 0.12, -0.06}, {-0.42, 0.37, 0.02}, {-0.56, 0.46, -0.42}}};
  for (const auto& [hip, knee, foot] : leg) {
    form.add_pair(Limb{hip, 0.065, knee, 0.06}, 0.03);
    form.add_pair(Limb{knee, 0.06, foot, 0.055}, 0.02);
  }
  form.add(Limb{{0.40, 0, 0.02}, 0.085, {0.55, 0, 0.14}, 0.072}, 0.05);
  form.add(Limb{{0.55, 0, 0.14}, 0.072, {0.61, 0, 0.30}, 0.063}, 0.02);
  form.add(Limb{{0.61, 0, 0.30}, 0.063, {0.57, 0, 0.46}, 0.055}, 0.02);
  return {"horn_bug", 666, 1460, form, "leg", {0.46, 0.42, -0.475}, 6};
}

PaperBody dino() {
  using Limb = ImplicitBody::Limb;
  using Ellipsoid = ImplicitBody::Ellipsoid;
  ImplicitBody form;
  form.add(Ellipsoid{{-0.02, 0, -0.10}, {0.32, 0.19, 0.19}, 0.08}, 0);
  form.add(Limb{{0.16, 0, -0.03}, 0.14, {0.38, 0, 0.16}, 0.085}, 0.06);
  form.add(Limb{{0.38, 0, 0.16}, 0.085, {0.44, 0, 0.36}, 0.07}, 0.02);
  form.add(Ellipsoid{{0.53, 0, 0.41}, {0.17, 0.095, 0.09}, -0.15}, 0.05);
  form.add(Limb{{-0.20, 0, -0.10}, 0.14, {-0.52, 0, -0.19}, 0.085}, 0.08);
  form.add(Limb{{-0.52, 0, -0.19}, 0.085, {-0.72, 0, -0.20}, 0.07}, 0.02);
  form.add(Limb{{-0.72, 0, -0.20}, 0.07, {-0.88, 0, -0.165}, 0.062}, 0.02);
  form.add(Limb{{-0.88, 0, -0.165}, 0.062, {-1.02, 0, -0.08}, 0.055}, 0.02);
  form.add_pair(Limb{{0.15, 0.12, -0.16}, 0.085, {0.18, 0.145, -0.43}, 0.07}, 0.04);
  form.add_pair(Limb{{-0.18, 0.12, -0.16}, 0.10, {-0.20, 0.145, -0.43}, 0.07}, 0.04);
  // Feet, eyes, nostrils, and the mouth: a slit between the jaws.
  form.add_pair(Ellipsoid{{0.20, 0.145, -0.46}, {0.095, 0.075, 0.04}}, 0.03);
  form.add_pair(Ellipsoid{{-0.18, 0.145, -0.46}, {0.095, 0.075, 0.04}}, 0.03);
  form.add_pair(Limb{{0.53, 0.07, 0.465}, 0.025, {0.53, 0.075, 0.465}, 0.025}, 0.01);
  form.cut_pair(Limb{{0.675, 0.03, 0.425}, 0.01, {0.675, 0.04, 0.43}, 0.01}, 0.01);
  form.cut(Ellipsoid{{0.70, 0, 0.365}, {0.13, 0.2, 0.016}, 0.1}, 0.01);
  return {"dino", 575, 53504, form, "mouth", {0.66, 0, 0.38}, 12};
}

/// Indices of the `count` phyxels nearest to `place`, ascending.
std::vector<Index> nearest_phyxels(const Cloud& cloud, Vec3d place, int count) {
  std::vector<Index> order(cloud.position.size());
  std::iota(order.begin(), order.end(), 0);
  const auto distance2 = [&](Index i) {
    const Vec3d d = cloud.position[i] - place;
    return dot(d, d);
  };
  std::partial_sort(order.begin(), order.begin() + count, order.end(), [&](Index i, Index j) {
    return std::pair{distance2(i), i} < std::pair{distance2(j), j};
  });
  order.resize(static_cast<std::size_t>(count));
  std::sort(order.begin(), order.end());
  return order;
}

}  // namespace

const PaperBody* find_paper_body(const std::string& name) {
  static const std::array<PaperBody, 3> bodies{alien_head(), horn_bug(), dino()};
  for (const PaperBody& body : bodies) {
    if (body.name == name) return &body;
  }
  return nullptr;
}

Cloud make_paper_body(const PaperBody& body, bool surface) {
  Cloud cloud = sample_surface(mesh_body(body.form, body.surfels),
                               {.phyxels = body.phyxels, .seed = 1, .on_surface = false});
  cloud.regions[body.region] = nearest_phyxels(cloud, body.region_anchor, body.region_size);
  if (!surface) cloud.surface = {};
  return cloud;
}

}  // namespace phyxel
