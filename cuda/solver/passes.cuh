/// The launches of the two passes of a step, one for each run of consecutive tiles with one law,
/// and the halo exchanges of a share.
#pragma once

#include "solver/device_fracture.cuh"
#include "solver/device_halo.cuh"

namespace phyxel::cuda {

template <class Real, class StateReal>
class Passes {
  using AllFields = Fields<Real, StateReal>;
  template <class Halo>
  using Pass1 = void (*)(AllFields, DeviceLists, Index, Gradients<Real>, Halo);
  template <class Halo>
  using Pass2 = void (*)(AllFields, DeviceLists, Index, StateReal, Real*, Halo);
  using Fused1 = FusedHalo<Stresses<Real>>;
  using FusedClosed1 = FusedHalo<ClosedStresses<Real>>;
  using Fused2 = FusedHalo<Points<Real>>;

 public:
  /// @param halo halo of a share, or null. @param fracture must outlive this
  Passes(const DeviceModel<Real, StateReal>& model, const DeviceHalo<Real, StateReal>* halo,
         const DeviceFracture<Real, StateReal>& fracture)
      : m_(model),
        halo_(halo),
        fracture_(fracture),
        direct_(halo ? halo->fused() : nullptr),
        interior_(m_.boundary_tiles(), m_.tiles(), *this),
        boundary_(0, m_.boundary_tiles(), *this),
        fused_(0, direct_ && !m_.closed() ? m_.tiles() : 0, *this),
        fused_closed_(0, direct_ && m_.closed() ? m_.tiles() : 0, *this) {
    linear_ = runs_of<Pass1<NoHalo>>(0, m_.tiles(),
                                     [&](const Part& part) { return linear_pass_1_of(part); });
  }

  /// Launches pass 1, and adds the forces of closed cracks. Interior tiles, which need no ghosts,
  /// are launched before the wait for ghosts, unless there may be cracks.
  /// @param use treatment of histories. @param interval time from the histories to the present
  /// displacements [s]
  void stress(HistoryUse use, double interval) const {
    AllFields fields = m_.fields();
    fields.history_use = use;
    fields.history_interval = static_cast<Real>(interval);
    if (!fracture_.acts()) return launch_stress(fields);
    // Once stresses are sent, other ranks may send the next displacements of ghosts.
    receive(Sent::displacements);
    fracture_.find_closed();
    launch_stress(fields);
    fracture_.add_closed();
  }
  /// Launches pass 2. Displacements may still change before they are sent to other ranks
  /// (`send_displacements`).
  void advance(double dt) const {
    interior_.advance(dt, {});
    receive(Sent::stresses);
    boundary_.advance(dt, {});
  }
  void advance_and_send(double dt) const {
    if (direct_) {
      const bool waits = halo_->begin_fused_pass(Sent::stresses, Sent::displacements);
      if (m_.closed()) {
        fused_closed_.advance(dt, direct_->of_pass_2(waits));
      } else {
        fused_.advance(dt, direct_->of_pass_2(waits));
      }
      return;
    }
    advance(dt);
    send_displacements();
  }
  /// Sends changed displacements to other ranks.
  void send_displacements() const { send(Sent::displacements); }
  /// Makes later launches see the displacements of ghosts.
  void receive_displacements() const { receive(Sent::displacements); }

  /// Sends values of phyxels to the ranks that have them as ghosts. Of shares only.
  template <class Records>
  void exchange(const Records& records) const {
    halo_->exchange(records);
  }

  /// Launches pass 1 with the linearisation of every law at rest, volume conservation included.
  /// @param constants result of `DeviceModel::rest_constants`
  void linear_stress(const TileConstants<Real, StateReal>* constants) const {
    AllFields fields = m_.fields();
    fields.tiles = constants;
    receive(Sent::displacements);
    for (const auto& run : linear_) launch_pass_1<NoHalo>(fields, run, {}, {});
    send(Sent::stresses);
  }
  /// Computes internal forces [N] from the stresses of pass 1. @param forces receives them, shape
  /// [3, places]
  void gather(Real* forces) const {
    receive(Sent::stresses);
    launch_pass_2<NoHalo>({force_kernel(), 0, m_.tiles()}, StateReal(0), forces, {});
  }
  /// Advances histories to the present displacements.
  void commit(double interval) const {
    stress(HistoryUse::commit, interval);
    receive(Sent::stresses);
  }
  /// Returns the internal forces [N], shape [3, places]; zero for ghosts.
  DeviceArray<Real> forces(HistoryUse use, double interval) const {
    DeviceArray<Real> forces = without_ghosts(3, "forces of ");
    stress(use, interval);
    gather(forces.data());
    return forces;
  }
  DeviceArray<Real> gradients() const {
    DeviceArray<Real> gradients = without_ghosts(9, "displacement gradients of ");
    put_gradients({gradients.data(), m_.places(), nullptr}, m_.tiles());
    return gradients;
  }
  /// Returns the displacement gradients and, in row 9, the residuals of their fits
  /// (`add_residual`), shape [10, places].
  DeviceArray<Real> gradients_and_residuals() const {
    DeviceArray<Real> rows = without_ghosts(10, "displacement gradients of ");
    put_gradients({rows.data(), m_.places(), nullptr, rows.data() + 9 * m_.places()}, m_.tiles());
    return rows;
  }
  /// Computes the gradients of the first `tiles` tiles.
  void put_gradients(Gradients<Real> gradients, Index tiles) const {
    receive(Sent::displacements);
    launch_pass_1<NoHalo>(m_.fields(), {gradient_kernel(), 0, tiles}, gradients, {});
  }

