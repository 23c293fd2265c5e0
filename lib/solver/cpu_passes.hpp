/// The two passes of a step on the CPU: W phyxels at a time over the neighbour lists.
///
/// Memory moved per phyxel and step, float, k neighbours, one body with symmetric lists:
///   pass 1 reads  one 32-byte record (X, 1/h², u) per neighbour, mostly from cache, 4 k of
///   indices,
///          24 of A⁻¹, 4 of v, and writes 36 of a 64-byte record (Q beside X, 1/h²);
///   pass 2 reads  one 64-byte record per neighbour, mostly from cache, 4 k of indices, 12 of b,
///          4 of 1/m, reads and writes 24 of (u, v) and writes 12 of the first record.
#pragma once

#include <omp.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "phyxel/custom_law.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/physics/weight.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/cpu_arrays.hpp"
#include "solver/first_error.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

/// Evaluates a caller's law for the phyxels of a pack, one by one. An exception of the law is kept
/// until the parallel region has ended.
template <class P>
class LaneByLane {
 public:
  LaneByLane(const CustomLaw& law, FirstError& error) : law_(law), error_(error) {}

  /// Returns P of each lane [Pa]. @param numbers history of the pack, shape [numbers, lanes],
  /// treated as `use` says
  template <class Real>
  Mat3<P> first_piola_stress(const Mat3<P>& grad_u, Real* numbers, std::size_t count,
                             HistoryUse use, double dt) const {
    constexpr int width = sizeof(P) / sizeof(Real);
    return error_.caught([&] {
      Mat3<P> stress;
      std::vector<double> history(count);
      for (int l = 0; l < width; ++l) {
        Mat3d of_lane;
        for (int e = 0; e < 9; ++e) of_lane(e / 3, e % 3) = grad_u(e / 3, e % 3)[l];
        for (std::size_t k = 0; k < count; ++k) history[k] = numbers[k * width + l];
        if (count == 0) {
          of_lane = law_.first_piola_stress(of_lane);
        } else if (use == HistoryUse::frozen) {
          of_lane = law_.elastic_stress(of_lane, history);
        } else {
          of_lane = law_.first_piola_stress(of_lane, std::span(history), dt);
        }
        if (use == HistoryUse::commit) {
          for (std::size_t k = 0; k < count; ++k) {
            numbers[k * width + l] = static_cast<Real>(history[k]);
          }
        }
        for (int e = 0; e < 9; ++e) {
          stress(e / 3, e % 3).lanes[l] = static_cast<Real>(of_lane(e / 3, e % 3));
        }
      }
      return stress;
    });
  }

 private:
  const CustomLaw& law_;
  FirstError& error_;
};

template <class Real, class StateReal>
class CpuPasses : public CpuArrays<Real, StateReal> {
  using Arrays = CpuArrays<Real, StateReal>;

 public:
  using Arrays::W;
  using typename Arrays::P;
  using typename Arrays::S;

  /// @param threads number of OpenMP threads
  CpuPasses(const Model& model, int threads) : CpuPasses(model, threads, boundary_phyxels(model)) {}

 protected:
  using Arrays::applied_;
  using Arrays::closing_;
  using Arrays::displacement_;
  using Arrays::history_;
  using Arrays::history_interval_;
  using Arrays::history_start_;
  using Arrays::inverse_;
  using Arrays::inverse_mass_;
  using Arrays::layout_;
  using Arrays::lists_;
  using Arrays::model_;
  using Arrays::moment_offset_;
  using Arrays::points_;
  using Arrays::pull_;
  using Arrays::stresses_;
  using Arrays::velocity_;
  using Arrays::volume_;

  // --- runs of packs ----------------------------------------------------------------------------

  /// Consecutive bodies of one material, which one loop passes over.
  struct Run {
    Material material;
    ChosenLaw law;     ///< Unused with a custom law.
    double hourglass;  ///< κ [N/m]
    PackRange range;
  };

  std::vector<Run> find_runs(const PackRange& (Layout::*range_of)(std::size_t) const) const {
    std::vector<Run> runs;
    for (std::size_t part = 0; part < model_.parts.size(); ++part) {
      const Material& material = model_.parts[part].material;
      const double hourglass = hourglass_stiffness(model_, model_.parts[part]);
      const PackRange range = (layout_.*range_of)(part);
      if (range.begin == range.end) continue;
      if (!runs.empty() && runs.back().material == material && runs.back().hourglass == hourglass) {
        runs.back().range.end = range.end;
      } else {
        const ChosenLaw law = material.custom_law ? ChosenLaw{} : chosen_law(material);
        runs.push_back({material, law, hourglass, range});
      }
    }
    return runs;
  }

