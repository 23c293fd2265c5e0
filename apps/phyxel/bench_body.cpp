#include "bench_body.hpp"

#include <CLI/CLI.hpp>
#include <cmath>

#include "phyxel/law_table.hpp"
#include "phyxel/shapes.hpp"

namespace phyxel::app {
namespace {

/// A law's name in tables of `bench step`. The two laws of Hooke are named by their strain, as in
/// tables of earlier versions.
std::string term_of(const LawEntry& law) {
  const std::string name = law.name;
  if (name == StVenantKirchhoff<double>::name) return "green";
  return name == SmallStrain<double>::name ? "cauchy" : name;
}

}  // namespace

std::vector<std::string> bench_terms() {
  std::vector<std::string> terms;
  for (const LawEntry& law : law_table()) terms.push_back(term_of(law));
  for (const char* term : {"volume", "hourglass", "closure", "damping", "load", "adaptive",
                           "obstacle", "contact", "surfels"}) {
    terms.emplace_back(term);
  }
  return terms;
}

ShapeRequest bench_shape(Index n, bool surfels) {
  const double side = std::round(std::cbrt(static_cast<double>(n))) * 0.1;
  return {.name = "block",
          .size = {side, side, side},
          .spacing = 0.1,
          .jitter = 0.1,
          .surface = surfels};
}

Cloud bench_cube(Index n, bool surfels) { return make_shape(bench_shape(n, surfels)); }

Scene bench_scene(const std::string& terms, double factor, int bodies) {
  Scene scene;
  scene.gravity = {0, 0, -9.81};
  BodyRequest body;
  body.name = "cube";
  body.material = {.young = 1e6,
                   .poisson = 0.3,
                   .density = 1000,
                   .law = StVenantKirchhoff<double>::name,
                   .hourglass = 0};
  for (const LawEntry& law : law_table()) {
    if (term_of(law) != terms) continue;
    body.material.law = law.name;
    for (const LawParameter& p : law.parameters) {
      if (p.required() && is_own_parameter(p)) body.material.parameters[p.name] = typical_value(p);
    }
  }
  if (terms == "volume") body.material.volume_stiffness = 1e6;
  if (terms == "hourglass") body.material.hourglass = 0.1;
  body.closure = terms == "closure" ? 0.01 : 0;
  if (terms == "damping") body.material.damping = 0.1;
  if (terms == "load") body.loads.push_back({.select = {.all = true}, .force = {1, 0, 0}});
  if (terms == "adaptive") body.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  if (terms == "obstacle") scene.obstacles.push_back({.name = "floor", .shape = "plane"});
  body.neighbourhood.factor = factor;
  scene.bodies.assign(static_cast<std::size_t>(bodies), body);
  if (terms == "contact") {
    scene.contact = ContactRequest{.friction = 0.3};
    for (int b = 0; b < bodies; ++b) {
      BodyRequest& one = scene.bodies[static_cast<std::size_t>(b)];
      one.name += std::to_string(b);
      one.velocity.z = 0.1 * (bodies - 1 - 2 * b);  // they press each other
    }
  }
  return scene;
}

void add_repeats(CLI::App& command, int& repeats) {
  command.add_option("--repeat", repeats, "Number of repeats; the median is reported")
      ->check(CLI::Range(1, 1000));
}

void add_size_options(CLI::App& command, std::vector<Index>& sizes, int& repeats) {
  command.add_option("--phyxels", sizes, "Numbers of phyxels, comma separated (rounded to cubes)")
      ->delimiter(',')
      ->check(CLI::Range(8, 2'000'000'000));
  add_repeats(command, repeats);
}

void add_thread_counts(CLI::App& command, std::vector<int>& threads) {
  command.add_option("--threads", threads, "Numbers of threads, comma separated")
      ->delimiter(',')
      ->check(CLI::Range(1, 4096));
}

void add_seconds_option(CLI::App& command, double& seconds) {
  command.add_option("--seconds", seconds, "Duration of one repeat [s]")
      ->check(CLI::Range(0.01, 60.0));
}

}  // namespace phyxel::app
