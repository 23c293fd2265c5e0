/// Whether the arrays of a model fit together.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "phyxel/error.hpp"
#include "phyxel/model.hpp"

namespace phyxel {
namespace {

/// Throws the fault of an array.
[[noreturn]] void refuse(const std::string& array, const std::string& fault,
                         const std::string& allowed) {
  throw InputError(fmt::format("model: {} {}; allowed: {}", array, fault, allowed));
}

void check_size(const std::string& array, std::size_t found, std::size_t wanted, const char* what) {
  if (found == wanted) return;
  refuse(array, fmt::format("has {} entries for {} {}", found, wanted, what), "one for each");
}

/// The first of n numbers for which `is_bad` holds; n if there is none.
template <class IsBad>
Offset first_bad(Offset n, IsBad&& is_bad) {
  Offset first = n;
#pragma omp parallel for schedule(static) reduction(min : first)
  for (Offset i = 0; i < n; ++i) {
    if (i < first && is_bad(i)) first = i;
  }
  return first;
}

std::string in_words(double value) { return fmt::format("{:g}", value); }
std::string in_words(Vec3d v) { return fmt::format("[{:g}, {:g}, {:g}]", v.x, v.y, v.z); }
std::string in_words(const Sym3d& m) {
  return fmt::format("[{:g}, {:g}, {:g}, {:g}, {:g}, {:g}]", m.xx, m.xy, m.xz, m.yy, m.yz, m.zz);
}
bool is_number(Vec3d value) { return is_finite(value); }
bool is_number(const Sym3d& m) {
  return is_finite({m.xx, m.xy, m.xz}) && is_finite({m.yy, m.yz, m.zz});
}

/// Checks the entries of an array for which `counts(i)` holds.
template <class T, class Counts, class IsGood>
void check_values(const std::string& array, const std::vector<T>& values, Counts&& counts,
                  IsGood&& is_good, const char* allowed) {
  const auto n = static_cast<Offset>(values.size());
  const Offset bad = first_bad(n, [&](Offset i) {
    return counts(static_cast<Index>(i)) && !is_good(values[static_cast<std::size_t>(i)]);
  });
  if (bad == n) return;
  refuse(fmt::format("{}[{}]", array, bad),
         fmt::format("is {}", in_words(values[static_cast<std::size_t>(bad)])), allowed);
}
template <class T>
void check_finite(const std::string& array, const std::vector<T>& values) {
  check_values(
      array, values, [](Index) { return true; }, [](const T& v) { return is_number(v); },
      "finite numbers");
}
void check_finite(const std::string& name, double value) {
  if (!std::isfinite(value)) refuse(name, fmt::format("is {:g}", value), "a finite number");
}
void check_finite(const std::string& name, Vec3d value) {
  if (!is_finite(value)) refuse(name, "is " + in_words(value), "finite numbers");
}

void check_indices(const std::string& array, std::span<const Index> indices, Index count) {
  const auto n = static_cast<Offset>(indices.size());
  const Offset bad = first_bad(n, [&](Offset k) {
    const Index i = indices[static_cast<std::size_t>(k)];
    return i < 0 || i >= count;
  });
  if (bad == n) return;
  refuse(fmt::format("{}[{}]", array, bad),
         fmt::format("is {}", indices[static_cast<std::size_t>(bad)]),
         count > 0 ? fmt::format("0 to {}", count - 1) : "no entry");
}

/// Checks that the rows of a pattern are `rows` ranges of its entries, side by side.
void check_rows(const std::string& array, const Csr& csr, std::size_t rows, const char* what) {
  check_size(array + ".offsets", csr.offsets.size(), rows + 1, what);
  if (csr.offsets.front() != 0 || csr.offsets.back() != static_cast<Offset>(csr.indices.size())) {
    refuse(array + ".offsets",
           fmt::format("are {} to {} for {} indices", csr.offsets.front(), csr.offsets.back(),
                       csr.indices.size()),
           fmt::format("0 to {}", csr.indices.size()));
  }
  const auto n = static_cast<Offset>(rows);
  const Offset bad = first_bad(n, [&](Offset i) {
    return csr.offsets[static_cast<std::size_t>(i)] > csr.offsets[static_cast<std::size_t>(i) + 1];
  });
  if (bad == n) return;
  refuse(fmt::format("{}.offsets[{}]", array, bad + 1),
         fmt::format("is {}", csr.offsets[static_cast<std::size_t>(bad) + 1]),
         fmt::format("at least {}, where the row before it ends",
                     csr.offsets[static_cast<std::size_t>(bad)]));
}

/// Parts lie side by side, and so do their surfels; bodies are numbered from 0.
void check_parts(const Model& m) {
  Index end = 0, surfel_end = 0, body = -1;
  for (std::size_t p = 0; p < m.parts.size(); ++p) {
    const Part& part = m.parts[p];
    const std::string name = fmt::format("parts[{}]", p);
    const auto range = [&](const char* what, Index begin, Index part_end, Index last) {
      if (begin == last && part_end >= begin) return;
      refuse(fmt::format("{}, {}", name, what), fmt::format("are {} to {}", begin, part_end),
             fmt::format("from {}, where the part before it ends", last));
    };
    range("its phyxels,", part.begin, part.end, end);
    range("its surfels,", part.surfel_begin, part.surfel_end, surfel_end);
    if (part.ghosts < 0 || part.ghosts > part.end - part.begin) {
      refuse(name + ".ghosts", fmt::format("is {}", part.ghosts),
             fmt::format("0 to {}", part.end - part.begin));
    }
    if (!(part.pair_length >= 0 && std::isfinite(part.pair_length)) ||
        (part.pair_length > 0 && part.size > 0 && !(part.support_cubes > 0))) {
      refuse(name + ", pair_length and support_cubes",
             fmt::format("are {:g} m and {:g} m^3", part.pair_length, part.support_cubes),
             "a finite length >= 0 and, where it is > 0, a sum > 0");
    }
    if (part.body != body && part.body != body + 1) {
      refuse(name + ".body", fmt::format("is {}", part.body),
             body < 0 ? "0" : fmt::format("{} or {}", body, body + 1));
    }
    end = part.end, surfel_end = part.surfel_end, body = part.body;
  }
  if (end != m.size()) {
    refuse("parts", fmt::format("have {} phyxels of {}", end, m.size()), "all");
  }
  if (surfel_end != static_cast<Index>(m.surfels.position.size())) {
    refuse("parts", fmt::format("have {} surfels of {}", surfel_end, m.surfels.position.size()),
           "all");
  }
}

/// Neighbours are phyxels of the same body. @param array name of the lists
void check_neighbours(const std::string& array, const Model& m, const Csr& lists) {
  check_rows(array, lists, static_cast<std::size_t>(m.size()), "phyxels");
  for (auto part = m.parts.begin(); part != m.parts.end();) {
    const std::span<const Part> body = m.parts_of_body(*part);
    const Index begin = body.front().begin, end = body.back().end;
    const Offset first = lists.offsets[static_cast<std::size_t>(begin)],
                 count = lists.offsets[static_cast<std::size_t>(end)] - first;
    const Offset bad = first_bad(count, [&](Offset k) {
      const Index j = lists.indices[static_cast<std::size_t>(first + k)];
      return j < begin || j >= end;
    });
    if (bad < count) {
      refuse(fmt::format("{}.indices[{}]", array, first + bad),
             fmt::format("is {}", lists.indices[static_cast<std::size_t>(first + bad)]),
             fmt::format("phyxels of the same body, {} to {}", begin, end - 1));
    }
    part += static_cast<std::ptrdiff_t>(body.size());
  }
}

void check_neighbourhood(const Model& m) {
  const Neighbourhood& hood = m.neighbourhood;
  const auto n = static_cast<std::size_t>(m.size());
  check_size("neighbourhood.support", hood.support.size(), n, "phyxels");
  check_values(
      "neighbourhood.support", hood.support, [](Index) { return true; },
      [](double h) { return h >= 0 && std::isfinite(h); }, ">= 0, finite");
  const bool left_to_device =
      hood.neighbours.offsets.size() == 1 && hood.neighbours.indices.empty();
  if (left_to_device) return;
  check_neighbours("neighbourhood.neighbours", m, hood.neighbours);
  if (!hood.symmetric) check_neighbours("neighbourhood.inverse_lists", m, hood.inverse_lists);
  check_size("inverse_moment", m.inverse_moment.size(), n, "phyxels");
  check_size("moment_offset", m.moment_offset.size(), n, "phyxels");
  const auto owned = [&](Index i) { return m.owns(i); };
  check_values(
      "inverse_moment", m.inverse_moment, owned, [](const Sym3d& v) { return is_number(v); },
      "finite numbers");
  check_values(
      "moment_offset", m.moment_offset, owned, [](Vec3d v) { return is_finite(v); },
      "finite numbers");
}

void check_surfels(const Model& m) {
  const Surfels& surfels = m.surfels;
  const std::size_t count = surfels.position.size();
  check_size("surfels.normal", surfels.normal.size(), count, "surfels");
  check_finite("surfels.position", surfels.position);
  check_finite("surfels.normal", surfels.normal);
  check_rows("surfels.carriers", surfels.carriers, count, "surfels");
  check_indices("surfels.carriers.indices", surfels.carriers.indices, m.size());
  if (m.share) return;  // which has no triangles of its own
  const auto triangles = static_cast<Offset>(surfels.triangle.size());
  const Offset bad = first_bad(triangles, [&](Offset t) {
    return std::ranges::any_of(surfels.triangle[static_cast<std::size_t>(t)],
                               [&](Index s) { return s < 0 || s >= static_cast<Index>(count); });
  });
  if (bad == triangles) return;
  check_indices(fmt::format("surfels.triangle[{}]", bad),
                surfels.triangle[static_cast<std::size_t>(bad)], static_cast<Index>(count));
}

void check_boundary(const Model& m) {
  for (std::size_t k = 0; k < m.motions.size(); ++k) {
    const Motion& motion = m.motions[k];
    const std::string name = fmt::format("motions[{}].", k);
    check_indices(name + "phyxels", motion.phyxels, m.size());
    check_finite(name + "displacement", motion.displacement);
    check_finite(name + "rotation", motion.rotation);
    check_finite(name + "about", motion.about);
    check_finite(name + "duration", motion.duration);
    check_finite(name + "velocity", motion.velocity);
    check_finite(name + "amplitude", motion.amplitude);
    check_finite(name + "frequency", motion.frequency);
  }
  for (std::size_t k = 0; k < m.loads.size(); ++k) {
    const Load& load = m.loads[k];
    const std::string name = fmt::format("loads[{}].", k);
    check_indices(name + "phyxels", load.phyxels, m.size());
    check_size(name + "force", load.force.size(), load.phyxels.size(), "phyxels");
    check_finite(name + "force", load.force);
    for (std::size_t p = 0; p < load.curve.points.size(); ++p) {
      const auto [time, factor] = load.curve.points[p];
      const std::string point = fmt::format("{}curve.points[{}].", name, p);
      check_finite(point + "time", time);
      check_finite(point + "factor", factor);
      if (p > 0 && !(time > load.curve.points[p - 1].time)) {
        refuse(point + "time", fmt::format("is {:g} s", time), "times that ascend");
      }
    }
  }
  check_indices("contact.phyxels", m.contact.phyxels, m.size());
  check_size("contact.offset", m.contact.offset.size(), m.contact.phyxels.size(), "phyxels");
  for (const double offset : m.contact.offset) check_finite("contact.offset", offset);
  for (std::size_t k = 0; k < m.probes.size(); ++k) {
    check_indices(fmt::format("probes[{}].phyxels", k), m.probes[k].phyxels, m.size());
    check_finite(fmt::format("probes[{}].points", k), m.probes[k].points);
  }
  check_finite("gravity", m.gravity);
}

void check_share(const Model& m) {
  const Share& share = *m.share;
  const auto n = static_cast<std::size_t>(m.size());
  check_size("share.global_id", share.global_id.size(), n, "phyxels");
  check_indices("share.global_id", share.global_id, share.global_count);
  check_size("share.owned", share.owned.size(), n, "phyxels");
  if (!share.place.empty()) check_size("share.place", share.place.size(), n, "phyxels");
  if (!share.halo) refuse("share.halo", "is missing", "the plan of the exchange");
  for (const HaloPlan::Peer& peer : share.halo->peers) {
    check_indices(fmt::format("share.halo, sent to rank {}", peer.rank), peer.send, m.size());
    check_indices(fmt::format("share.halo, received from rank {}", peer.rank), peer.receive,
                  m.size());
  }
}

}  // namespace

void check_model(const Model& m) {
  constexpr auto most = static_cast<std::size_t>(std::numeric_limits<Index>::max());
  if (m.position.size() > most) {
    refuse("position", fmt::format("has {} entries", m.position.size()),
           fmt::format("at most {}", most));
  }
  const auto n = static_cast<std::size_t>(m.size());
  if (m.share) check_share(m);
  check_finite("position", m.position);
  check_size("volume", m.volume.size(), n, "phyxels");
  check_size("mass", m.mass.size(), n, "phyxels");
  const auto owned = [&](Index i) { return m.owns(i); };
  const auto is_positive = [](double v) { return v > 0 && std::isfinite(v); };
  check_values("volume", m.volume, owned, is_positive, "> 0, finite");
  check_values("mass", m.mass, owned, is_positive, "> 0, finite");
  if (!m.closing.empty()) {
    check_size("closing", m.closing.size(), n, "phyxels");
    check_values(
        "closing", m.closing, owned, [](Vec3d v) { return is_finite(v); }, "finite numbers");
  }
  check_parts(m);
  check_neighbourhood(m);
  check_surfels(m);
  check_boundary(m);
}

}  // namespace phyxel