  /// Number of threads that pay for a range: a thread takes some 10 microseconds for 400 phyxels,
  /// and a barrier about one. If other programs use the cores, a barrier waits for a thread that is
  /// not running.
  int threads_for(PackRange range) const {
    return std::clamp((range.end - range.begin) * W / 400, 1, threads_);
  }

  /// Cuts the interior packs into pieces, between which messages in transit can progress; each
  /// piece has enough work for all threads.
  void cut_interior() {
    constexpr Index most_pieces = 8, least_phyxels = 2000;
    Index packs = 0;
    for (const Run& run : interior_runs_) packs += run.range.end - run.range.begin;
    const Index each = std::max(packs / most_pieces + 1, least_phyxels * threads_ / W);
    Index room = 0;  // packs left in the last piece
    for (Run run : interior_runs_) {
      const Index end = run.range.end;
      while (run.range.begin < end) {
        if (room == 0) {
          interior_pieces_.emplace_back();
          room = each;
        }
        run.range.end = std::min(end, run.range.begin + room);
        room -= run.range.end - run.range.begin;
        interior_pieces_.back().push_back(run);
        run.range.begin = run.range.end;
      }
    }
  }

  /// Does the work of a pass, first on the boundary, whose values other ranks wait for, then on the
  /// interior, while the values are in transit. Ghosts have the values of their owners on return.
  /// @param work function that computes the values of runs
  template <class Work>
  void pass(const Records& values, Work&& work) {
    if (!model_.share) return work(interior_runs_);
    HaloTransport& halo = *model_.share->transport;
    work(boundary_runs_);
    halo.start(values);
    for (const std::vector<Run>& piece : interior_pieces_) {
      work(piece);
      halo.progress();
    }
    halo.finish();
  }

  /// Moves phyxels with prescribed motions, either those of the boundary or the others, and adds up
  /// the work of supports that move. Ghosts have the values of their owners, whose free axes are
  /// not known here.
  void follow_motions(double time, double dt, bool of_boundary) {
    support_work_.begin_step(dt);
    for (std::size_t m = 0; m < model_.motions.size(); ++m) {
      const Motion& motion = model_.motions[m];
      const Path before = motion.path_at(time), after = motion.path_at(time + dt);
      const bool works = !motion.stands_still();
      const Path mean_step = works ? motion.mean_step(time, dt) : Path{};
      std::size_t owned = 0;
      for (const Index i : motion.phyxels) {
        if (!model_.owns(i)) continue;
        const std::size_t k = owned++;
        if ((!boundary_.empty() && boundary_[i]) != of_boundary) continue;
        const Index slot = layout_.slot(i);
        const Vec3d x = model_.position[i], u = after.at(x), free = this->get3(velocity_, slot);
        this->set_state(i, motion.along_axes(u, this->get3(displacement_, slot)),
                        motion.along_axes((u - before.at(x)) / dt, free));
        if (works) support_work_.add(m, k, this->get3(velocity_, slot), free, mean_step.at(x));
      }
    }
  }

  // --- the two neighbour loops ------------------------------------------------------------------

  /// Calls visit(x_ij, u_ij, w_ij) for the neighbours of the phyxels of pack p.
  template <class Visit>
  PHYXEL_HD void visit_neighbours(Index p, Visit&& visit) const {
    const Vec3<P> x_i = this->point_of(p, PointRecord::position),
                  u_i = this->point_of(p, PointRecord::displacement);
    const P support = this->own_point_value(p, PointRecord::support);
    const Index* end = lists_.indices.data() + lists_.start[p + 1];
    const auto walk = [&](auto&& weight_of) __attribute__((always_inline)) {
      for (const Index* j = lists_.indices.data() + lists_.start[p]; j != end; j += W) {
        P point[PointRecord::size];
        load_records<PointRecord::size>(points_.data(), j, point);
        const Vec3<P> x_ij = this->vec3_at(point, PointRecord::position) - x_i;
        const Vec3<P> u_ij = this->vec3_at(point, PointRecord::displacement) - u_i;
        visit(x_ij, u_ij, weight_of(dot(x_ij, x_ij), point[PointRecord::support]));
      }
    };
    if (const Real scale = this->pair_scale_of(p); scale > 0) {
      walk([&](P r_squared, P of_j) __attribute__((always_inline)) {
        return pair_weight(r_squared, support, of_j, P(scale));
      });
    } else {
      walk([&](P r_squared, P)
               __attribute__((always_inline)) { return weight_shape(r_squared, support); });
    }
  }

