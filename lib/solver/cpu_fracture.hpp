/// Pairs that break, on the CPU. An entry of a list whose pair is broken is overwritten by the
/// phyxel itself, as those that fill short rows are, so that the two passes of a step do not
/// change.
///
/// A look at the pairs of a pack finds how far any of them is from breaking. The next look is due
/// when phyxels of pairs can have moved apart by as much since: no pair breaks in between.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "phyxel/physics/fracture.hpp"
#include "solver/broken_pairs.hpp"
#include "solver/cpu_passes.hpp"
#include "solver/pair_motion.hpp"

namespace phyxel {

/// The passes of a step on bodies that may break. Without such a body it has no arrays and does
/// nothing.
template <class Real, class StateReal>
class CpuFracture : public CpuPasses<Real, StateReal> {
  using Passes = CpuPasses<Real, StateReal>;

 public:
  using Passes::W;
  using typename Passes::P;

  /// @param threads number of OpenMP threads
  CpuFracture(const Model& model, int threads) : Passes(model, threads), broken_(model) {
    const std::vector<double>& growth = model.fracture.growth;
    if (!model.fracture.acts()) return;
    faces_.emplace(model);
    // Forces of closed cracks are added to those of hourglass control.
    if (pull_.empty()) pull_.assign(static_cast<std::size_t>(layout_.slots()) * 3, Real(0));
    phyxel_.assign(static_cast<std::size_t>(layout_.slots()), -1);
    for (Index i = 0; i < model.size(); ++i) phyxel_[layout_.slot(i)] = i;
    for (Index i = 0; i < static_cast<Index>(growth.size()); ++i) {
      this->point_record(layout_.slot(i))[PointRecord::growth] = static_cast<Real>(growth[i]);
    }
    if (!model.fracture.breaks) return;
    energies_.emplace(model);
    next_look_.assign(static_cast<std::size_t>(layout_.packs()), 0);
    motion_.emplace(model, layout_, lists_, breaking_bodies(model), threads);
  }

 protected:
  using Passes::boundary_runs_;
  using Passes::closing_;
  using Passes::interior_runs_;
  using Passes::inverse_;
  using Passes::inverse_mass_;
  using Passes::inverse_moment_;
  using Passes::layout_;
  using Passes::lists_;
  using Passes::model_;
  using Passes::moment_offset_;
  using Passes::points_;
  using Passes::pull_;
  using Passes::threads_;
  using Passes::volume_;
  using typename Passes::Run;

  /// True if pairs may break in steps.
  bool may_break() const { return energies_.has_value(); }
  const BrokenPairs& broken_pairs() const { return broken_; }
  /// The energy that broken pairs have taken on this rank [J], since the backend was made.
  const ExactSum& fracture_energy() const { return fracture_energy_; }

  /// Bytes of its lists.
  std::size_t fracture_bytes() const {
    return phyxel_.size() * sizeof(phyxel_[0]) + next_look_.size() * sizeof(next_look_[0]) +
           (motion_ ? motion_->bytes() : 0) + broken_.bytes();
  }

  /// Adds the forces of closed cracks at the present displacements to those of hourglass control,
  /// which the first pass has just found.
  void push_closed() {
    constexpr std::size_t worth_threads = 200;  // a thread takes some microseconds to start
#pragma omp parallel for schedule(static) \
    num_threads(fractured_.size() > worth_threads ? threads_ : 1)
    for (std::size_t k = 0; k < fractured_.size(); ++k) {
      const Index i = fractured_[k], slot = layout_.slot(i);
      Vec3d force;
      faces_->for_each(i, broken_, present(), [&](const ClosedPair& pair, Vec3d x, Vec3d u) {
        force += pair.force(x, u);
      });
      const bool pulls = !closing_.empty() || part_of(model_, i).material.hourglass.value_or(0) > 0;
      this->set3(pull_, slot, pulls ? this->get3(pull_, slot) + force : force);
    }
  }
  /// What broken pairs have left of each phyxel at the present displacements.
  Breakage present_breakage() const { return breakage_of(model_, broken_, *faces_, present()); }

  /// Remembers the displacements of a state that has been put in.
  void remember_displacements() {
    if (!may_break()) return;
    std::fill(next_look_.begin(), next_look_.end(), 0);
    motion_->start(records());
  }

