/// The arrays of the CPU backend, by slot: constants of the model, its state, and the records that
/// neighbours read.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/history.hpp"
#include "phyxel/physics/point.hpp"
#include "phyxel/physics/weight.hpp"
#include "solver/cpu_layout.hpp"
#include "solver/hourglass.hpp"
#include "solver/pack.hpp"

namespace phyxel {

/// Record of a phyxel that the first pass reads: its length, and the offset of each value.
/// `support` is 1/h² [1/m²], or `relative_half_support` in bodies with weights of pairs; `growth`
/// is that of `Fracture`, or 0 if no pair may break.
struct PointRecord {
  static constexpr int size = 8;
  enum { position = 0, support = 3, displacement = 4, growth = 7 };
};
/// Record of a phyxel that the second pass reads, likewise.
struct StressRecord {
  static constexpr int size = 16;
  enum { pair_stress = 0, closing_stress = 9, position = 12, support = 15 };
};

/// Arrays of one model. @tparam Real scalar of neighbour sums. @tparam StateReal scalar of
/// displacements and velocities
template <class Real, class StateReal>
class CpuArrays {
 public:
  static constexpr int W = static_cast<int>(simd_bytes / sizeof(Real));
  using P = Pack<Real, W>;
  using S = Pack<StateReal, W>;

  /// Packs the constants of a model. @param boundary result of `boundary_phyxels`
  CpuArrays(const Model& model, const std::vector<char>& boundary)
      : model_(model.with_lists()),
        layout_(model, boundary, W),
        lists_(model.neighbourhood.neighbours, layout_) {
    if (!model.neighbourhood.symmetric)
      inverse_ = PackedLists(model.neighbourhood.inverse(), layout_);
    const auto slots = static_cast<std::size_t>(layout_.slots());
    points_.assign(slots * PointRecord::size, Real(0));
    stresses_.assign(slots * StressRecord::size, Real(0));
    inverse_moment_.assign(slots * 6, Real(0));
    moment_offset_.assign(slots * 3, Real(0));
    volume_.assign(slots, Real(0));
    inverse_mass_.assign(slots, Real(0));
    displacement_.assign(slots * 3, StateReal(0));
    velocity_.assign(slots * 3, StateReal(0));
    if (!model.loads.empty()) applied_.assign(slots * 3, Real(0));
    if (has_hourglass_control(model)) pull_.assign(slots * 3, Real(0));
    if (!model.closing.empty()) closing_.assign(slots * 3, Real(0));
    for (std::size_t p = 0; p < model.parts.size(); ++p) pack_part(p);
    make_history();
    find_padding();
  }

  void put_state(const State& state) {
    const std::vector<const HistoryColumn*> history =
        checked_history(state, history_columns_, model_.size());
    for (Index i = 0; i < model_.size(); ++i)
      set_state(i, state.displacement[i], state.velocity[i]);
    std::fill(history_.begin(), history_.end(), Real(0));
    for_each_history([&](Index i, std::size_t column, std::size_t at) {
      if (!history.empty()) history_[at] = static_cast<Real>(history[column]->values[i]);
    });
    history_interval_ = history.empty() ? 0 : state.history_interval;
  }
  void get_state(State& state) const {
    state.displacement.resize(static_cast<std::size_t>(model_.size()));
    state.velocity.resize(static_cast<std::size_t>(model_.size()));
    for (Index i = 0; i < model_.size(); ++i) {
      state.displacement[i] = get3(displacement_, layout_.slot(i));
      state.velocity[i] = get3(velocity_, layout_.slot(i));
    }
    state.history = virgin_history(model_);
    for_each_history([&](Index i, std::size_t column, std::size_t at) {
      state.history[column].values[i] = history_[at];
    });
    state.history_interval = history_columns_.empty() ? 0 : history_interval_;
  }

 protected:
  // --- [pack][component][lane] ------------------------------------------------------------------

