/// The material of a part in double, for sums over phyxels: a caller's law or a built-in one, with
/// its history, volume conservation and viscosity.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "phyxel/custom_law.hpp"
#include "phyxel/history.hpp"
#include "phyxel/law_table.hpp"

namespace phyxel {

/// A material ready for evaluation. The material must outlive it.
class PartLaw {
 public:
  explicit PartLaw(const Material& material)
      : material_(material), custom_(material.custom_law.get()) {
    if (custom_) {
      custom_numbers_ = custom_->history().size();
    } else {
      chosen_ = chosen_law(material);
    }
  }
  /// The caller's law; null for a built-in one.
  const CustomLaw* custom() const { return custom_; }
  /// The index in `Laws` and the constants of a built-in law.
  const ChosenLaw& chosen() const { return chosen_; }

  /// The response at the end of a step of `dt` [s].
  /// @param history the phyxel's history at the start of the step, in the law's order
  PointResponse<double> after_step(const Mat3d& grad_u, std::span<double> history,
                                   double dt) const {
    if (custom_) return of_custom(grad_u, history, dt);
    return response_after_step<double>(
        chosen_.index, chosen_.constants.data(), grad_u,
        [&](int k) { return history[static_cast<std::size_t>(k)]; }, dt);
  }

 private:
  PointResponse<double> of_custom(const Mat3d& grad_u, std::span<double> history, double dt) const {
    PointResponse<double> response;
    const std::span<double> own = history.first(custom_numbers_);
    if (own.empty()) {
      response.first_piola_stress = custom_->first_piola_stress(grad_u);
      response.strain_energy = custom_->energy(grad_u);
    } else {
      response.first_piola_stress = custom_->first_piola_stress(grad_u, own, dt);
      response.strain_energy = custom_->energy(grad_u, std::span<const double>(own));
      response.plastic_work = custom_->plastic_work(own);
    }
    const double stiffness = material_.volume_stiffness;
    // Volume conservation and viscosity are evaluated with Hooke's law in place of the caller's,
    // and Hooke's stress is subtracted.
    const std::array<double, 4> beside{material_.lame_lambda(), material_.lame_mu(), stiffness,
                                       material_.viscosity};
    if (stiffness > 0 || material_.viscosity > 0) {
      const auto number = [&](int k) {
        return history[custom_numbers_ + static_cast<std::size_t>(k)];
      };
      constexpr int hooke = Laws::index_of<SmallStrain>;
      const PointResponse<double> with =
          response_after_step<double>(hooke, beside.data(), grad_u, number, dt);
      const Mat3d of_hooke = SmallStrain<double>{{beside[0], beside[1]}}.first_piola_stress(grad_u);
      response.first_piola_stress += with.first_piola_stress + (-1.0) * of_hooke;
      response.volume_energy = with.volume_energy;
      response.viscous_work = with.viscous_work;
    }
    return response;
  }

  const Material& material_;
  const CustomLaw* custom_;
  std::size_t custom_numbers_ = 0;
  ChosenLaw chosen_;
};

/// The history of a part's phyxels in a state, one after the other.
class PartHistory {
 public:
  /// @param columns of `history_columns`. The state must outlive this.
  PartHistory(const State& state, const Material& material,
              const std::vector<std::string>& columns) {
    for (const std::size_t column : columns_of(material, columns)) {
      columns_.push_back(state.history.empty() ? nullptr : state.history[column].values.data());
    }
  }
  /// The number of history values of a phyxel.
  std::size_t size() const { return columns_.size(); }
  /// Returns the history of phyxel i. @param numbers buffer for it
  std::span<double> of(Index i, std::span<double> numbers) const {
    for (std::size_t k = 0; k < columns_.size(); ++k) numbers[k] = columns_[k] ? columns_[k][i] : 0;
    return numbers.first(columns_.size());
  }

 private:
  std::vector<const double*> columns_;
};

}  // namespace phyxel
