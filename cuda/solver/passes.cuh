/// The two passes of a step as launches: one for all tiles of bodies of one law side by side.
#pragma once

#include "solver/device_model.cuh"

namespace phyxel::cuda {

template <class Real, class StateReal>
class Passes {
  using AllFields = Fields<Real, StateReal>;
  using Pass1 = void (*)(AllFields, DeviceLists, Index, Gradients<Real>);
  using Pass2 = void (*)(AllFields, DeviceLists, Index, StateReal, Real*);

 public:
  explicit Passes(const DeviceModel<Real, StateReal>& model) : m_(model) {
    const auto add = [](auto& runs, auto kernel, Index tile) {
      if (!runs.empty() && runs.back().kernel == kernel) {
        ++runs.back().tiles;
      } else {
        runs.push_back({kernel, tile, 1});
      }
    };
    for (Index tile = 0; tile < m_.tiles(); ++tile) {
      const Material& material = m_.model().parts[m_.tiling().part[tile]].material;
      add(stress_runs_, pass_1_of(material), tile);
      add(advance_runs_, m_.own_supports() ? pass_2_of<true>(material) : pass_2_of<false>(material),
          tile);
    }
  }

  void stress() const {
    for (const Run<Pass1>& run : stress_runs_) launch_pass_1(m_.fields(), run, {});
  }
  void advance(double dt) const {
    for (const Run<Pass2>& run : advance_runs_) {
      launch_pass_2(run, static_cast<StateReal>(dt), nullptr);
    }
  }
  /// Pass 1 of every body by the linear law of `constants`, which volume conservation is part of.
  void linear_stress(const TileConstants<Real, StateReal>* constants) const {
    AllFields fields = m_.fields();
    fields.tiles = constants;
    launch_pass_1(fields, {pass_1<Real, StateReal, false, false, false>, 0, m_.tiles()}, {});
  }
  /// Internal forces by the stresses that pass 1 has left, into an array of shape [3, places].
  void gather(Real* forces) const {
    launch_pass_2({m_.own_supports() ? pass_2<Real, StateReal, true, false, false, true>
                                     : pass_2<Real, StateReal, false, false, false, true>,
                   0, m_.tiles()},
                  StateReal(0), forces);
  }
  DeviceArray<Real> forces() const {
    stress();
    DeviceArray<Real> forces(3 * m_.places(), "forces of " + m_.subject());
    gather(forces.data());
    return forces;
  }
  DeviceArray<Real> gradients() const {
    DeviceArray<Real> gradients(9 * m_.places(), "displacement gradients of " + m_.subject());
    put_gradients({gradients.data(), m_.places(), nullptr}, m_.tiles());
    return gradients;
  }
  /// Those of `tiles` tiles.
  void put_gradients(Gradients<Real> gradients, Index tiles) const {
    launch_pass_1(m_.fields(), {pass_1<Real, StateReal, true, false, true>, 0, tiles}, gradients);
  }

 private:
  /// Tiles side by side that one launch serves.
  template <class Kernel>
  struct Run {
    Kernel kernel;
    Index first_tile, tiles;
  };

  /// Terms chosen at run time become kernels: the one place.
  static Pass1 pass_1_of(const Material& m) {
    const bool volume = m.volume_stiffness > 0;
    if (m.strain == Strain::green) {
      return volume ? pass_1<Real, StateReal, true, true, false>
                    : pass_1<Real, StateReal, true, false, false>;
    }
    return volume ? pass_1<Real, StateReal, false, true, false>
                  : pass_1<Real, StateReal, false, false, false>;
  }
  template <bool own_supports>
  Pass2 pass_2_of(const Material& m) const {
    const bool loaded = !m_.model().loads.empty();
    if (m.damping > 0) {
      return loaded ? pass_2<Real, StateReal, own_supports, true, true, false>
                    : pass_2<Real, StateReal, own_supports, true, false, false>;
    }
    return loaded ? pass_2<Real, StateReal, own_supports, false, true, false>
                  : pass_2<Real, StateReal, own_supports, false, false, false>;
  }

  void launch_pass_1(const AllFields& fields, const Run<Pass1>& run,
                     Gradients<Real> gradients) const {
    m_.launch_blocks("pass_1", run.kernel, static_cast<unsigned>(run.tiles),
                     Points<Real>::bytes * m_.lists().slots, false, fields, m_.lists(),
                     run.first_tile, gradients);
  }
  void launch_pass_2(const Run<Pass2>& run, StateReal dt, Real* force) const {
    m_.launch_blocks("pass_2", run.kernel, static_cast<unsigned>(run.tiles),
                     m_.pass_2_bytes(m_.second_lists().slots), false, m_.fields(),
                     m_.second_lists(), run.first_tile, dt, force);
  }

  const DeviceModel<Real, StateReal>& m_;
  std::vector<Run<Pass1>> stress_runs_;
  std::vector<Run<Pass2>> advance_runs_;
};

}  // namespace phyxel::cuda