 private:
  /// Consecutive tiles of one launch.
  template <class Kernel>
  struct Run {
    Kernel kernel;
    Index first_tile, tiles;
  };
  /// Returns the launches for tiles [begin, end). @param kernel_of returns the kernel of a part
  template <class Kernel, class KernelOf>
  std::vector<Run<Kernel>> runs_of(Index begin, Index end, KernelOf&& kernel_of) const {
    std::vector<Kernel> of_part;
    for (const Part& part : m_.model().parts) of_part.push_back(kernel_of(part));
    std::vector<Run<Kernel>> runs;
    for (Index tile = begin; tile < end; ++tile) {
      const Kernel kernel = of_part[m_.tiling().part[tile]];
      if (!runs.empty() && runs.back().kernel == kernel) {
        ++runs.back().tiles;
      } else {
        runs.push_back({kernel, tile, 1});
      }
    }
    return runs;
  }
  /// The launches of a step for consecutive tiles.
  template <class Halo1, class Halo2>
  struct Runs {
    Runs(Index begin, Index end, const Passes& passes)
        : of(passes),
          pass_1(of.template runs_of<Pass1<Halo1>>(
              begin, end, [&](const Part& part) { return of.template pass_1_of<Halo1>(part); })),
          pass_2(of.template runs_of<Pass2<Halo2>>(
              begin, end, [&](const Part& part) { return of.template pass_2_of<Halo2>(part); })) {}
    void stress(const AllFields& fields, const Halo1& exchange) const {
      for (const auto& run : pass_1) {
        of.template launch_pass_1<Halo1>(fields, run, {}, exchange);
      }
    }
    void advance(double dt, const Halo2& exchange) const {
      for (const auto& run : pass_2) {
        of.template launch_pass_2<Halo2>(run, static_cast<StateReal>(dt), nullptr, exchange);
      }
    }

    const Passes& of;
    std::vector<Run<Pass1<Halo1>>> pass_1;
    std::vector<Run<Pass2<Halo2>>> pass_2;
  };

  /// Launches pass 1 alone.
  void launch_stress(const AllFields& fields) const {
    if (direct_) {
      const bool waits = halo_->begin_fused_pass(Sent::displacements, Sent::stresses);
      if (m_.closed()) {
        fused_closed_.stress(fields, direct_->template of_pass_1<ClosedStresses<Real>>(waits));
      } else {
        fused_.stress(fields, direct_->template of_pass_1<Stresses<Real>>(waits));
      }
      return;
    }
    interior_.stress(fields, {});
    receive(Sent::displacements);
    boundary_.stress(fields, {});
    send(Sent::stresses);
  }

  void send(Sent what) const {
    if (halo_) halo_->begin(what);
  }
  void receive(Sent what) const {
    if (halo_) halo_->finish(what);
  }
  DeviceArray<Real> without_ghosts(std::size_t rows, const char* what) const {
    DeviceArray<Real> array(rows * m_.places(), what + m_.subject());
    if (m_.share()) array.clear(m_.stream());
    return array;
  }