  /// Computes the sums over the neighbours of the phyxels of pack p.
  template <bool pulls>
  PHYXEL_HD NeighbourSums<P> sums_of(Index p) const {
    NeighbourSums<P> sums;
    visit_neighbours(
        p, [&](Vec3<P> x_ij, Vec3<P> u_ij, P w) { sums.template add<pulls>(x_ij, u_ij, w); });
    return sums;
  }
  /// Loads the constants of the phyxels of pack p that their stresses depend on.
  template <class Terms>
  PHYXEL_HD PointConstants<P> constants_of(Index p, P hourglass) const {
    PointConstants<P> point{load<P>(&volume_[p * W]), this->inverse_moment_of(p), hourglass};
    if constexpr (Terms::sends) {
      point.moment_offset = this->template vec3_of<P>(moment_offset_, p);
      point.closing = this->template vec3_of<P>(closing_, p);
    }
    return point;
  }
  /// Returns ∇u of the phyxels of pack p, closed if gradients are.
  Mat3<P> whole_gradient_of(Index p) const {
    return closing_.empty() ? whole_gradient_of<NoPairTerms>(p) : whole_gradient_of<WithClosing>(p);
  }
  template <class Terms>
  Mat3<P> whole_gradient_of(Index p) const {
    const NeighbourSums<P> sums = sums_of<Terms::pulls>(p);
    const PointConstants<P> point = constants_of<Terms>(p, P(0));
    return Terms::gradient(displacement_gradient(sums.gradient, point.inverse_moment), sums, point);
  }

  /// Returns the internal forces [N] on the phyxels of pack p without the own force of hourglass
  /// control.
  template <class Terms>
  PHYXEL_HD Vec3<P> force_of(Index p) const {
    const PackedLists& lists = inverse_.start.empty() ? lists_ : inverse_;
    Index own[W];
    for (int l = 0; l < W; ++l) own[l] = p * W + l;
    P record[StressRecord::size];
    load_records<StressRecord::size>(stresses_.data(), own, record);
    const Vec3<P> x_i = this->vec3_at(record, StressRecord::position);
    Vec3<P> force = own_force(this->mat3_at(record), this->template vec3_of<P>(moment_offset_, p));
    const Vec3<P> sent_i = this->vec3_at(record, StressRecord::closing_stress);
    const P support = record[StressRecord::support];
    const Index* end = lists.indices.data() + lists.start[p + 1];
    const auto walk = [&](auto&& weight_of) __attribute__((always_inline)) {
      for (const Index* j = lists.indices.data() + lists.start[p]; j != end; j += W) {
        load_records<StressRecord::size>(stresses_.data(), j, record);
        const Vec3<P> x_ij = this->vec3_at(record, StressRecord::position) - x_i;
        const P w_ji = weight_of(dot(x_ij, x_ij), record[StressRecord::support]);
        add_neighbour_force(force, this->mat3_at(record), x_ij, w_ji);
        Terms::add_forces(force, sent_i, this->vec3_at(record, StressRecord::closing_stress), w_ji);
      }
    };
    if (const Real scale = this->pair_scale_of(p); scale > 0) {
      walk([&](P r_squared, P of_j) __attribute__((always_inline)) {
        return pair_weight(r_squared, support, of_j, P(scale));
      });
    } else {
      walk([&](P r_squared, P of_j)
               __attribute__((always_inline)) { return weight_shape(r_squared, of_j); });
    }
    return force;
  }

  // --- pass 1 -----------------------------------------------------------------------------------

