#include "phyxel/shapes.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "phyxel/error.hpp"
#include "shapes/lattice_shapes.hpp"
#include "shapes/paper_bodies.hpp"

namespace phyxel {
namespace {

void check_positive(const std::string& shape, const char* key, double value) {
  if (std::isfinite(value) && value > 0) return;
  throw InputError(fmt::format("shape \"{}\": {} = {}: a finite length above 0 m is allowed", shape,
                               key, value));
}

void check_name(const std::string& name) {
  const std::vector<std::string>& names = shape_names();
  if (std::find(names.begin(), names.end(), name) != names.end()) return;
  throw InputError(fmt::format("unknown shape \"{}\"{}: known are {}", name,
                               did_you_mean(name, names), fmt::join(names, ", ")));
}

void check_size(const ShapeRequest& request) {
  check_name(request.name);
  if (request.name == "beam" || request.name == "block") {
    check_positive(request.name, "size.x", request.size.x);
    check_positive(request.name, "size.y", request.size.y);
    check_positive(request.name, "size.z", request.size.z);
  } else {
    check_positive(request.name, "radius", request.radius);
    if (request.name == "cylinder") check_positive(request.name, "length", request.length);
  }
  const double volume = make_lattice(request, 1).volume();
  if (!(volume > 1e-280 && volume < 1e280)) {  // room for products with counts and densities
    throw InputError(fmt::format("shape \"{}\": a volume of {} m^3 is beyond what numbers can hold",
                                 request.name, volume));
  }
}

/// A limit in bytes from a file of one number; infinite if there is none.
double limit_in(const char* file) {
  double bytes = 0;
  return std::ifstream(file) >> bytes ? bytes : HUGE_VAL;
}

/// Memory this process may use [bytes]: the machine's, or less inside a container.
double usable_memory() {
  const double machine =
      static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
  return std::min({machine, limit_in("/sys/fs/cgroup/memory.max"),
                   limit_in("/sys/fs/cgroup/memory/memory.limit_in_bytes")});
}

void refuse_too_many(const std::string& shape, double phyxels) {
  // The most that a phyxel with its neighbour lists and solver arrays takes at any time: measured
  // while the time step is found, in `phyxel check` of a block of two million.
  constexpr double bytes_per_phyxel = 950;
  const double most_index = std::numeric_limits<Index>::max();
  const double memory = usable_memory();
  if (phyxels <= most_index && phyxels * bytes_per_phyxel <= memory) return;
  throw InputError(fmt::format(
      "shape \"{}\": {:.0f} phyxels need about {:.3g} GiB of memory, but {:.3g} GiB are available: "
      "at most {:.0f} phyxels are allowed",
      shape, phyxels, phyxels * bytes_per_phyxel / 0x1p30, memory / 0x1p30,
      std::floor(std::min(most_index, memory / bytes_per_phyxel))));
}

void check_lattice(const ShapeRequest& request) {
  check_size(request);
  check_positive(request.name, "spacing", request.spacing);
  const Vec3d extent = make_lattice(request, 1).extent;
  const double longest = std::max({extent.x, extent.y, extent.z});
  if (request.spacing > longest * (1 + 1e-9)) {  // rounding of a spacing equal to it
    throw InputError(fmt::format(
        "shape \"{}\": spacing = {} m is larger than the whole shape: at most {} m is allowed",
        request.name, request.spacing, longest));
  }
  if (!(request.jitter >= 0 && request.jitter <= 0.5)) {
    throw InputError(fmt::format("shape \"{}\": jitter = {}: 0 to 0.5 spacings are allowed",
                                 request.name, request.jitter));
  }
}

}  // namespace

const std::vector<std::string>& shape_names() {
  static const std::vector<std::string> names{"beam",       "block",    "cylinder", "sphere",
                                              "alien_head", "horn_bug", "dino"};
  return names;
}

bool is_paper_shape(const std::string& name) { return find_paper_body(name) != nullptr; }

double spacing_for(const ShapeRequest& request, Index phyxels) {
  if (const PaperBody* body = find_paper_body(request.name)) {
    throw InputError(fmt::format("shape \"{}\" is no lattice: it has {} phyxels and no spacing",
                                 body->name, body->phyxels));
  }
  check_size(request);
  if (phyxels < 1) {
    throw InputError(fmt::format("shape \"{}\": {} phyxels asked for; at least 1 is needed",
                                 request.name, phyxels));
  }
  refuse_too_many(request.name, phyxels);
  const Lattice unit = make_lattice(request, 1);
  const double longest = std::max({unit.extent.x, unit.extent.y, unit.extent.z});
  const auto count = [&](double spacing) { return make_lattice(request, spacing).phyxels(); };
  const double guess = std::min(std::cbrt(unit.volume() / phyxels), longest);
  if (count(guess) == phyxels) return guess;
  // Whole numbers of cells make the count jump: of the two sides of the jump the nearer one.
  double few = longest, many = guess;
  while (count(many) < phyxels) many *= 0.7;
  if (count(few) >= phyxels) return few;
  while (few - many > 1e-12 * many) {
    const double middle = 0.5 * (few + many);
    (count(middle) < phyxels ? few : many) = middle;
  }
  return phyxels - count(few) < count(many) - phyxels ? few : many;
}

Cloud make_shape(const ShapeRequest& request) {
  check_name(request.name);
  if (const PaperBody* body = find_paper_body(request.name)) {
    return make_paper_body(*body, request.surface);
  }
  check_lattice(request);
  const Lattice lattice = make_lattice(request, request.spacing);
  refuse_too_many(request.name, lattice.phyxels());
  Cloud cloud = fill_lattice(lattice, request.jitter, request.seed);
  if (request.surface) cloud.surface = lattice_surface(lattice, request.spacing);
  return cloud;
}

}  // namespace phyxel
