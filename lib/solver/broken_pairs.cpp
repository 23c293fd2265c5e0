#include "solver/broken_pairs.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "joined_over_ranks.hpp"
#include "model/row_moment.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/point.hpp"
#include "solver/hourglass.hpp"

namespace phyxel {

std::span<const Index> BrokenPairs::of(Index i) const {
  const auto found = broken_.find(i);
  if (found == broken_.end()) return {};
  return found->second.neighbours;
}

std::vector<Index> BrokenPairs::phyxels() const {
  std::vector<Index> all;
  for (const auto& [i, of_phyxel] : broken_) all.push_back(i);
  std::sort(all.begin(), all.end());
  return all;
}

std::vector<PhyxelPair> BrokenPairs::pairs() const {
  std::vector<PhyxelPair> all;
  for (const auto& [i, of_phyxel] : broken_) {
    const Index a = model_.global_id(i);
    for (const Index j : of_phyxel.neighbours) {
      const Index b = model_.global_id(j);
      // A pair whose two phyxels are stepped here is listed once.
      if (a < b || !model_.owns(j)) all.push_back({std::min(a, b), std::max(a, b)});
    }
  }
  std::sort(all.begin(), all.end());
  return all;
}

std::vector<WornPhyxel> BrokenPairs::worn() const {
  std::vector<WornPhyxel> all;
  for (const auto& [i, of_phyxel] : broken_) {
    if (of_phyxel.carried < 1) all.push_back({model_.global_id(i), of_phyxel.carried});
  }
  std::sort(all.begin(), all.end());
  return all;
}

std::unordered_map<Index, Index> BrokenPairs::indices_of(std::span<const PhyxelPair> pairs) const {
  std::unordered_map<Index, Index> here;
  for (const auto& [a, b] : pairs) {
    here.emplace(a, -1);
    here.emplace(b, -1);
  }
  if (here.empty()) return here;
  for (Index i = 0; i < model_.size(); ++i) {
    if (const auto at = here.find(model_.global_id(i)); at != here.end()) at->second = i;
  }
  return here;
}

void BrokenPairs::set(std::span<const PhyxelPair> pairs, std::span<const WornPhyxel> worn) {
  std::unordered_map<Index, OfPhyxel> next;
  const std::unordered_map<Index, Index> here = indices_of(pairs);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const auto [a, b] = pairs[k];
    const auto refuse = [&, first = a, second = b](const char* why) {
      throw InputError(
          fmt::format("broken pair {} of a state, phyxels {} and {}, {}", k, first, second, why));
    };
    if (k > 0 && !(pairs[k - 1] < pairs[k])) refuse("is out of order; allowed: ascending pairs");
    const Index i = here.at(a), j = here.at(b);
    for (const auto& [from, to] : {std::pair{i, j}, std::pair{j, i}}) {
      if (from < 0 || !model_.owns(from)) continue;
      const auto row = model_.neighbourhood.neighbours.row(from);
      if (!std::binary_search(row.begin(), row.end(), to) &&
          std::find(row.begin(), row.end(), to) == row.end()) {
        refuse("is no pair of neighbours; allowed: neighbours of the model");
      }
      next[from].neighbours.push_back(to);
    }
  }
  for (auto& [i, of_phyxel] : next) {
    std::sort(of_phyxel.neighbours.begin(), of_phyxel.neighbours.end());
  }
  for (const WornPhyxel& of_state : worn) {
    const auto at = here.find(of_state.phyxel);
    if (at == here.end()) {
      throw InputError(
          fmt::format("worn phyxel {} of a state has no broken pair; allowed: phyxels of "
                      "broken pairs",
                      of_state.phyxel));
    }
    if (const auto found = next.find(at->second); found != next.end()) {
      found->second.carried = of_state.carried;
    }
  }
  broken_ = std::move(next);
}

void BrokenPairs::add(Index i, std::span<const Index> neighbours) {
  std::vector<Index>& all = broken_[i].neighbours;
  all.insert(all.end(), neighbours.begin(), neighbours.end());
  std::sort(all.begin(), all.end());
}

PointBreakage BrokenPairs::of_point(Index i) const {
  const std::span<const Index> broken = of(i);
  const Vec3d closing = model_.closing.empty() ? Vec3d{} : model_.closing[i];
  if (broken.empty()) return {model_.inverse_moment[i], model_.moment_offset[i], closing, 1};
  const RowMoment sums = moment_of_row(
      model_, i, [&](Index j) { return !std::binary_search(broken.begin(), broken.end(), j); });
  const PseudoInverse<double> inverse = pseudo_inverse(sums.moment);
  const PseudoInverse<double> intact =
      pseudo_inverse(moment_of_row(model_, i, [](Index) { return true; }).moment);
  const double most = broken_.at(i).carried;
  return {inverse.matrix, sums.offset, {}, std::min(most, carried_share(inverse, intact))};
}

double BrokenPairs::share(Index i) const {
  const Index all = model_.neighbourhood.neighbours.length(i);
  return all == 0 ? 0 : static_cast<double>(of(i).size()) / all;
}

std::size_t BrokenPairs::bytes() const {
  std::size_t bytes = 0;
  for (const auto& [i, of_phyxel] : broken_) {
    bytes += sizeof(i) + sizeof(of_phyxel) + of_phyxel.neighbours.capacity() * sizeof(Index);
  }
  return bytes;
}

std::vector<char> breaking_bodies(const Model& model) {
  const std::vector<double>& growth = model.fracture.growth;
  std::vector<char> breaks;
  for (const Part& part : model.parts) {
    const auto body = static_cast<std::size_t>(part.body);
    breaks.resize(std::max(breaks.size(), body + 1), 0);
    if (growth.empty()) continue;
    breaks[body] |= std::any_of(growth.begin() + part.begin, growth.begin() + part.end,
                                [](double g) { return g > 0; });
  }
  return breaks;
}

std::vector<PhyxelPair> joined_pairs(const Model& model, std::vector<PhyxelPair> here) {
  if (!model.share) return here;
  std::vector<PhyxelPair> all = joined_over_ranks(*model.share->communicator, here);
  // A pair of two ranks is in the lists of both.
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

CrackFaces::CrackFaces(const Model& model) : model_(model) {
  for (const Part& part : model.parts) {
    const double speed = pressure_wave_speed(part.material);
    moduli_.push_back(part.material.density * speed * speed);
  }
}

PointEnergies::PointEnergies(const Model& model) : model_(model) {
  for (const Part& part : model.parts) {
    laws_.emplace_back(part.material);
    hourglass_.push_back(hourglass_stiffness(model, part));
  }
}

PointEnergy PointEnergies::of_row(Index i, const BrokenPairs& broken, const PointBreakage& at,
                                  std::span<const Vec3d> u) const {
  const Part& part = part_of(model_, i);
  const auto number = static_cast<std::size_t>(&part - model_.parts.data());
  const std::span<const Index> row = model_.neighbourhood.neighbours.row(i), gone = broken.of(i);
  const RowWeights weights(model_.neighbourhood.support.data(), i, part.pair_length);
  const auto for_each = [&](auto&& visit) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (std::binary_search(gone.begin(), gone.end(), row[k])) continue;
      const Vec3d x = model_.position[row[k]] - model_.position[i];
      visit(x, u[k], weights(row[k], dot(x, x)));
    }
  };
  const PointConstants<double> constants{model_.volume[i], at.inverse_moment, hourglass_[number],
                                         at.moment_offset, at.closing};
  return point_energy(for_each, constants,
                      [&](const Mat3d& grad_u) { return laws_[number].after_step(grad_u, {}, 0); });
}

}  // namespace phyxel
