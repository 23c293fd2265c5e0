#include "phyxel/output_fields.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <unordered_map>

#include "model/nearest_carrier.hpp"
#include "model/owned_vectors.hpp"
#include "model/parts.hpp"
#include "model/point_fit.hpp"
#include "phyxel/history.hpp"
#include "solver/carrier_weights.hpp"
#include "solver/crack_sides.hpp"
#include "solver/tensors.hpp"

namespace phyxel {

/// The shares of phyxels in the values of surfels.
class OutputFields::SurfaceFit {
 public:
  explicit SurfaceFit(const Model& model) : model_(model) {
    const Surfels& surfels = model.surfels;
    const auto count = static_cast<Index>(surfels.position.size());
    std::vector<std::vector<Index>> rows(surfels.position.size());
    std::vector<std::vector<double>> shares(surfels.position.size());
    depth_.resize(surfels.position.size());
#pragma omp parallel for schedule(dynamic, 256)
    for (Index s = 0; s < count; ++s) {
      rows[s] = nearest_first(surfels.position[s], surfels.carriers.row(s));
      std::vector<Vec3d> places;
      for (const Index i : rows[s]) places.push_back(model.position[i]);
      if (rows[s].empty()) continue;
      shares[s] =
          shares_at(surfels.position[s], places, model.neighbourhood.support[rows[s].front()]);
      depth_[s] = depth_below(s, rows[s]);
    }
    for (Index s = 0; s < count; ++s) {
      near_.indices.insert(near_.indices.end(), rows[s].begin(), rows[s].end());
      near_.offsets.push_back(static_cast<Offset>(near_.indices.size()));
      share_.insert(share_.end(), shares[s].begin(), shares[s].end());
    }
  }

  /// The weights of the carriers of those surfels from which cracks have cut some.
  using CutWeights = std::unordered_map<Index, std::vector<double>>;
  CutWeights cut_by(const CrackSides& sides) const {
    CutWeights cut;
    for (Index s = 0; s < near_.rows() && !sides.empty(); ++s) {
      const std::vector<char> kept = sides.on_side(model_, s);
      if (std::find(kept.begin(), kept.end(), 0) == kept.end()) continue;
      cut[s] = carrier_weights(model_, s, sides);
    }
    return cut;
  }

  /// Values fitted to those of the phyxels around, shape [surfels, width]; of surfels beside cracks
  /// the weighted mean of the carriers that are left. Collective on a share.
  /// @param of_phyxels shape [n, width]; those of ghosts do not matter
  template <std::size_t width>
  std::vector<double> fitted(const std::vector<double>& of_phyxels, const CutWeights& cut) const {
    const auto value = with_ghosts<width>(of_phyxels);
    return for_each_surfel<width>([&](Index s, std::span<const Index> row, std::size_t c) {
      if (const auto found = cut.find(s); found != cut.end()) {
        return mean(found->second, model_.surfels.carriers.row(s),
                    [&](Index i) { return value[i][c]; });
      }
      double sum = 0;
      for (std::size_t k = 0; k < row.size(); ++k) {
        sum += share_[static_cast<std::size_t>(near_.offsets[s]) + k] * value[row[k]][c];
      }
      return in_range(sum, s, row, [&](Index i) { return value[i][c]; });
    });
  }
  /// The values of the nearest phyxels, shape [surfels]. Collective on a share.
  std::vector<double> nearest(const std::vector<double>& of_phyxels) const {
    const auto value = with_ghosts<1>(of_phyxels);
    return for_each_surfel<1>(
        [&](Index, std::span<const Index> row, std::size_t) { return value[row.front()][0]; });
  }
  /// Values of surfels, shape [surfels], within the range of the phyxels around. Collective on a
  /// share.
  std::vector<double> in_range_of(const std::vector<double>& of_phyxels,
                                  const std::vector<double>& of_surfels) const {
    const auto value = with_ghosts<1>(of_phyxels);
    return for_each_surfel<1>([&](Index s, std::span<const Index> row, std::size_t) {
      return in_range(of_surfels[s], s, row, [&](Index i) { return value[i][0]; });
    });
  }

