/// The search on the GPU for points that may touch, compared with that of the CPU.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "model/assembly.hpp"
#include "phyxel/solver.hpp"
#include "setup/device_touching_points.hpp"
#include "setup/tiling.hpp"
#include "solver/body_contacts.hpp"
#include "solver/cuda_backend.hpp"
#include "support/backend.hpp"
#include "support/contact_scene.hpp"
#include "support/strewn_surfaces.hpp"

namespace phyxel::cuda {
namespace {

/// Blocks of two spacings in a pile, beside each other.
std::string pile() {
  std::string text;
  for (int b = 0; b < 12; ++b) {
    text += fmt::format(
        "[[body]]\nname = 'b{}'\nshape = 'block'\nsize = [0.2, 0.15, 0.1]\nspacing = {}\n"
        "translation = [{:.3f}, {:.3f}, {:.3f}]\n"
        "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n{}",
        b, b % 3 == 0 ? 0.02 : 0.035, b % 2 * 0.205 + b / 4 * 0.03, b / 2 % 2 * 0.152,
        b / 4 * 0.101, b % 4 == 1 ? "damping = 3\n" : "");
  }
  return text;
}

template <class T>
std::vector<T> fetched(const DeviceArray<T>& array) {
  std::vector<T> values(array.size());
  array.download(values.data());
  return values;
}

DeviceArray<Vec3d> sent(const std::vector<Vec3d>& values) {
  DeviceArray<Vec3d> array(values.size(), "places");
  array.upload(values.data());
  return array;
}

template <class T>
void expect_same(std::span<const T> host, const DeviceArray<T>& device, const char* what) {
  const std::vector<T> values = fetched(device);
  ASSERT_EQ(values.size(), host.size()) << what;
  for (std::size_t k = 0; k < values.size(); ++k) {
    // Only members are compared: they have no padding before their last one.
    ASSERT_EQ(std::memcmp(&values[k], &host[k], sizeof(T)), 0) << what << ' ' << k;
  }
}
template <class T>
void expect_same(const std::vector<T>& host, const DeviceArray<T>& device, const char* what) {
  expect_same(std::span<const T>(host), device, what);
}

class TouchingPointsOnDevice : public ::testing::TestWithParam<const char*> {};

TEST_P(TouchingPointsOnDevice, AreThoseOfTheHost) {
  const std::string contact = GetParam();
  const Model model = build_model(parse_scene(end + contact + pile(), "scene.toml"));
  const SurfaceLayer layer(model);
  const std::size_t phyxels = layer.phyxels().size();
  TouchingPoints host(layer);
  std::vector<Index> place;  // each phyxel's tile slot, in an order of its own
  for (std::size_t k = 0; k < phyxels; ++k) {
    place.push_back(static_cast<Index>(k % 7 * 1000 + phyxels - k / 7));
  }
  const Index tiles = static_cast<Index>(8000 + phyxels) / tile_size + 1;
  DeviceTouchingPoints device(layer, place, tiles, nullptr);

  std::mt19937 random(3);
  std::uniform_real_distribution<double> shift(-0.005, 0.005);
  std::vector<Vec3d> position;
  for (const SurfaceSite& site : layer.sites()) position.push_back(site.rest);
  std::size_t most = 0;
  int patches = 0;
  for (int search = 0; search < 3; ++search) {
    const double dt = search < 2 ? 1e-4 : 2e-4;
    // In the last search each body has a skin of its own.
    std::vector<double> skins = layer.skins(search == 1 ? layer.most_skin() : layer.least_skin());
    for (std::size_t b = 0; search == 2 && b < skins.size(); b += 2) skins[b] = layer.most_skin();
    host.find(position, dt, skins);
    device.find(sent(position), dt, skins);
    EXPECT_EQ(device.any(), host.any());
    expect_same(host.own(), device.own().layer, "numbers in the layer");
    expect_same(host.sites(), device.lists().site, "sites");
    expect_same(host.ids(), device.lists().id, "ids");
    expect_same(host.near().indices, device.lists().near, "entries");
    expect_same(host.near().offsets, device.lists().near_start, "starts of rows");
    expect_same(host.rows_naming(), device.lists().rows_naming, "rows of entries");
    expect_same(host.entries_of().indices, device.lists().entries_of, "entries of points");
    expect_same(host.entries_of().offsets, device.lists().entries_of_start, "their starts");
    expect_same(host.rows_from().indices, device.lists().rows_from, "rows of points");
    expect_same(host.rows_from().offsets, device.lists().rows_from_start, "their starts");
    EXPECT_EQ(host.reach().partners.offsets, device.reach().partners.offsets);
    EXPECT_EQ(host.reach().partners.indices, device.reach().partners.indices);
    const std::vector<ContactRow> rows = fetched(device.lists().rows);
    ASSERT_EQ(rows.size(), host.rows().size());
    EXPECT_EQ(device.lists().have_patches, host.have_patches());
    for (std::size_t r = 0; r < rows.size(); ++r) {
      const ContactRow& expected = host.rows()[r];
      ASSERT_EQ(rows[r].point, expected.point);
      ASSERT_EQ(rows[r].body, expected.body);
      ASSERT_EQ(rows[r].patch, expected.patch);
      ASSERT_EQ(rows[r].patches, expected.patches);
      patches += rows[r].patch > 0;
      ASSERT_EQ(rows[r].law.static_friction, expected.law.static_friction);
      ASSERT_EQ(rows[r].law.restitution, expected.law.restitution);
      ASSERT_EQ(rows[r].apart, expected.apart);
    }
    const std::vector<Index> slots = fetched(device.own().place),
                             entries = fetched(device.own().entry),
                             used = fetched(device.own().tiles);
    EXPECT_TRUE(std::is_sorted(used.begin(), used.end()));
    for (std::size_t p = 0; p < slots.size(); ++p) {
      ASSERT_EQ(slots[p], place[host.own()[p]]);
      ASSERT_EQ(used[entries[p] / tile_size] * tile_size + entries[p] % tile_size, slots[p]);
    }
    most = std::max(most, rows.size());
    for (Vec3d& x : position) x += {shift(random), shift(random), shift(random)};
    if (search != 1) continue;
    // Both ends of a body beside the same points, and nothing of it between them.
    for (std::size_t k = 0; k < position.size(); ++k) {
      const double from_middle = layer.sites()[k].rest.x - 0.205;
      if (layer.bodies()[k] != 1) continue;
      if (std::abs(from_middle) < 0.08) position[k].z += 1;
      if (from_middle > 0.08) position[k].x -= 0.15;
    }
  }
  EXPECT_GT(most, 200u);
  EXPECT_GT(patches, 0);
}

INSTANTIATE_TEST_SUITE_P(
    All, TouchingPointsOnDevice,
    ::testing::Values("[contact]\nfriction = 0.3\n", "[contact]\nself = true\n",
                      "[contact]\n[[contact.pair]]\nfirst = 'b0'\nsecond = 'b1'\nfriction = 0.5\n"
                      "[[contact.pair]]\nfirst = 'b4'\nsecond = 'b0'\nrestitution = 0.5\n"));

TEST(PatchesOnDevice, AreThoseOfTheHost) {
  const Scene scene = parse_scene(bar_and_cube(1e-3), "scene.toml");
  const Model model = build_model(scene);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> speed(-1, 1);
  State start = initial_state(model, scene, dt);
  const std::vector<Vec3d> places = strewn(model, random);
  const std::vector<Index>& layer = model.body_contact.layer.phyxels;
  for (std::size_t k = 0; k < layer.size(); ++k) {
    start.displacement[layer[k]] = places[k] - model.position[layer[k]];
    start.velocity[layer[k]] = {speed(random), speed(random), speed(random)};
  }
  const auto after_step = [&](std::unique_ptr<Backend> backend) {
    Solver solver(model, *backend, start, Method::verlet);
    solver.step(1);
    return solver.state().velocity;
  };
  const std::vector<Vec3d> host = after_step(make_cpu_backend(model, Precision::double_, 1)),
                           device = after_step(make_cuda_backend(model, Precision::double_));
  int changed = 0;  // by contact: the material's forces make 1e-4 m/s at most
  for (std::size_t i = 0; i < host.size(); ++i) {
    changed += norm(host[i] - start.velocity[i]) > 0.01;
    // Products and sums are fused on the GPU alone.
    ASSERT_LE(norm(host[i] - device[i]), 1e-10) << i;
  }
  EXPECT_GT(changed, 20);
}

TEST(TouchingPointsOfDistantBodies, AreNone) {
  const Model model = build_model(
      parse_scene(end + "[contact]\n" +
                      "[[body]]\nname = 'a'\nshape = 'block'\nsize = [1, 1, 1]\n"
                      "spacing = 0.1\n" +
                      material +
                      "[[body]]\nname = 'b'\nshape = 'block'\nsize = [1, 1, 1]\nspacing = 0.1\n"
                      "translation = [0, 0, 5]\n" +
                      material,
                  "scene.toml"));
  const SurfaceLayer layer(model);
  DeviceTouchingPoints device(layer, std::vector<Index>(layer.phyxels().size()), 1, nullptr);
  std::vector<Vec3d> position;
  for (const SurfaceSite& site : layer.sites()) position.push_back(site.rest);
  device.find(sent(position), 1e-4, layer.skins(layer.most_skin()));
  EXPECT_FALSE(device.any());
  EXPECT_EQ(device.own().layer.size(), 0u);
  EXPECT_EQ(device.lists().rows.size(), 0u);
}

}  // namespace
}  // namespace phyxel::cuda