  template <class Q, class T>
  PHYXEL_HD static Vec3<Q> vec3_of(const AlignedVector<T>& array, Index p) {
    const T* at = &array[static_cast<std::size_t>(p) * 3 * W];
    return {phyxel::load<Q>(at), phyxel::load<Q>(at + W), phyxel::load<Q>(at + 2 * W)};
  }
  template <class Q, class T>
  PHYXEL_HD static void store3(AlignedVector<T>& array, Index p, const Vec3<Q>& v) {
    T* at = &array[static_cast<std::size_t>(p) * 3 * W];
    phyxel::store(at, v.x);
    phyxel::store(at + W, v.y);
    phyxel::store(at + 2 * W, v.z);
  }
  template <class T>
  static T& component(AlignedVector<T>& array, Index slot, int c, int count) {
    return array[(static_cast<std::size_t>(slot / W) * count + c) * W + slot % W];
  }
  /// The displacement of a slot as the passes see it [m]; of a ghost, its owner's.
  Vec3d point_displacement(Index slot) const {
    const Real* u = point_record(slot) + PointRecord::displacement;
    return {u[0], u[1], u[2]};
  }
  template <class T>
  static Vec3d get3(const AlignedVector<T>& array, Index slot) {
    const T* at = &array[static_cast<std::size_t>(slot / W) * 3 * W + slot % W];
    return {at[0], at[W], at[2 * W]};
  }
  template <class T>
  static void set3(AlignedVector<T>& array, Index slot, Vec3d v) {
    component(array, slot, 0, 3) = static_cast<T>(v.x);
    component(array, slot, 1, 3) = static_cast<T>(v.y);
    component(array, slot, 2, 3) = static_cast<T>(v.z);
  }
  PHYXEL_HD Sym3<P> inverse_moment_of(Index p) const {
    const Real* at = &inverse_moment_[static_cast<std::size_t>(p) * 6 * W];
    return {phyxel::load<P>(at),         phyxel::load<P>(at + W),     phyxel::load<P>(at + 2 * W),
            phyxel::load<P>(at + 3 * W), phyxel::load<P>(at + 4 * W), phyxel::load<P>(at + 5 * W)};
  }

  // --- records ----------------------------------------------------------------------------------

  // Offsets in records exceed 32 bits for far fewer slots than slot numbers do.
  PHYXEL_HD Real* point_record(Index slot) {
    return points_.data() + std::ptrdiff_t{slot} * PointRecord::size;
  }
  PHYXEL_HD const Real* point_record(Index slot) const {
    return points_.data() + std::ptrdiff_t{slot} * PointRecord::size;
  }
  PHYXEL_HD Real* stress_record(Index slot) {
    return stresses_.data() + std::ptrdiff_t{slot} * StressRecord::size;
  }
  /// The displacements in the point records, which ghosts receive from their owners.
  Records displacement_records() {
    return records_of(points_, PointRecord::size, PointRecord::displacement, 3);
  }
  Records stress_records() {
    static_assert(StressRecord::closing_stress == StressRecord::pair_stress + 9);
    return records_of(stresses_, StressRecord::size, StressRecord::pair_stress,
                      closing_.empty() ? 9 : 12);
  }
  template <class T>
  Records records_of(AlignedVector<T>& array, int size, int first, int count) {
    T* const begin = array.empty() ? nullptr : array.data() + first;  // a rank may have nothing
    return {reinterpret_cast<std::byte*>(begin), sizeof(T) * size, sizeof(T) * count,
            layout_.slot_of_phyxel()};
  }
  void refresh(const Records& records) const {
    model_.share->transport->start(records);
    model_.share->transport->finish();
  }
  PHYXEL_HD static Vec3<P> vec3_at(const P* record, int first) {
    return {record[first], record[first + 1], record[first + 2]};
  }
  PHYXEL_HD static Mat3<P> mat3_at(const P* record) {
    Mat3<P> m;
    for (int e = 0; e < 9; ++e) m(e / 3, e % 3) = record[StressRecord::pair_stress + e];
    return m;
  }
  PHYXEL_HD P own_point_value(Index p, int which) const {
    P value;
    for (int l = 0; l < W; ++l) value.lanes[l] = point_record(p * W + l)[which];
    return value;
  }
  /// 1/H² of the weights of pairs [1/m²]; 0 if weights of pack p follow from one support.
  PHYXEL_HD Real pair_scale_of(Index p) const {
    return pair_scale_.empty() ? Real(0) : pair_scale_[p];
  }
  PHYXEL_HD Vec3<P> point_of(Index p, int first) const {
    return {own_point_value(p, first), own_point_value(p, first + 1),
            own_point_value(p, first + 2)};
  }
  PHYXEL_HD void store_pair_stress(Index p, const Mat3<P>& q) {
    for (int l = 0; l < W; ++l) {
      Real* record = stress_record(p * W + l) + StressRecord::pair_stress;
      for (int e = 0; e < 9; ++e) record[e] = q(e / 3, e % 3)[l];
    }
  }