  /// Computes the stresses of all phyxels, and treats their histories as `use` says.
  void find_stresses(const std::vector<Run>& runs, HistoryUse use) {
    for (const Run& run : runs) {
      for_each_law(run, use, [&](const auto& stress_of) {
        if (!closing_.empty()) return find_stresses<WithClosing>(stress_of, run);
        run.hourglass > 0 ? find_stresses<WithHourglass>(stress_of, run)
                          : find_stresses<NoPairTerms>(stress_of, run);
      });
    }
  }
  /// Computes the stresses of a run. @param stress_of function that returns P [Pa] of a pack and
  /// its ∇u
  template <class Terms, class StressOf>
  void find_stresses(const StressOf& stress_of, const Run& run) {
    const PackRange range = run.range;
    const P kappa(static_cast<Real>(run.hourglass));
#pragma omp parallel for schedule(static) num_threads(threads_for(range))
    for (Index p = range.begin; p < range.end; ++p) {
      const auto stress_of_law = [&](const Mat3<P>& grad_u) __attribute__((always_inline)) {
        return stress_of(p, grad_u);
      };
      // One after the other: constants that are loaded first take registers from the sums.
      const NeighbourSums<P> sums = sums_of<Terms::pulls>(p);
      const PointConstants<P> constants = constants_of<Terms>(p, kappa);
      const PointStress<P> stress = point_stress<Terms>(sums, constants, stress_of_law);
      if constexpr (Terms::sends) this->store_closing_stress(p, stress.closing_stress);
      if constexpr (Terms::template has<HourglassControl>) {
        if (!pull_.empty()) this->store3(pull_, p, stress.hourglass_force);
      }
      this->store_pair_stress(p, stress.pair_stress);
    }
  }

  /// Calls apply(stress_of) with the law of a run: the one place where terms chosen at run time
  /// select code at compile time. `stress_of(p, grad_u)` returns P [Pa] of the phyxels of pack p
  /// and treats their histories as `use` says.
  template <class Apply>
  void for_each_law(const Run& run, HistoryUse use, Apply&& apply) {
    const Material& m = run.material;
    const VolumeConservation<P> volume{P(m.volume_stiffness)};
    if (m.custom_law) return apply_custom_law(run, use, apply);
    Laws::with<P>(run.law.index, run.law.constants.data(), [&]<class Law>(const Law& law) {
      const auto apply_to = [&](const auto& whole) {
        // A call for each pack would pass matrices through memory, at 2 to 5% of a step.
        apply([&](Index p, const Mat3<P>& grad_u)
                  __attribute__((always_inline)) { return stress_of(whole, p, grad_u, use); });
      };
      if (m.viscosity > 0) {
        using Solid = SumOf<Law, VolumeConservation<P>>;
        return apply_to(WithViscosity<Solid, P>{{law, volume}, P(m.viscosity)});
      }
      m.volume_stiffness > 0 ? apply_to(SumOf<Law, VolumeConservation<P>>{law, volume})
                             : apply_to(law);
    });
  }
  /// Returns P [Pa] of the phyxels of pack p.
  template <class Law>
  PHYXEL_HD Mat3<P> stress_of(const Law& law, Index p, const Mat3<P>& grad_u, HistoryUse use) {
    if constexpr (!has_history<Law>) {
      return law.first_piola_stress(grad_u);
    } else {
      auto history = this->template history_of<Law>(p);
      if (use == HistoryUse::frozen) return law.elastic_stress(grad_u, history);
      const Mat3<P> stress = law.first_piola_stress(grad_u, history, P(history_interval_));
      if (use == HistoryUse::commit) this->template set_history<Law>(p, history);
      return stress;
    }
  }
  /// Calls apply(stress_of) with a caller's law. Histories do not change if the law throws.
  template <class Apply>
  void apply_custom_law(const Run& run, HistoryUse use, Apply&& apply) {
    const Material& m = run.material;
    const auto numbers = m.custom_law->history().size();
    const VolumeConservation<P> volume{P(m.volume_stiffness)};
    const WithViscosity<Stressless, P> viscosity{{{P(m.lame_lambda()), P(m.lame_mu())}, volume},
                                                 P(m.viscosity)};
    const bool remembers = numbers > 0 || m.viscosity > 0;
    const AlignedVector<Real> before =
        remembers && use == HistoryUse::commit ? history_ : AlignedVector<Real>{};
    FirstError error;
    const LaneByLane<P> law(*m.custom_law, error);
    apply([&](Index p, const Mat3<P>& grad_u) {
      Real* history = remembers ? &history_[history_start_[p]] : nullptr;
      Mat3<P> stress = law.first_piola_stress(grad_u, history, numbers, use, history_interval_);
      if (m.volume_stiffness > 0) stress += volume.first_piola_stress(grad_u);
      if (m.viscosity > 0 && use != HistoryUse::frozen) {
        stress += stress_beside(viscosity, history + numbers * W, grad_u, use);
      }
      return stress;
    });
    try {
      error.rethrow();
    } catch (...) {
      if (!before.empty()) history_ = before;
      throw;
    }
  }
  /// A law without stress, which `WithViscosity` wraps if the elastic law is a caller's.
  struct Stressless {
    Hooke<P> hooke;
    VolumeConservation<P> volume;
    PHYXEL_HD Mat3<P> first_piola_stress(const Mat3<P>&) const { return {}; }
    PHYXEL_HD SmallStrain<P> at_rest() const {
      return SmallStrain<P>{hooke}.at_rest(volume.stiffness);
    }
  };
  /// Returns the viscous stress that is added to a caller's law [Pa]. @param numbers history of the
  /// viscosity
  Mat3<P> stress_beside(const WithViscosity<Stressless, P>& law, Real* numbers,
                        const Mat3<P>& grad_u, HistoryUse use) const {
    using Law = WithViscosity<Stressless, P>;
    constexpr int count = history_numbers<Law, P>;
    typename Law::State state;
    P values[count];
    for (int k = 0; k < count; ++k) values[k] = load<P>(numbers + k * W);
    std::memcpy(static_cast<void*>(&state), values, sizeof(values));
    const Mat3<P> stress = law.first_piola_stress(grad_u, state, P(history_interval_));
    if (use != HistoryUse::commit) return stress;
    std::memcpy(static_cast<void*>(values), &state, sizeof(values));
    for (int k = 0; k < count; ++k) store(numbers + k * W, values[k]);
    return stress;
  }