  /// Breaks the pairs that are stretched too far at the present displacements, of which those of
  /// ghosts must be their owners'.
  /// @param in_step true at the end of a step of Verlet's method. The force of the next step acts
  /// from the middle of the last one on, so that a pair that breaks takes the energy that it has
  /// there: with the energy at the end of the step the total would grow in proportion to the step.
  void break_pairs(bool in_step) {
    if (!may_break()) return;
    motion_->measure(records());
    std::vector<BrokenEntry> entries;
    for (const auto* runs : {&boundary_runs_, &interior_runs_}) {
      for (const Run& run : *runs) find_broken(run.range, entries);
    }
    if (!entries.empty()) break_pairs(std::move(entries), in_step);
    motion_->end_step();
  }

  /// Replaces the broken pairs by those of a state.
  void put_broken(const State& state) {
    const std::vector<PhyxelPair>& pairs = state.broken;
    if (!pairs.empty() && phyxel_.empty()) {
      throw InputError(fmt::format(
          "a state with {} broken pairs for a model without fracture and notches; allowed: none",
          pairs.size()));
    }
    if (pairs.empty() && broken_.empty()) return;
    const std::vector<PhyxelPair> present = broken_.pairs();
    if (pairs == present && state.worn == broken_.worn()) return;
    std::vector<Index> changed = broken_.phyxels();
    broken_.set(pairs, state.worn);
    fractured_ = broken_.phyxels();
    changed.insert(changed.end(), fractured_.begin(), fractured_.end());
    for (const Index i : changed) {
      write_row(lists_, model_.neighbourhood.neighbours.row(i), i);
      if (!inverse_.start.empty()) write_row(inverse_, model_.neighbourhood.inverse().row(i), i);
      write_constants(i, broken_.of_point(i));
    }
  }

 private:
  /// An entry of a list whose pair breaks.
  struct BrokenEntry {
    Index phyxel;  ///< Whose list it is.
    Offset at;     ///< Index in the packed lists.
  };

  /// Functions that return the present displacement of a phyxel, and the record of a slot.
  auto present() const {
    return [this](Index j) { return this->point_displacement(layout_.slot(j)); };
  }
  auto records() const {
    return [this](Index slot) { return this->point_record(slot); };
  }

  void break_pairs(std::vector<BrokenEntry> entries, bool in_step) {
    // Threads find them in any order.
    std::sort(entries.begin(), entries.end(), [](const BrokenEntry& a, const BrokenEntry& b) {
      return a.phyxel != b.phyxel ? a.phyxel < b.phyxel : a.at < b.at;
    });
    for (auto begin = entries.begin(); begin != entries.end();) {
      const auto end = std::find_if(begin, entries.end(), [&](const BrokenEntry& entry) {
        return entry.phyxel != begin->phyxel;
      });
      break_from(begin->phyxel, {begin, end}, in_step);
      begin = end;
    }
    fractured_ = broken_.phyxels();
  }

  /// Adds the entries of the lists of some packs whose pairs are stretched too far.
  void find_broken(PackRange range, std::vector<BrokenEntry>& found) {
#pragma omp parallel num_threads(this->threads_for(range))
    {
      std::vector<BrokenEntry> own;
      AlignedVector<Real> excess;
#pragma omp for schedule(static) nowait
      for (Index p = range.begin; p < range.end; ++p) {
        if (!motion_->follows(p) || motion_->apart(p) < next_look_[p]) continue;
        next_look_[p] = motion_->apart(p) + find_broken(p, excess, own);
      }
      if (!own.empty()) {
#pragma omp critical
        found.insert(found.end(), own.begin(), own.end());
      }
    }
  }
  /// Adds those of pack p. The excess of each pair is computed in one place of the program, so that
  /// both ends of a pair round it alike. @param excess room for them
  /// @returns a distance [m] by which all other pairs may lengthen without breaking
  double find_broken(Index p, AlignedVector<Real>& excess, std::vector<BrokenEntry>& found) const {
    const Vec3<P> x_i = this->point_of(p, PointRecord::position),
                  u_i = this->point_of(p, PointRecord::displacement);
    const P growth_i = this->own_point_value(p, PointRecord::growth);
    const Offset begin = lists_.start[p], end = lists_.start[p + 1];
    excess.resize(static_cast<std::size_t>(end - begin));
    constexpr Real unit = std::numeric_limits<Real>::epsilon();
    P most(-1), least(std::numeric_limits<Real>::max());
    for (Offset j = begin; j < end; j += W) {
      P point[PointRecord::size];
      load_records<PointRecord::size>(points_.data(), lists_.indices.data() + j, point);
      const Vec3<P> x = this->vec3_at(point, PointRecord::position) - x_i;
      const Vec3<P> u = this->vec3_at(point, PointRecord::displacement) - u_i;
      const P growth = growth_of_pair(growth_i, point[PointRecord::growth]);
      const P of_pair = where_larger(growth, P(0), excess_growth(x, u, growth), P(0));
      store(&excess[static_cast<std::size_t>(j - begin)], of_pair);
      most = where_larger(of_pair, most, of_pair, most);
      const P slack = squared_slack(x, of_pair, growth, P(unit));
      // A phyxel itself fills rows; pairs that never break and those that break now do not count.
      const P counted = where_larger(growth * dot(x, x), P(0), slack, least);
      least = where_larger(least, where_larger(of_pair, P(0), least, counted), counted, least);
    }
    Real least_of_all = std::numeric_limits<Real>::max();
    for (int l = 0; l < W; ++l) least_of_all = std::min(least_of_all, least.lanes[l]);
    const double slack = 0.5 * (1 - 1e-5) * std::sqrt(static_cast<double>(least_of_all));
    if (!any_positive(most)) return slack;
    for (Offset j = begin; j < end; ++j) {
      if (!(excess[static_cast<std::size_t>(j - begin)] > Real(0))) continue;
      found.push_back({phyxel_[p * W + static_cast<Index>((j - begin) % W)], j});
    }
    return slack;
  }

