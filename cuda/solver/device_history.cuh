/// The histories of a model's laws, in device memory.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "phyxel/history.hpp"
#include "setup/device_tiling.hpp"
#include "setup/primitives.cuh"

namespace phyxel::cuda {

/// Rows of numbers by tile slot: row k has number k of each phyxel's law, in the law's order. The
/// number of rows is that of the law with the longest history; 0 if no law has one.
template <class Real>
class DeviceHistory {
 public:
  /// Allocates histories of the virgin material. Model and tiling must outlive this object.
  DeviceHistory(const Model& model, const DeviceTiling& tiling)
      : model_(model), tiling_(tiling), names_(history_columns(model)) {
    if (names_.empty()) return;
    for (const Part& part : model_.parts) {
      columns_of_part_.push_back(columns_of(part.material, names_));
      rows_ = std::max(rows_, columns_of_part_.back().size());
    }
    values_ = {rows_ * places(), "history of " + std::to_string(model.size()) + " phyxels"};
    values_.clear();
  }

  /// The number of columns that a state of the model has.
  std::size_t columns() const { return names_.size(); }
  int rows() const { return static_cast<int>(rows_); }
  Real* data() const { return values_.data(); }  ///< [rows, places], or null.
  std::size_t bytes() const { return values_.bytes(); }

  /// Uploads the history of a state, or that of the virgin material if the state has none.
  /// @throws InputError for a history of other laws
  void put(const State& state) const {
    const std::vector<const HistoryColumn*> history = checked_history(state, names_, model_.size());
    if (names_.empty()) return;
    std::vector<Real> values(values_.size());
    for_each([&](Index i, std::size_t column, std::size_t at) {
      if (!history.empty()) values[at] = static_cast<Real>(history[column]->values[i]);
    });
    values_.upload(values.data());
  }
  /// Downloads the history into a state.
  void take(State& state) const {
    state.history = virgin_history(model_);
    if (names_.empty()) return;
    const std::vector<Real> values = fetched(values_);
    for_each([&](Index i, std::size_t column, std::size_t at) {
      state.history[column].values[i] = values[at];
    });
  }

 private:
  std::size_t places() const { return static_cast<std::size_t>(tiling_.places()); }
  /// Calls visit(phyxel, column, index in `values_`) for each history number of this rank's
  /// phyxels.
  template <class Visit>
  void for_each(Visit&& visit) const {
    for (std::size_t p = 0; p < columns_of_part_.size(); ++p) {
      const Part& part = model_.parts[p];
      for (Index i = part.begin; i < part.owned_end(); ++i) {
        const auto place = static_cast<std::size_t>(tiling_.place[i]);
        for (std::size_t k = 0; k < columns_of_part_[p].size(); ++k) {
          visit(i, columns_of_part_[p][k], k * places() + place);
        }
      }
    }
  }

  const Model& model_;
  const DeviceTiling& tiling_;
  std::vector<std::string> names_;
  std::vector<std::vector<std::size_t>> columns_of_part_;  // history columns of each part's law
  std::size_t rows_ = 0;
  DeviceArray<Real> values_;
};

}  // namespace phyxel::cuda
