#include "phyxel/fragments.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <unordered_map>

#include "exact_sum.hpp"
#include "joined_over_ranks.hpp"
#include "model/parts.hpp"
#include "phyxel/physics/moment.hpp"
#include "rank_sums.hpp"
#include "solver/fragment_labels.hpp"

namespace phyxel {
namespace {

/// The phyxels of one label on all ranks, or on one.
struct Labelled {
  Index label = 0;
  Index body = 0;     ///< Index of the body.
  Index phyxels = 0;  ///< Number of phyxels.
  auto operator<=>(const Labelled&) const = default;
};

/// The phyxels that this rank owns, sorted by label.
using Sorted = std::vector<std::array<Index, 2>>;  // label, phyxel

Sorted sorted_by_label(const Model& model, const std::vector<Index>& label) {
  Sorted all;
  for (const Part& part : model.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) all.push_back({label[i], i});
  }
  std::sort(all.begin(), all.end());
  return all;
}

/// The labels of all ranks, ascending. Collective.
std::vector<Labelled> labels_of_all(const Model& model, const Sorted& sorted) {
  std::vector<Labelled> here;
  for (const auto& [label, i] : sorted) {
    if (here.empty() || here.back().label != label) {
      here.push_back({label, part_of(model, i).body, 0});
    }
    ++here.back().phyxels;
  }
  if (!model.share) return here;
  std::vector<Labelled> all;
  for (const Labelled& of_rank : joined_over_ranks(*model.share->communicator, here)) {
    if (all.empty() || all.back().label != of_rank.label) {
      all.push_back(of_rank);
    } else {
      all.back().phyxels += of_rank.phyxels;
    }
  }
  return all;
}

/// The fragments of a model and their phyxels of this rank, without what sums tell of them.
class Fragments {
 public:
  /// Collective on a share.
  Fragments(const Model& model, const std::vector<Index>& label) : model_(model) {
    const Sorted sorted = sorted_by_label(model, label);
    std::map<Index, std::size_t> dust_of_body;
    std::unordered_map<Index, std::size_t> group_of;
    for (const Labelled& one : labels_of_all(model, sorted)) {
      const bool is_dust = one.phyxels == 1;
      const auto known = dust_of_body.find(one.body);
      const bool is_new = !is_dust || known == dust_of_body.end();
      const std::size_t group = is_new ? readings_.size() : known->second;
      if (is_new) {
        readings_.push_back({.body = name_of(one.body), .number = is_dust ? 0 : 1});
        readings_.back().first = one.label;
      }
      if (is_dust) dust_of_body.emplace(one.body, group);
      readings_[group].phyxels += one.phyxels;
      group_of[one.label] = group;
    }
    phyxels_.resize(readings_.size());
    for (const auto& [own_label, i] : sorted) phyxels_[group_of.at(own_label)].push_back(i);
    for_each_sum<1>(
        [&](std::size_t, Index i) { return std::array{model_.mass[i]}; },
        [&](std::size_t k, const std::array<double, 1>& sum) { readings_[k].mass = sum[0]; });
    number_by_mass();
  }

  std::vector<FragmentReading>& readings() { return readings_; }
  /// The phyxels of fragment k that this rank owns.
  std::span<const Index> phyxels(std::size_t k) const { return phyxels_[k]; }

  /// Calls use(k, sums) with exact sums of term(k, i), arrays of `width` numbers, over the phyxels
  /// i of each fragment k. Collective on a share.
  template <std::size_t width, class Term, class Use>
  void for_each_sum(Term&& term, Use&& use) const {
    constexpr std::size_t at_once = 256;  // an exact sum has half a kilobyte
    for (std::size_t begin = 0; begin < readings_.size(); begin += at_once) {
      const std::size_t end = std::min(begin + at_once, readings_.size());
      std::vector<ExactSum> sums(width * (end - begin));
      for (std::size_t k = begin; k < end; ++k) add<width>(k, term, &sums[width * (k - begin)]);
      add_over_ranks(model_, sums);
      for (std::size_t k = begin; k < end; ++k) {
        std::array<double, width> values;
        for (std::size_t c = 0; c < width; ++c) values[c] = sums[width * (k - begin) + c].value();
        use(k, values);
      }
    }
  }

 private:
  const std::string& name_of(Index body) const {
    return std::find_if(model_.parts.begin(), model_.parts.end(),
                        [&](const Part& part) { return part.body == body; })
        ->name;
  }

  template <std::size_t width, class Term>
  void add(std::size_t k, Term&& term, ExactSum* sums) const {
    const std::vector<Index>& of_group = phyxels_[k];
    constexpr std::size_t worth_threads = 4096;
#pragma omp parallel if (of_group.size() > worth_threads)
    {
      std::array<ExactSum, width> own;
#pragma omp for schedule(static) nowait
      for (std::size_t at = 0; at < of_group.size(); ++at) {
        const std::array<double, width> terms = term(k, of_group[at]);
        for (std::size_t c = 0; c < width; ++c) own[c].add(terms[c]);
      }
#pragma omp critical
      for (std::size_t c = 0; c < width; ++c) sums[c].add(own[c]);
    }
  }