  /// Calls use(std::type_identity<Terms>) with the list of pair terms of a kernel, but for
  /// hourglass control. All kernels are selected by this function or the next.
  /// @tparam Halo exchange of the kernel: some exist only with, some only without closed gradients
  /// @param pairwise true if a body that the kernel serves has weights of pairs
  template <class Halo, class Use>
  auto with_terms(bool pairwise, Use&& use) const {
    constexpr bool always_closed = std::is_same_v<Halo, FusedClosed1>;
    if constexpr (!std::is_same_v<Halo, Fused1>) {
      if (pairwise) return use(std::type_identity<WithPairWeights>{});
      if (m_.closed()) return use(std::type_identity<WithClosing>{});
    }
    return use(std::type_identity<std::conditional_t<always_closed, WithClosing, NoPairTerms>>{});
  }
  /// Calls `use` likewise, with hourglass control.
  template <class Halo, class Use>
  auto with_terms(bool pairwise, bool hourglass, Use&& use) const {
    return with_terms<Halo>(pairwise, [&]<class Terms>(std::type_identity<Terms> terms) {
      // Lists with closed gradients include hourglass control.
      using Controlled = std::conditional_t<Terms::sends, Terms, WithHourglass>;
      return hourglass ? use(std::type_identity<Controlled>{}) : use(terms);
    });
  }
  template <class Halo>
  Pass1<Halo> pass_1_of(const Part& part) const {
    const Material& m = part.material;
    const auto of_terms = [&]<class Terms>(std::type_identity<Terms>) {
      return pass_1_of<Terms, Halo>(m);
    };
    return with_terms<Halo>(part.pair_length > 0, m.hourglass > 0, of_terms);
  }
  template <class Terms, class Halo>
  static Pass1<Halo> pass_1_of(const Material& m) {
    if (m.viscosity > 0) return cuda::pass_1<Real, StateReal, AnyViscousLaw, Terms, false, Halo>;
    return Laws::with_type<Real>(chosen_law(m).index, [&]<class Law>(std::type_identity<Law>) {
      using WithVolume = SolidLaw<Law, Real>;
      return m.volume_stiffness > 0
                 ? Pass1<Halo>(cuda::pass_1<Real, StateReal, WithVolume, Terms, false, Halo>)
                 : cuda::pass_1<Real, StateReal, Law, Terms, false, Halo>;
    });
  }
  /// Returns the kernel of pass 1 with the linearisation of a law at rest.
  Pass1<NoHalo> linear_pass_1_of(const Part& part) const {
    const int law = chosen_law(part.material).index;
    const auto of_terms = [&]<class Terms>(std::type_identity<Terms>) {
      return Laws::with_type<Real>(law, [&]<class Law>(std::type_identity<Law>) {
        using Linear = decltype(std::declval<Law>().at_rest(Real()));
        return Pass1<NoHalo>(cuda::pass_1<Real, StateReal, Linear, Terms, false>);
      });
    };
    return with_terms<NoHalo>(part.pair_length > 0, m_.fields().pull, of_terms);
  }
  /// Returns the kernel for the gradients of all bodies.
  Pass1<NoHalo> gradient_kernel() const {
    using Any = StVenantKirchhoff<Real>;  // gradients do not depend on the law
    return with_terms<NoHalo>(m_.pairwise(), []<class Terms>(std::type_identity<Terms>) {
      return Pass1<NoHalo>(cuda::pass_1<Real, StateReal, Any, Terms, true>);
    });
  }

  /// Returns a kernel of pass 2. Weights of pairs always use `Fields::inverse_h_squared`.
  template <bool damped, bool extra_forces, bool only_force, class Halo, class Terms>
  Pass2<Halo> pass_2_of() const {
    constexpr bool pairwise = Terms::template has<PairWeights>;
    return m_.own_supports()
               ? cuda::pass_2<Real, StateReal, true, damped, extra_forces, only_force, Halo, Terms>
               : cuda::pass_2<Real, StateReal, pairwise, damped, extra_forces, only_force, Halo,
                              Terms>;
  }
  template <class Halo>
  Pass2<Halo> pass_2_of(const Part& part) const {
    const bool damped = part.material.damping > 0;
    return with_terms<Halo>(part.pair_length > 0, [&]<class Terms>(std::type_identity<Terms>) {
      if constexpr (!Terms::sends) {  // beside closing stresses, other forces cost nothing
        if (!m_.fields().load && !m_.fields().pull) {
          return damped ? pass_2_of<true, false, false, Halo, Terms>()
                        : pass_2_of<false, false, false, Halo, Terms>();
        }
      }
      return damped ? pass_2_of<true, true, false, Halo, Terms>()
                    : pass_2_of<false, true, false, Halo, Terms>();
    });
  }
  /// Returns the kernel for the internal forces of all bodies.
  Pass2<NoHalo> force_kernel() const {
    return with_terms<NoHalo>(m_.pairwise(), [&]<class Terms>(std::type_identity<Terms>) {
      return pass_2_of<false, false, true, NoHalo, Terms>();
    });
  }

  template <class Halo>
  void launch_pass_1(const AllFields& fields, const Run<Pass1<Halo>>& run,
                     Gradients<Real> gradients, const Halo& exchange) const {
    m_.launch_blocks("pass_1", run.kernel, static_cast<unsigned>(run.tiles),
                     m_.pass_1_bytes(m_.lists().slots), false, fields, m_.lists(), run.first_tile,
                     gradients, exchange);
  }
  template <class Halo>
  void launch_pass_2(const Run<Pass2<Halo>>& run, StateReal dt, Real* force,
                     const Halo& exchange) const {
    m_.launch_blocks("pass_2", run.kernel, static_cast<unsigned>(run.tiles),
                     m_.pass_2_bytes(m_.second_lists().slots), false, m_.fields(),
                     m_.second_lists(), run.first_tile, dt, force, exchange);
  }

  const DeviceModel<Real, StateReal>& m_;
  const DeviceHalo<Real, StateReal>* halo_;
  const DeviceFracture<Real, StateReal>& fracture_;
  const DirectExchange<Real, StateReal>* direct_;
  Runs<NoHalo, NoHalo> interior_, boundary_;
  std::vector<Run<Pass1<NoHalo>>> linear_;  // all tiles, by the laws at rest
  // All tiles, with the halo exchange inside the passes.
  Runs<Fused1, Fused2> fused_;
  Runs<FusedClosed1, Fused2> fused_closed_;
};

}  // namespace phyxel::cuda
