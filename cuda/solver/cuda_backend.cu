#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include "solver/boundary.cuh"
#include "solver/cuda_backend.hpp"
#include "solver/device_model.cuh"
#include "solver/passes.cuh"
#include "solver/residence.cuh"
#include "solver/surfels.cuh"
#include "solver/vibration.cuh"

namespace phyxel {
namespace {

using namespace cuda;

template <class Real, class StateReal>
class CudaBackend final : public Backend {
 public:
  CudaBackend(const Model& model, int device, CudaPath path)
      : m_(model, device), boundary_(m_), passes_(m_) {
    if (path == CudaPath::automatic && !boundary_.changes()) {
      residence_ = Residence<Real, StateReal>::of(m_);
    }
  }

  std::string name() const override {
    const char* precision = m_.mixed ? "mixed" : sizeof(Real) == 4 ? "float" : "double";
    const std::string path =
        residence_ ? residence_->describe() : "tiles of " + std::to_string(tile_size);
    return m_.device().name + ", " + precision + ", " + path;
  }
  Index size() const override { return m_.size(); }
  int threads() const override { return 0; }

  void upload(const State& state) override {
    wait();
    fresh_ = true;
    m_.put(state);
  }
  void download(State& state) const override {
    wait();
    m_.take(state);
  }

  void stress() override {
    if (stays_resident()) return;
    m_.use_device();
    passes_.stress();
  }

  void advance(double time, double dt) override {
    if (dt != m_.dt()) {
      settle();
      m_.send_constants(dt);
    }
    if (stays_resident()) {
      if (++pending_ < residence_->most_steps) return;
      settle();
      bound_queue(residence_->most_steps);
      return;
    }
    m_.use_device();
    boundary_.sum_loads(time);
    passes_.advance(dt);
    boundary_.follow_paths(time, dt);
    if (fresh_) boundary_.put_held_at_rest();
    fresh_ = false;
    bound_queue(1);
  }

  void wait() const override {
    settle();
    m_.wait();
  }

  std::optional<Diagnostics> diagnostics(double time, double dt) override {
    settle();
    boundary_.sum_loads(time);
    const DeviceArray<Real> forces = passes_.forces(), gradients = passes_.gradients();
    const auto tiles = static_cast<unsigned>(m_.tiles());
    const DeviceArray<Totals> each(tiles, "sums of " + m_.subject()), all(1, "sums");
    diagnose_tiles<<<tiles, diagnose_threads, 0, m_.stream()>>>(m_.fields(), m_.materials(),
                                                                boundary_.moved(), forces.data(),
                                                                gradients.data(), dt, each.data());
    m_.launched("diagnose_tiles", tiles, diagnose_threads);
    add_tiles<<<1, diagnose_threads, 0, m_.stream()>>>(each.data(), m_.tiles(), all.data());
    m_.launched("add_tiles", 1, diagnose_threads);
    wait();
    const Totals t = fetched(all)[0];
    const auto vector = [&](int first) {
      return Vec3d{t.sum[first], t.sum[first + 1], t.sum[first + 2]};
    };
    const auto phyxel = [&](Index place) { return place < 0 ? -1 : m_.tiling().phyxel[place]; };
    Diagnostics d;
    d.kinetic_energy = t.sum[kinetic_energy];
    d.strain_energy = t.sum[strain_energy];
    d.volume_energy = t.sum[volume_energy];
    d.gravity_energy = t.sum[gravity_energy];
    d.load_energy = t.sum[load_energy];
    d.momentum = vector(momentum);
    d.angular_momentum = vector(angular_momentum);
    d.internal_force = vector(internal_force);
    d.internal_torque = vector(internal_torque);
    d.force_scale = t.sum[force_scale];
    d.torque_scale = t.sum[torque_scale];
    d.inverted = static_cast<Index>(t.sum[inverted]);
    d.largest_displacement = t.largest_displacement;
    d.largest_speed = t.largest_speed;
    d.fastest_phyxel = phyxel(t.fastest);
    d.bad_phyxel = phyxel(t.first_bad);
    return d;
  }

