#include "phyxel/output_fields.hpp"

#include <algorithm>
#include <array>

#include "model/owned_vectors.hpp"
#include "model/parts.hpp"
#include "model/point_fit.hpp"
#include "phyxel/history.hpp"
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
#pragma omp parallel for schedule(dynamic, 256)
    for (Index s = 0; s < count; ++s) {
      rows[s] = nearest_first(surfels.position[s], surfels.carriers.row(s));
      std::vector<Vec3d> places;
      for (const Index i : rows[s]) places.push_back(model.position[i]);
      if (rows[s].empty()) continue;
      shares[s] =
          shares_at(surfels.position[s], places, model.neighbourhood.support[rows[s].front()]);
    }
    for (Index s = 0; s < count; ++s) {
      near_.indices.insert(near_.indices.end(), rows[s].begin(), rows[s].end());
      near_.offsets.push_back(static_cast<Offset>(near_.indices.size()));
      share_.insert(share_.end(), shares[s].begin(), shares[s].end());
    }
  }

  /// How a value follows from those of the phyxels around.
  enum class Way { fitted, nearest };

  /// The values of surfels, shape [surfels, width]. Collective on a share.
  /// @param of_phyxels shape [n, width]; those of ghosts do not matter
  template <std::size_t width>
  std::vector<double> values(const std::vector<double>& of_phyxels, Way way) const {
    using Entry = std::array<double, width>;
    std::vector<Entry> value(of_phyxels.size() / width);
    for (std::size_t k = 0; k < of_phyxels.size(); ++k) value[k / width][k % width] = of_phyxels[k];
    if (model_.share) refresh_ghosts(*model_.share, value);
    std::vector<double> found(width * static_cast<std::size_t>(near_.rows()), 0);
#pragma omp parallel for schedule(static)
    for (Index s = 0; s < near_.rows(); ++s) {
      const std::span<const Index> row = near_.row(s);
      if (row.empty()) continue;
      for (std::size_t c = 0; c < width; ++c) {
        double sum = 0, least = value[row.front()][c], most = least;
        for (std::size_t k = 0; k < row.size(); ++k) {
          const double here = value[row[k]][c];
          sum += share_[static_cast<std::size_t>(near_.offsets[s]) + k] * here;
          least = std::min(least, here);
          most = std::max(most, here);
        }
        found[width * static_cast<std::size_t>(s) + c] =
            way == Way::nearest ? value[row.front()][c] : std::clamp(sum, least, most);
      }
    }
    return found;
  }

 private:
  /// The carriers of the same part as the nearest, in an order that does not depend on ranks.
  std::vector<Index> nearest_first(Vec3d point, std::span<const Index> carriers) const {
    std::vector<Index> row(carriers.begin(), carriers.end());
    const auto is_nearer = [&](Index a, Index b) {
      const Vec3d x = model_.position[a] - point, y = model_.position[b] - point;
      const double to_a = dot(x, x), to_b = dot(y, y);
      return to_a != to_b ? to_a < to_b : model_.global_id(a) < model_.global_id(b);
    };
    std::sort(row.begin(), row.end(), is_nearer);
    std::erase_if(row, [first = row.empty() ? 0 : row.front(), this](Index i) {
      return !are_of_one_part(model_, first, i);
    });
    return row;
  }

  const Model& model_;
  Csr near_;  // row s: the phyxels around surfel s, the nearest first
  std::vector<double> share_;
};

namespace {

bool follows_from_stress(Quantity quantity) {
  return quantity == Quantity::von_mises || quantity == Quantity::principal_stress;
}

bool contains(std::span<const Quantity> list, Quantity quantity) {
  return std::find(list.begin(), list.end(), quantity) != list.end();
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
  if (output.wants("history")) history_ = history_columns(model);
  if (has_displacement_) quantities_.push_back(on_surface(Quantity::displacement));
  for (const Quantity q : wanted_) quantities_.push_back(on_surface(q));
  for (std::size_t k = 0; k < history_.size(); ++k) {
    quantities_.push_back(on_surface(history_quantity(k)));
  }
  if (!wanted_.empty() || !history_.empty()) surface_ = std::make_unique<SurfaceFit>(model);
}

OutputFields::~OutputFields() = default;

FieldValues OutputFields::find(Backend& backend, const SurfelState* surfels,
                               const Recovery* recovery) const {
  std::vector<Quantity> needed = wanted_;
  const bool adds_stress = surfels && surface_ && !contains(wanted_, Quantity::stress) &&
                           std::any_of(wanted_.begin(), wanted_.end(), follows_from_stress);
  if (adds_stress) needed.push_back(Quantity::stress);
  for (std::size_t k = 0; surfels && k < history_.size(); ++k) {
    needed.push_back(history_quantity(k));
  }
  FieldValues found = find_fields(model_, backend, needed, recovery);
  if (!surfels) return found;
  if (has_displacement_) {
    std::vector<double>& way = found[on_surface(Quantity::displacement)];
    for (std::size_t s = 0; s < surfels->position.size(); ++s) {
      const Vec3d u = surfels->position[s] - model_.surfels.position[s];
      way.insert(way.end(), {u.x, u.y, u.z});
    }
  }
  if (!surface_) return found;
  std::vector<double> stress;
  if (contains(needed, Quantity::stress)) {
    stress = surface_->values<6>(found[Quantity::stress], SurfaceFit::Way::fitted);
  }
  if (adds_stress) found.erase(Quantity::stress);
  for (const Quantity q : wanted_) {
    std::vector<double>& of_surfels = found[on_surface(q)];
    if (q == Quantity::stress) {
      of_surfels = stress;
    } else if (follows_from_stress(q)) {
      of_surfels = of_stress(q, stress);
    } else if (width_of(q) == 6) {
      of_surfels = surface_->values<6>(found[q], SurfaceFit::Way::fitted);
    } else {
      of_surfels = surface_->values<1>(
          found[q], q == Quantity::boundary ? SurfaceFit::Way::nearest : SurfaceFit::Way::fitted);
    }
  }
  for (std::size_t k = 0; k < history_.size(); ++k) {
    const Quantity number = history_quantity(k);
    found[on_surface(number)] = surface_->values<1>(found[number], SurfaceFit::Way::fitted);
    found.erase(number);  // frames of phyxels show the state's
  }
  return found;
}

}  // namespace phyxel