  PHYXEL_HD void store_closing_stress(Index p, const Vec3<P>& t) {
    for (int l = 0; l < W; ++l) {
      Real* record = stress_record(p * W + l) + StressRecord::closing_stress;
      record[0] = t.x[l];
      record[1] = t.y[l];
      record[2] = t.z[l];
    }
  }

  // --- history: [pack][number][lane], of packs whose law has one --------------------------------

  /// The history of the phyxels of pack p under `Law`.
  template <class Law>
  PHYXEL_HD HistoryOf<Law> history_of(Index p) const {
    HistoryOf<Law> history;
    P numbers[history_numbers<Law, P>];
    const Real* at = &history_[history_start_[p]];
    for (int k = 0; k < history_numbers<Law, P>; ++k) numbers[k] = phyxel::load<P>(at + k * W);
    std::memcpy(static_cast<void*>(&history), numbers, sizeof(numbers));
    return history;
  }
  template <class Law>
  PHYXEL_HD void set_history(Index p, const HistoryOf<Law>& history) {
    P numbers[history_numbers<Law, P>];
    std::memcpy(static_cast<void*>(numbers), &history, sizeof(numbers));
    Real* at = &history_[history_start_[p]];
    for (int k = 0; k < history_numbers<Law, P>; ++k) phyxel::store(at + k * W, numbers[k]);
  }

  // --- set-up -----------------------------------------------------------------------------------

  /// Packs the constants of one body. Positions are relative to the body's first phyxel, so that a
  /// body far from the origin keeps its digits in float.
  void pack_part(std::size_t p) {
    const Part& part = model_.parts[p];
    for (Index i = part.begin; i < part.end; ++i) {
      const Index slot = layout_.slot(i);
      const Vec3d x = model_.position[i] - part.origin;
      const double h = model_.neighbourhood.support[i];
      Real *point = point_record(slot), *stress = stress_record(slot);
      set_values(point + PointRecord::position, x);
      set_values(stress + StressRecord::position, x);
      point[PointRecord::support] = stress[StressRecord::support] =
          part.pair_length > 0 ? static_cast<Real>(relative_half_support(h, part.pair_length))
          : h > 0              ? static_cast<Real>(1 / (h * h))
                               : Real(0);
      if (part.pair_length > 0) {
        pair_scale_.resize(static_cast<std::size_t>(layout_.packs()), Real(0));
        pair_scale_[slot / W] = static_cast<Real>(1 / (part.pair_length * part.pair_length));
      }
      set_moment(slot, model_.inverse_moment[i], model_.moment_offset[i]);
      if (!closing_.empty()) set3(closing_, slot, model_.closing[i]);
      volume_[slot] = static_cast<Real>(model_.volume[i]);
      inverse_mass_[slot] = static_cast<Real>(1 / model_.mass[i]);
    }
  }
  void set_moment(Index slot, const Sym3d& inverse, Vec3d offset) {
    const double entries[] = {inverse.xx, inverse.xy, inverse.xz,
                              inverse.yy, inverse.yz, inverse.zz};
    for (int e = 0; e < 6; ++e) {
      component(inverse_moment_, slot, e, 6) = static_cast<Real>(entries[e]);
    }
    set3(moment_offset_, slot, offset);
  }
  static void set_values(Real* at, Vec3d v) {
    at[0] = static_cast<Real>(v.x);
    at[1] = static_cast<Real>(v.y);
    at[2] = static_cast<Real>(v.z);
  }

  void set_state(Index i, Vec3d u, Vec3d v) {
    const Index slot = layout_.slot(i);
    set3(displacement_, slot, u);
    set3(velocity_, slot, v);
    set_values(point_record(slot) + PointRecord::displacement, u);
  }

