/// The two passes of a step as launches: one for all tiles of bodies of one law side by side. Of a
/// share, with the exchanges that they need.
#pragma once

#include "solver/device_halo.cuh"

namespace phyxel::cuda {

template <class Real, class StateReal>
class Passes {
  using AllFields = Fields<Real, StateReal>;
  using Pass1 = void (*)(AllFields, DeviceLists, Index, Gradients<Real>);
  using Pass2 = void (*)(AllFields, DeviceLists, Index, StateReal, Real*);

 public:
  /// @param halo of a share, or null
  Passes(const DeviceModel<Real, StateReal>& model, const DeviceHalo<Real, StateReal>* halo)
      : m_(model), halo_(halo) {
    const auto add = [](auto& runs, auto kernel, Index tile) {
      if (!runs.empty() && runs.back().kernel == kernel) {
        ++runs.back().tiles;
      } else {
        runs.push_back({kernel, tile, 1});
      }
    };
    for (Index tile = 0; tile < m_.tiles(); ++tile) {
      const Material& material = m_.model().parts[m_.tiling().part[tile]].material;
      Runs& runs = tile < m_.interior_tiles() ? interior_ : boundary_;
      add(runs.stress, pass_1_of(material), tile);
      add(runs.advance, m_.own_supports() ? pass_2_of<true>(material) : pass_2_of<false>(material),
          tile);
    }
  }

  /// What ghosts are not needed for is launched before they are waited for.
  void stress() const {
    launch_stress(interior_);
    receive(Sent::displacements);
    launch_stress(boundary_);
    send(Sent::stresses);
  }
  void advance(double dt) const {
    launch_advance(interior_, dt);
    receive(Sent::stresses);
    launch_advance(boundary_, dt);
  }
  /// After displacements have changed: other ranks get theirs.
  void send_displacements() const { send(Sent::displacements); }
  /// Ghosts' displacements are there for what is launched from now on.
  void receive_displacements() const { receive(Sent::displacements); }

  /// Values of phyxels, to those who have them as ghosts, through the host. Of shares only.
  template <class Records>
  void exchange(const Records& records) const {
    halo_->exchange(records);
  }

  /// Pass 1 of every body by the linear law of `constants`, which volume conservation is part of.
  void linear_stress(const TileConstants<Real, StateReal>* constants) const {
    AllFields fields = m_.fields();
    fields.tiles = constants;
    receive(Sent::displacements);
    launch_pass_1(fields, {pass_1<Real, StateReal, false, false, false>, 0, m_.tiles()}, {});
    send(Sent::stresses);
  }
  /// Internal forces by the stresses that pass 1 has left, into an array of shape [3, places].
  void gather(Real* forces) const {
    receive(Sent::stresses);
    launch_pass_2({m_.own_supports() ? pass_2<Real, StateReal, true, false, false, true>
                                     : pass_2<Real, StateReal, false, false, false, true>,
                   0, m_.tiles()},
                  StateReal(0), forces);
  }
  /// Of ghosts: zero.
  DeviceArray<Real> forces() const {
    DeviceArray<Real> forces = without_ghosts(3, "forces of ");
    stress();
    gather(forces.data());
    return forces;
  }
  DeviceArray<Real> gradients() const {
    DeviceArray<Real> gradients = without_ghosts(9, "displacement gradients of ");
    put_gradients({gradients.data(), m_.places(), nullptr}, m_.tiles());
    return gradients;
  }
  /// Those of `tiles` tiles.
  void put_gradients(Gradients<Real> gradients, Index tiles) const {
    receive(Sent::displacements);
    launch_pass_1(m_.fields(), {pass_1<Real, StateReal, true, false, true>, 0, tiles}, gradients);
  }

 private:
  /// Tiles side by side that one launch serves.
  template <class Kernel>
  struct Run {
    Kernel kernel;
    Index first_tile, tiles;
  };
  struct Runs {
    std::vector<Run<Pass1>> stress;
    std::vector<Run<Pass2>> advance;
  };

  void send(Sent what) const {
    if (halo_) halo_->begin(what);
  }
  void receive(Sent what) const {
    if (halo_) halo_->finish(what);
  }
  void launch_stress(const Runs& runs) const {
    for (const Run<Pass1>& run : runs.stress) launch_pass_1(m_.fields(), run, {});
  }
  void launch_advance(const Runs& runs, double dt) const {
    for (const Run<Pass2>& run : runs.advance) {
      launch_pass_2(run, static_cast<StateReal>(dt), nullptr);
    }
  }
  DeviceArray<Real> without_ghosts(std::size_t rows, const char* what) const {
    DeviceArray<Real> array(rows * m_.places(), what + m_.subject());
    if (m_.share()) array.clear(m_.stream());
    return array;
  }

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
  const DeviceHalo<Real, StateReal>* halo_;
  Runs interior_, boundary_;
};

}  // namespace phyxel::cuda