  void internal_forces(std::vector<Vec3d>& force) override {
    settle();
    const DeviceArray<Real> forces = passes_.forces();
    wait();
    const std::vector<Real> values = fetched(forces);
    force.resize(static_cast<std::size_t>(size()));
    for (Index i = 0; i < size(); ++i) {
      const auto place = static_cast<std::size_t>(m_.tiling().place[i]);
      force[i] = {values[place], values[m_.places() + place], values[2 * m_.places() + place]};
    }
  }

  void displacement_gradients(std::vector<Mat3d>& gradient) override {
    settle();
    const DeviceArray<Real> gradients = passes_.gradients();
    wait();
    const std::vector<Real> values = fetched(gradients);
    gradient.resize(static_cast<std::size_t>(size()));
    for (Index i = 0; i < size(); ++i) {
      for (int e = 0; e < 9; ++e) {
        gradient[i](e / 3, e % 3) =
            values[static_cast<std::size_t>(e) * m_.places() + m_.tiling().place[i]];
      }
    }
  }

  std::unique_ptr<Vibration> vibration() override {
    settle();
    return std::make_unique<CudaVibration<Real, StateReal>>(m_, passes_);
  }

  void update_surfels() override {
    if (m_.model().surfels.position.empty()) return;
    settle();
    if (!surfels_) surfels_.emplace(m_);
    surfels_->launch();
  }
  void advect_surfels(SurfelState& out) override {
    update_surfels();
    wait();
    if (surfels_) {
      surfels_->download(out);
    } else {
      out = {};
    }
  }

  std::vector<ArrayBytes> memory() const override {
    std::vector<ArrayBytes> list;
    m_.add_memory(list);
    if (residence_) list.push_back({"what stays in shared memory", residence_->bytes()});
    if (surfels_) list.push_back({"surfels", surfels_->bytes()});
    list.push_back({"while energies are summed", 12 * sizeof(Real) * m_.places()});
    return list;
  }
  std::size_t step_traffic() const override { return m_.step_traffic(); }

 private:
  /// The first step after an upload goes by launches, which see held phyxels where they were put.
  bool stays_resident() const { return residence_ && !fresh_; }

  /// Makes this device the current one and launches the steps that wait for it.
  void settle() const {
    m_.use_device();
    if (pending_ == 0) return;
    residence_->launch(m_.dt(), std::exchange(pending_, 0));  // once, whatever happens
  }

  /// Lets the host run ahead by some ten milliseconds of steps, not by the hundreds that the queue
  /// takes: a signal would wait for them all.
  void bound_queue(int steps) {
    const int most = residence_ ? 2 * residence_->most_steps : 128;
    const auto ahead = static_cast<int>(
        std::clamp<std::size_t>(50'000'000 / m_.places(), 1, static_cast<std::size_t>(most)));
    if ((steps_since_mark_ += steps) < ahead) return;
    steps_since_mark_ = 0;
    const Event& mark = marks_[batches_++ % 2];
    PHYXEL_CUDA(cudaEventSynchronize(mark.get()));  // of the last batch but one; at once if none
    PHYXEL_CUDA(cudaEventRecord(mark.get(), m_.stream()));
  }

  DeviceModel<Real, StateReal> m_;
  Boundary<Real, StateReal> boundary_;
  Passes<Real, StateReal> passes_;
  std::unique_ptr<Residence<Real, StateReal>> residence_;
  std::optional<SurfelAdvection<Real, StateReal>> surfels_;  // once they have been asked for
  bool fresh_ = true;        // no step has been taken since the last upload
  mutable int pending_ = 0;  // steps that wait to be launched
  Event marks_[2];
  int steps_since_mark_ = 0;
  unsigned batches_ = 0;
};

}  // namespace

std::unique_ptr<Backend> make_cuda_backend(const Model& model, Precision precision, int device,
                                           CudaPath path) {
  switch (precision) {
    case Precision::single:
      return std::make_unique<CudaBackend<float, float>>(model, device, path);
    case Precision::mixed:
      return std::make_unique<CudaBackend<float, double>>(model, device, path);
    case Precision::double_:
      break;
  }
  return std::make_unique<CudaBackend<double, double>>(model, device, path);
}

}  // namespace phyxel