  /// Breaks a phyxel from some neighbours, and adds the energy that it loses.
  void break_from(Index i, std::span<const BrokenEntry> entries, bool in_step) {
    const auto displacement = [&](Index j) {
      const Index slot = layout_.slot(j);
      const Vec3d now = this->point_displacement(slot);
      if (!in_step) return now;
      const Real* u = motion_->before(slot);
      return 0.5 * (Vec3d{u[0], u[1], u[2]} + now);
    };
    const PointBreakage had = broken_.of_point(i);
    const PointEnergy before = energies_->of(i, broken_, had, displacement);
    std::vector<Index> neighbours;
    for (const BrokenEntry& entry : entries) {
      neighbours.push_back(phyxel_[lists_.indices[static_cast<std::size_t>(entry.at)]]);
      lists_.indices[static_cast<std::size_t>(entry.at)] = layout_.slot(i);
    }
    broken_.add(i, neighbours);
    // Bodies that break have symmetric lists, but others of the scene may not.
    if (!inverse_.start.empty()) write_row(inverse_, model_.neighbourhood.inverse().row(i), i);
    PointBreakage has = broken_.of_point(i);
    const PointEnergy after = energies_->of(i, broken_, has, displacement);
    const BreakOfPoint made = break_of_point(had.carried, before, has.carried, after);
    has.carried = made.carried;
    broken_.set_carried(i, has.carried);
    write_constants(i, has);
    fracture_energy_.add(made.before);
    fracture_energy_.add(-made.after);
  }

  /// Writes the list of a phyxel without its broken pairs.
  void write_row(PackedLists& lists, std::span<const Index> row, Index i) {
    const Index slot = layout_.slot(i), p = slot / W;
    const std::span<const Index> gone = broken_.of(i);
    Index* at = lists.indices.data() + lists.start[p] + slot % W;
    for (std::size_t k = 0; k < row.size(); ++k) {
      const bool is_gone = std::binary_search(gone.begin(), gone.end(), row[k]);
      at[k * W] = is_gone ? slot : layout_.slot(row[k]);
    }
  }
  /// Writes what the stress of a phyxel depends on.
  void write_constants(Index i, const PointBreakage& now) {
    const Index slot = layout_.slot(i);
    this->set_moment(slot, now.inverse_moment, now.moment_offset);
    if (!closing_.empty()) this->set3(closing_, slot, now.closing);
    volume_[slot] = static_cast<Real>(now.carried * model_.volume[i]);
  }

  BrokenPairs broken_;
  std::vector<Index> fractured_;            // phyxels with broken pairs, ascending
  std::optional<CrackFaces> faces_;         // unset without fracture and notches
  std::vector<Index> phyxel_;               // phyxel of each slot, or -1; empty if nothing breaks
  std::optional<PointEnergies> energies_;   // unset if no pair may break
  std::optional<PairMotion<Real>> motion_;  // unset if no pair may break
  std::vector<double> next_look_;           // `motion_->apart` at which a pack is looked at again
  ExactSum fracture_energy_;
};

}  // namespace phyxel