  /// Sorts fragments by mass, puts dust at the end, and numbers them.
  void number_by_mass() {
    std::vector<std::size_t> order(readings_.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      const FragmentReading &x = readings_[a], &y = readings_[b];
      if (x.is_dust() || y.is_dust()) return !x.is_dust() && y.is_dust();
      return x.mass > y.mass;
    });
    std::vector<FragmentReading> readings;
    std::vector<std::vector<Index>> phyxels;
    for (const std::size_t k : order) {
      readings.push_back(std::move(readings_[k]));
      phyxels.push_back(std::move(phyxels_[k]));
      if (!readings.back().is_dust()) readings.back().number = static_cast<Index>(readings.size());
    }
    readings_ = std::move(readings);
    phyxels_ = std::move(phyxels);
  }

  const Model& model_;
  std::vector<FragmentReading> readings_;
  std::vector<std::vector<Index>> phyxels_;  // of each reading
};

Fragments fragments_of(const Model& model, const State& state) {
  return {model, fragment_labels(model, state.broken)};
}

/// Finds centres and velocities, and then, about these, angular momenta and spins.
void find_motion(const Model& model, const State& state, Fragments& fragments) {
  std::vector<FragmentReading>& all = fragments.readings();
  const auto place = [&](Index i) { return model.position[i] + state.displacement[i]; };
  fragments.for_each_sum<6>(
      [&](std::size_t, Index i) {
        const Vec3d x = model.mass[i] * place(i), v = model.mass[i] * state.velocity[i];
        return std::array{x.x, x.y, x.z, v.x, v.y, v.z};
      },
      [&](std::size_t k, const std::array<double, 6>& sum) {
        all[k].centre = (1 / all[k].mass) * Vec3d{sum[0], sum[1], sum[2]};
        all[k].velocity = (1 / all[k].mass) * Vec3d{sum[3], sum[4], sum[5]};
      });
  fragments.for_each_sum<9>(
      [&](std::size_t k, Index i) {
        const Vec3d r = place(i) - all[k].centre;
        const double m = model.mass[i];
        const Vec3d l = m * cross(r, state.velocity[i] - all[k].velocity);
        return std::array{l.x,
                          l.y,
                          l.z,
                          m * (r.y * r.y + r.z * r.z),
                          m * (r.z * r.z + r.x * r.x),
                          m * (r.x * r.x + r.y * r.y),
                          -m * r.x * r.y,
                          -m * r.x * r.z,
                          -m * r.y * r.z};
      },
      [&](std::size_t k, const std::array<double, 9>& sum) {
        all[k].angular_momentum = {sum[0], sum[1], sum[2]};
        Sym3d inertia;
        inertia.xx = sum[3], inertia.yy = sum[4], inertia.zz = sum[5];
        inertia.xy = sum[6], inertia.xz = sum[7], inertia.yz = sum[8];
        const double none = std::numeric_limits<double>::quiet_NaN();
        // A row of phyxels has no inertia about itself.
        all[k].spin = all[k].is_dust() ? Vec3d{none, none, none}
                                       : pseudo_inverse(inertia).matrix * all[k].angular_momentum;
      });
}

}  // namespace

std::vector<FragmentReading> read_fragments(const Model& model, const Backend& backend) {
  if (!model.fracture.acts()) return {};
  State state;
  backend.download(state);
  Fragments fragments = fragments_of(model, state);
  find_motion(model, state, fragments);
  return std::move(fragments.readings());
}

std::vector<double> fragment_numbers(const Model& model, const Backend& backend) {
  std::vector<double> numbers(static_cast<std::size_t>(model.size()), 0);
  if (!model.fracture.acts()) return numbers;
  State state;
  backend.download(state);
  Fragments fragments = fragments_of(model, state);
  for (std::size_t k = 0; k < fragments.readings().size(); ++k) {
    for (const Index i : fragments.phyxels(k)) numbers[i] = fragments.readings()[k].number;
  }
  return numbers;
}

FragmentTotals totals_of(std::span<const FragmentReading> readings) {
  FragmentTotals totals;
  double mass = 0, dust = 0;
  for (const FragmentReading& reading : readings) {
    mass += reading.mass;
    if (reading.is_dust()) {
      totals.dust += reading.phyxels;
      dust += reading.mass;
    } else {
      ++totals.fragments;
    }
  }
  if (mass > 0 && totals.fragments > 0) totals.largest_share = readings.front().mass / mass;
  if (mass > 0) totals.dust_share = dust / mass;
  return totals;
}

std::span<const FragmentColumn> fragment_columns() {
  using F = const FragmentReading&;
  static const FragmentColumn columns[] = {
      {"first_phyxel", "", [](F f) { return static_cast<double>(f.first); }},
      {"phyxels", "", [](F f) { return static_cast<double>(f.phyxels); }},
      {"mass", "kg", [](F f) { return f.mass; }},
      {"centre_x", "m", [](F f) { return f.centre.x; }},
      {"centre_y", "m", [](F f) { return f.centre.y; }},
      {"centre_z", "m", [](F f) { return f.centre.z; }},
      {"velocity_x", "m/s", [](F f) { return f.velocity.x; }},
      {"velocity_y", "m/s", [](F f) { return f.velocity.y; }},
      {"velocity_z", "m/s", [](F f) { return f.velocity.z; }},
      {"angular_momentum_x", "kg m^2/s", [](F f) { return f.angular_momentum.x; }},
      {"angular_momentum_y", "kg m^2/s", [](F f) { return f.angular_momentum.y; }},
      {"angular_momentum_z", "kg m^2/s", [](F f) { return f.angular_momentum.z; }},
      {"spin_x", "rad/s", [](F f) { return f.spin.x; }},
      {"spin_y", "rad/s", [](F f) { return f.spin.y; }},
      {"spin_z", "rad/s", [](F f) { return f.spin.z; }},
  };
  return columns;
}

}  // namespace phyxel