 private:
  /// The carriers of the same part as the nearest, in an order that does not depend on ranks.
  std::vector<Index> nearest_first(Vec3d point, std::span<const Index> carriers) const {
    std::vector<Index> row(carriers.begin(), carriers.end());
    std::sort(row.begin(), row.end(),
              [&](Index a, Index b) { return is_nearer(model_, point, a, b); });
    std::erase_if(row, [first = row.empty() ? 0 : row.front(), this](Index i) {
      return !are_of_one_part(model_, first, i);
    });
    return row;
  }

  /// How far the highest of some phyxels lies below a surfel, in the height from the lowest to it;
  /// 0 if one does not lie below, or if all are equally high.
  double depth_below(Index s, std::span<const Index> row) const {
    const Surfels& surfels = model_.surfels;
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (const Index i : row) {
      const double depth = dot(surfels.normal[s], surfels.position[s] - model_.position[i]);
      least = std::min(least, depth);
      most = std::max(most, depth);
    }
    return least > 0 && most > least ? std::min(1.0, least / (most - least)) : 0;
  }

  template <std::size_t width>
  std::vector<std::array<double, width>> with_ghosts(const std::vector<double>& values) const {
    std::vector<std::array<double, width>> value(values.size() / width);
    for (std::size_t k = 0; k < values.size(); ++k) value[k / width][k % width] = values[k];
    if (model_.share) refresh_ghosts(*model_.share, value);
    return value;
  }

  /// Calls value_of(surfel, phyxels around it, component).
  template <std::size_t width, class ValueOf>
  std::vector<double> for_each_surfel(ValueOf&& value_of) const {
    std::vector<double> found(width * static_cast<std::size_t>(near_.rows()), 0);
#pragma omp parallel for schedule(static)
    for (Index s = 0; s < near_.rows(); ++s) {
      const std::span<const Index> row = near_.row(s);
      for (std::size_t c = 0; c < width && !row.empty(); ++c) {
        found[width * static_cast<std::size_t>(s) + c] = value_of(s, row, c);
      }
    }
    return found;
  }

  template <class ValueOf>
  static double mean(const std::vector<double>& weights, std::span<const Index> row,
                     ValueOf&& value_of) {
    double sum = 0, all = 0;
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (weights[k] > 0) sum += weights[k] * value_of(row[k]);
      all += weights[k];
    }
    return sum / all;
  }

  template <class ValueOf>
  double in_range(double value, Index s, std::span<const Index> row, ValueOf&& value_of) const {
    double least = value_of(row.front()), most = least;
    for (const Index i : row) {
      least = std::min(least, value_of(i));
      most = std::max(most, value_of(i));
    }
    const double beyond = depth_[s] * (most - least);
    // What is nowhere negative, as an equivalent plastic strain, stays so.
    const double low = least < 0 ? least - beyond : std::max(0.0, least - beyond);
    return std::clamp(value, low, most + beyond);
  }

  const Model& model_;
  Csr near_;  // row s: the phyxels around surfel s, the nearest first
  std::vector<double> share_;
  std::vector<double> depth_;  // of the phyxels below each surfel (`depth_below`)
};