  // --- pass 2 -----------------------------------------------------------------------------------

  /// Takes a step of the phyxels of a run, with code compiled for the terms of the scene.
  void advance_run(const Run& run, double dt) {
    if (!closing_.empty()) {
      advance_run_with<true, WithClosing>(run, dt);
    } else if (applied_.empty() && pull_.empty()) {
      advance_run_with<false, NoPairTerms>(run, dt);
    } else {
      advance_run_with<true, NoPairTerms>(run, dt);
    }
  }
  template <bool More, class Terms>
  void advance_run_with(const Run& run, double dt) {
    run.material.damping > 0 ? advance_run<true, More, Terms>(run, dt)
                             : advance_run<false, More, Terms>(run, dt);
  }

  /// Sums force and gravity and takes the Verlet step. @tparam More true if hourglass or applied
  /// forces may act
  template <bool Damped, bool More, class Terms>
  void advance_run(const Run& run, double dt) {
    const DampedFlow flow = damped_flow(run.material.damping, dt);
    const S keep(flow.keep), gain(flow.gain), step(dt);
    const Vec3<S> gravity{S(model_.gravity.x), S(model_.gravity.y), S(model_.gravity.z)};
    const PackRange range = run.range;
#pragma omp parallel for schedule(static) num_threads(threads_for(range))
    for (Index p = range.begin; p < range.end; ++p) {
      Vec3<P> force = force_of<Terms>(p);
      if constexpr (More) {
        if (!pull_.empty()) force += this->template vec3_of<P>(pull_, p);
        if (!applied_.empty()) force += this->template vec3_of<P>(applied_, p);
      }
      const Vec3<P> f_over_m = load<P>(&inverse_mass_[p * W]) * force;
      const Vec3<S> acceleration =
          Vec3<S>{convert<StateReal>(f_over_m.x), convert<StateReal>(f_over_m.y),
                  convert<StateReal>(f_over_m.z)} +
          gravity;
      const PointMotion<S> after =
          moved<Damped>(PointMotion<S>{this->template vec3_of<S>(velocity_, p),
                                       this->template vec3_of<S>(displacement_, p)},
                        acceleration, step, keep, gain);
      this->store3(velocity_, p, after.velocity);
      this->store3(displacement_, p, after.displacement);
      const Vec3<P> u{convert<Real>(after.displacement.x), convert<Real>(after.displacement.y),
                      convert<Real>(after.displacement.z)};
      for (int l = 0; l < W; ++l) {
        Real* record = this->point_record(p * W + l) + PointRecord::displacement;
        record[0] = u.x[l];
        record[1] = u.y[l];
        record[2] = u.z[l];
      }
    }
  }

  int threads_;
  StepWork support_work_{model_};
  std::vector<char> boundary_;  // result of `boundary_phyxels`
  std::vector<Run> boundary_runs_, interior_runs_;
  std::vector<std::vector<Run>> interior_pieces_;

 private:
  CpuPasses(const Model& model, int threads, std::vector<char> boundary)
      : Arrays(model, boundary),
        threads_(threads),
        boundary_(std::move(boundary)),
        boundary_runs_(find_runs(&Layout::boundary)),
        interior_runs_(find_runs(&Layout::interior)) {
    cut_interior();
  }
};

}  // namespace phyxel