  /// Allocates the histories of laws that have one.
  void make_history() {
    history_columns_ = history_columns(model_);
    if (history_columns_.empty()) return;
    std::vector<std::size_t> numbers(static_cast<std::size_t>(layout_.packs()), 0);
    for (const Part& part : model_.parts) {
      columns_of_part_.push_back(columns_of(part.material, history_columns_));
      for (Index i = part.begin; i < part.owned_end(); ++i) {
        numbers[layout_.slot(i) / W] = columns_of_part_.back().size();
      }
    }
    history_start_.assign(numbers.size() + 1, 0);
    for (std::size_t p = 0; p < numbers.size(); ++p) {
      history_start_[p + 1] = history_start_[p] + numbers[p] * W;
    }
    history_.assign(history_start_.back(), Real(0));
  }
  /// Calls visit(phyxel, column, index in `history_`) for each history number of this rank's
  /// phyxels.
  template <class Visit>
  void for_each_history(Visit&& visit) const {
    for (std::size_t p = 0; p < columns_of_part_.size(); ++p) {
      const Part& part = model_.parts[p];
      const std::vector<std::size_t>& columns = columns_of_part_[p];
      for (Index i = part.begin; i < part.owned_end(); ++i) {
        const Index slot = layout_.slot(i);
        for (std::size_t k = 0; k < columns.size(); ++k) {
          visit(i, columns[k], history_start_[slot / W] + k * W + slot % W);
        }
      }
    }
  }
  /// Lists the slots without a phyxel in `padding_`.
  void find_padding() {
    std::vector<char> taken(static_cast<std::size_t>(layout_.slots()), 0);
    for (Index i = 0; i < model_.size(); ++i) taken[layout_.slot(i)] = 1;
    for (Index slot = 0; slot < layout_.slots(); ++slot) {
      if (!taken[slot]) padding_.push_back(slot);
    }
  }
  /// Resets slots without a phyxel to zero, since gravity accelerates them too.
  void clear_padding() {
    for (const Index slot : padding_) {
      set3(displacement_, slot, {});
      set3(velocity_, slot, {});
      set_values(point_record(slot) + PointRecord::displacement, {});
    }
  }

  void add_memory(std::vector<ArrayBytes>& list) const {
    list.insert(list.end(),
                {{"point records", points_.size() * sizeof(Real)},
                 {"stress records", stresses_.size() * sizeof(Real)},
                 {"inverse moments", inverse_moment_.size() * sizeof(Real)},
                 {"moment offsets", moment_offset_.size() * sizeof(Real)},
                 {"volumes and masses", (volume_.size() + inverse_mass_.size()) * sizeof(Real)},
                 {"displacements and velocities",
                  (displacement_.size() + velocity_.size()) * sizeof(StateReal)},
                 {"neighbour lists", lists_.bytes()}});
    if (!inverse_.start.empty()) list.push_back({"inverse neighbour lists", inverse_.bytes()});
    if (!applied_.empty()) list.push_back({"loads", applied_.size() * sizeof(Real)});
    if (!pull_.empty()) list.push_back({"hourglass control", pull_.size() * sizeof(Real)});
    if (!closing_.empty()) list.push_back({"closing vectors", closing_.size() * sizeof(Real)});
    if (!history_.empty()) {
      list.push_back({"history", history_.size() * sizeof(Real) +
                                     history_start_.size() * sizeof(history_start_[0])});
    }
  }
  std::size_t traffic_of_step() const {
    const auto slots = static_cast<std::size_t>(layout_.slots());
    const std::size_t pass_1 = lists_.bytes() +
                               slots * (PointRecord::size + 6 + 1 + 9) * sizeof(Real) +
                               3 * closing_.size() * sizeof(Real) +  // b and ĉ read, t written
                               2 * history_.size() * sizeof(Real);
    const std::size_t pass_2 =
        (inverse_.start.empty() ? lists_ : inverse_).bytes() +
        slots * ((StressRecord::size + 3 + 1 + 3) * sizeof(Real) + 4 * 3 * sizeof(StateReal)) +
        (applied_.size() + 2 * pull_.size()) * sizeof(Real);
    return pass_1 + pass_2;
  }

  const Model& model_;
  Layout layout_;
  PackedLists lists_, inverse_;            // inverse_ is empty if lists are symmetric
  AlignedVector<Real> points_, stresses_;  // records, by slot
  AlignedVector<Real> inverse_moment_, moment_offset_, volume_, inverse_mass_;
  AlignedVector<StateReal> displacement_, velocity_;
  AlignedVector<Real> applied_;  // forces of loads and of the caller; empty if there are none
  AlignedVector<Real> pull_;     // forces of hourglass control; likewise
  AlignedVector<Real> closing_;  // b, ĉ and t of closed gradients; likewise
  std::vector<std::string> history_columns_;
  std::vector<std::vector<std::size_t>> columns_of_part_;  // history columns of each part's law
  std::vector<std::size_t> history_start_;  // [packs + 1]; empty if no law has a history
  AlignedVector<Real> history_;
  double history_interval_ = 0;   // time from the history to the displacements [s]
  std::vector<Real> pair_scale_;  // 1/H² of packs with weights of pairs, 0 of others; empty if none
  std::vector<Index> padding_;    // slots without a phyxel
};

}  // namespace phyxel