namespace {

bool follows_from_stress(Quantity quantity) {
  return quantity == Quantity::von_mises || quantity == Quantity::principal_stress;
}

bool contains(std::span<const Quantity> list, Quantity quantity) {
  return std::find(list.begin(), list.end(), quantity) != list.end();
}

/// The components of vectors, shape [n, 3].
std::vector<double> flat(const std::vector<Vec3d>& vectors) {
  std::vector<double> numbers;
  numbers.reserve(3 * vectors.size());
  for (const Vec3d& v : vectors) numbers.insert(numbers.end(), {v.x, v.y, v.z});
  return numbers;
}

/// Von Mises or principal stresses of stress tensors. @param stress shape [n, 6]
std::vector<double> of_stress(Quantity quantity, const std::vector<double>& stress) {
  const std::size_t width = width_of(quantity);
  std::vector<double> found(stress.size() / 6 * width);
  for (std::size_t k = 0; k < stress.size() / 6; ++k) {
    std::array<double, 6> tensor;
    std::copy_n(stress.begin() + static_cast<std::ptrdiff_t>(6 * k), 6, tensor.begin());
    if (width == 1) {
      found[k] = von_mises_stress(matrix_of(tensor));
    } else {
      const auto principal = principal_values(matrix_of(tensor));
      std::copy(principal.begin(), principal.end(),
                found.begin() + static_cast<std::ptrdiff_t>(3 * k));
    }
  }
  return found;
}

}  // namespace

OutputFields::OutputFields(const Model& model, const OutputRequest& output)
    : model_(model), wanted_(wanted_fields(output)) {
  quantities_ = wanted_;
  if (!output.surface || model.global_surfel_count() == 0) return;
  has_displacement_ = output.wants("displacement");
  if (output.wants("history")) columns_ = history_columns(model).size();
  if (has_displacement_) quantities_.push_back(on_surface(Quantity::displacement));
  if (output.wants("velocity")) quantities_.push_back(on_surface(Quantity::velocity));
  for (const Quantity q : wanted_) quantities_.push_back(on_surface(q));
  for (std::size_t k = 0; k < columns_; ++k) {
    quantities_.push_back(on_surface(history_quantity(k)));
  }
}

OutputFields::~OutputFields() = default;

FieldValues OutputFields::find(Backend& backend, const State& state, const SurfelState* surfels,
                               const Recovery* recovery) const {
  std::vector<Quantity> needed = wanted_;
  const bool adds_stress = surfels && !contains(wanted_, Quantity::stress) &&
                           std::any_of(wanted_.begin(), wanted_.end(), follows_from_stress);
  if (adds_stress) needed.push_back(Quantity::stress);
  FieldValues found = find_fields(model_, backend, needed, recovery);
  if (!surfels) return found;
  if (has_displacement_) {
    std::vector<Vec3d> way = surfels->position;
    for (std::size_t s = 0; s < way.size(); ++s) way[s] -= model_.surfels.position[s];
    found[on_surface(Quantity::displacement)] = flat(way);
  }
  const bool has_velocity = contains(quantities_, on_surface(Quantity::velocity));
  if (wanted_.empty() && columns_ == 0 && !has_velocity) return found;
  if (!surface_) surface_ = std::make_unique<const SurfaceFit>(model_);
  const auto cut = surface_->cut_by({model_, state.broken});
  if (has_velocity) {
    found[on_surface(Quantity::velocity)] = surface_->fitted<3>(flat(state.velocity), cut);
  }
  std::vector<double> stress;
  if (contains(needed, Quantity::stress)) {
    stress = surface_->fitted<6>(found[Quantity::stress], cut);
  }
  if (adds_stress) found.erase(Quantity::stress);
  for (const Quantity q : wanted_) {
    std::vector<double>& of_surfels = found[on_surface(q)];
    if (q == Quantity::stress) {
      of_surfels = stress;
    } else if (q == Quantity::von_mises) {
      of_surfels = surface_->in_range_of(found[q], of_stress(q, stress));
    } else if (q == Quantity::principal_stress) {
      of_surfels = of_stress(q, stress);
    } else if (q == Quantity::boundary || q == Quantity::fragment) {
      of_surfels = surface_->nearest(found[q]);
    } else {
      of_surfels = width_of(q) == 6 ? surface_->fitted<6>(found[q], cut)
                                    : surface_->fitted<1>(found[q], cut);
    }
  }
  for (std::size_t k = 0; k < std::min(columns_, state.history.size()); ++k) {
    found[on_surface(history_quantity(k))] = surface_->fitted<1>(state.history[k].values, cut);
  }
  return found;
}

}  // namespace phyxel
