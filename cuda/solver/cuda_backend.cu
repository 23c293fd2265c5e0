#include <algorithm>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "check.hpp"
#include "device.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/surfel.hpp"
#include "setup/device_tiling.hpp"
#include "setup/primitives.cuh"
#include "solver/carrier_weights.hpp"
#include "solver/crossings.cuh"
#include "solver/cuda_backend.hpp"
#include "solver/diagnose.cuh"
#include "solver/kernels.cuh"
#include "solver/resident.cuh"
#include "solver/vibration.cuh"

namespace phyxel {
namespace {

using namespace cuda;

/// Phyxels that are set after each step.
template <class Real, class StateReal>
__global__ void follow(Fields<Real, StateReal> f, const Index* place, int count,
                       Vec3<StateReal> displacement, Vec3<StateReal> velocity) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  const Index at = place[k];
  set_column3(f.velocity, f.places, at, velocity);
  if constexpr (!std::is_same_v<Real, StateReal>) {
    set_column3(f.displacement, f.places, at, displacement);
  }
  auto point = f.points.get(at);
  point.u = to<Real>(displacement);
  f.points.set(at, point);
}

/// load[place] += scale · force; every place once.
template <class Real>
__global__ void add_load(Real* load, std::size_t places, const Index* place,
                         const Vec3<Real>* force, int count, Real scale) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  set_column3(load, places, place[k], column3(load, places, place[k]) + scale * force[k]);
}

/// Surfels in device memory. Positions are taken from the origin of their body.
template <class Real, class StateReal>
struct DeviceSurfels {
  const Vec3<Real>*position, *normal;
  const Offset* offsets;
  const Index* carriers;  ///< Places.
  const Real* weight;     ///< Full weights, over the largest of the surfel.
  Vec3<StateReal>* displacement;
  Vec3<StateReal>* moved_normal;
  int count;
};

/// Equation (6), in the precision of the state.
template <class Real, class StateReal>
__global__ void advect(Fields<Real, StateReal> f, const Real* gradient,
                       DeviceSurfels<Real, StateReal> surfels) {
  const int s = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (s >= surfels.count) return;
  SurfelBlend<StateReal> blend;
  for (Offset k = surfels.offsets[s]; k < surfels.offsets[s + 1]; ++k) {
    const Index place = surfels.carriers[k];
    const auto point = f.points.get(place);
    Vec3<StateReal> u = to<StateReal>(point.u);
    if constexpr (!std::is_same_v<Real, StateReal>) u = column3(f.displacement, f.places, place);
    Mat3<StateReal> grad_u;
    for (int e = 0; e < 9; ++e) grad_u(e / 3, e % 3) = gradient[e * f.places + place];
    blend.add(surfels.weight[k], u, grad_u, to<StateReal>(surfels.position[s] - point.x));
  }
  const Vec3<StateReal> normal = blend.surfel_normal(to<StateReal>(surfels.normal[s]));
  surfels.displacement[s] = blend.surfel_displacement();
  surfels.moved_normal[s] = (StateReal(1) / sqrt(dot(normal, normal))) * normal;
}

/// A point in the queue of launches that can be waited for.
class Event {
 public:
  Event() { PHYXEL_CUDA(cudaEventCreateWithFlags(&event_, cudaEventDisableTiming)); }
  Event(const Event&) = delete;
  Event& operator=(const Event&) = delete;
  ~Event() { cudaEventDestroy(event_); }
  cudaEvent_t get() const { return event_; }

 private:
  cudaEvent_t event_ = nullptr;
};

template <class Real, class StateReal>
class CudaBackend final : public Backend {
  static constexpr bool mixed = !std::is_same_v<Real, StateReal>;
  using BodyConstants = TileConstants<Real, StateReal>;
  using AllFields = Fields<Real, StateReal>;
  using Pass1 = void (*)(AllFields, DeviceLists, Index, Real*);
  using Pass2 = void (*)(AllFields, DeviceLists, Index, StateReal, Real*);

 public:
  CudaBackend(const Model& model, int device, CudaPath path)
      : model_(model), device_(use_cuda_device(device)), tiling_(make_device_tiling(model)) {
    PHYXEL_CUDA(cudaDeviceGetAttribute(&most_shared_memory_,
                                       cudaDevAttrMaxSharedMemoryPerBlockOptin, device_.index));
    own_supports_ = !one_support_each();
    subject_ = std::to_string(model.size()) + " phyxels";
    make_lists();
    make_fields();
    make_motions();
    make_loads();
    make_runs();
    if (path == CudaPath::automatic) make_resident();
  }

  std::string name() const override {
    const char* precision = mixed ? "mixed" : sizeof(Real) == 4 ? "float" : "double";
    const std::string path =
        resident_ ? resident_->describe() : "tiles of " + std::to_string(tile_size);
    return device_.name + ", " + precision + ", " + path;
  }
  Index size() const override { return model_.size(); }
  int threads() const override { return 0; }

  void upload(const State& state) override {
    wait();
    dt_ = -1;  // whatever depends on it is sent with the next step
    fresh_ = true;
    const DeviceArray<Vec3d> u = sent(state.displacement, "displacements of " + subject_),
                             v = sent(state.velocity, "velocities of " + subject_);
    const auto tiles = static_cast<unsigned>(tiling_.tiles());
    put_state<<<tiles, tile_size>>>(fields_, tiling_.phyxel_at.data(), u.data(), v.data());
    launched("put_state", tiles, tile_size);
    wait();
  }

  void download(State& state) const override {
    wait();
    const auto n = static_cast<std::size_t>(size());
    const DeviceArray<Vec3d> u(n, "displacements of " + subject_),
        v(n, "velocities of " + subject_);
    const auto tiles = static_cast<unsigned>(tiling_.tiles());
    take_state<<<tiles, tile_size>>>(fields_, tiling_.phyxel_at.data(), u.data(), v.data());
    launched("take_state", tiles, tile_size);
    state.displacement = fetched(u);
    state.velocity = fetched(v);
  }

  void stress() override {
    if (!stays_resident()) stress_now();
  }

  void advance(double time, double dt) override {
    if (stays_resident()) {
      if (dt != dt_) {
        settle();
        send_constants(dt);
      }
      if (++pending_ >= most_pending) {
        settle();
        bound_queue(most_pending);
      }
      return;
    }
    use_device();
    if (dt != dt_) send_constants(dt);
    sum_loads(time);
    for (const Run<Pass2>& run : advance_runs_) {
      launch_pass_2(run, static_cast<StateReal>(dt), nullptr);
    }
    for (const Following& motion : motions_) {
      const Vec3d after = motion.of->displacement_at(time + dt);
      const Vec3d velocity = (after - motion.of->displacement_at(time)) / dt;
      set_phyxels(motion.places, after, velocity);
    }
    if (fresh_ && held_places_.size() > 0) {  // they stay where their motion says: at rest
      set_phyxels(held_places_, {}, {});
    }
    fresh_ = false;
    bound_queue(1);
  }

  void wait() const override {
    settle();
    wait_for_device(last_launch_);
  }

  std::optional<Diagnostics> diagnostics(double time, double dt) override {
    settle();
    sum_loads(time);
    const DeviceArray<Real> forces = forces_now(), gradients = gradients_now();
    const auto tiles = static_cast<unsigned>(tiling_.tiles());
    const DeviceArray<Totals> each(tiles, "sums of " + subject_), all(1, "sums");
    diagnose_tiles<<<tiles, diagnose_threads>>>(fields_, materials_.data(), moved_.data(),
                                                forces.data(), gradients.data(), dt, each.data());
    launched("diagnose_tiles", tiles, diagnose_threads);
    add_tiles<<<1, diagnose_threads>>>(each.data(), tiling_.tiles(), all.data());
    launched("add_tiles", 1, diagnose_threads);
    wait();
    const Totals t = fetched(all)[0];
    const auto vector = [&](int first) {
      return Vec3d{t.sum[first], t.sum[first + 1], t.sum[first + 2]};
    };
    const auto phyxel = [&](Index place) { return place < 0 ? -1 : tiling_.phyxel[place]; };
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
    const DeviceArray<Real> forces = forces_now();
    wait();
    force = by_phyxel(from_columns(fetched(forces)));
  }

  std::unique_ptr<Vibration> vibration() override {
    settle();
    return std::make_unique<CudaVibration>(*this);
  }

  void displacement_gradients(std::vector<Mat3d>& gradient) override {
    const DeviceArray<Real> gradients = gradients_now();
    wait();
    const std::vector<Real> values = fetched(gradients);
    gradient.resize(static_cast<std::size_t>(size()));
    for (Index i = 0; i < size(); ++i) {
      for (int e = 0; e < 9; ++e) {
        gradient[i](e / 3, e % 3) =
            values[static_cast<std::size_t>(e) * places() + tiling_.place[i]];
      }
    }
  }

  void advect_surfels(SurfelState& out) override {
    const std::size_t count = model_.surfels.position.size();
    out.position.resize(count);
    out.normal.resize(count);
    if (count == 0) return;
    const DeviceArray<Real> gradients = gradients_now();
    if (surfel_moved_normal_.size() == 0) make_surfels();  // the array made last
    const DeviceSurfels<Real, StateReal> surfels{
        surfel_position_.data(),     surfel_normal_.data(),  surfel_offsets_.data(),
        surfel_carriers_.data(),     surfel_weight_.data(),  surfel_displacement_.data(),
        surfel_moved_normal_.data(), static_cast<int>(count)};
    const unsigned blocks = blocks_for(static_cast<int>(count));
    advect<<<blocks, tile_size>>>(fields_, gradients.data(), surfels);
    launched("advect", blocks, tile_size);
    wait();
    const std::vector<Vec3<StateReal>> moved = fetched(surfel_displacement_),
                                       normal = fetched(surfel_moved_normal_);
    for (std::size_t s = 0; s < count; ++s) {
      out.position[s] = model_.surfels.position[s] + to<double>(moved[s]);
      out.normal[s] = normalised(to<double>(normal[s]));
    }
  }

  std::vector<ArrayBytes> memory() const override {
    std::vector<ArrayBytes> list{
        {"points", Points<Real>::bytes * places()},
        {"stresses", Stresses<Real>::bytes * places()},
        {"constants", moment_constants_.bytes() + force_constants_.bytes() + tiles_.bytes() +
                          materials_.bytes()},
        {"velocities", velocity_.bytes()},
        {"neighbour lists", tiling_.neighbours.bytes()},
        {"places", tiling_.phyxel_at.bytes()}};
    if (tiling_.inverse) list.push_back({"inverse neighbour lists", tiling_.inverse->bytes()});
    if (own_supports_) list.push_back({"supports", supports_.bytes()});
    if (resident_) {
      list.push_back({"what stays in shared memory", resident_->held()});
    }
    if (mixed) list.push_back({"displacements", displacement_.bytes()});
    if (load_.size()) list.push_back({"loads", load_.bytes()});
    list.push_back({"while energies are summed", 12 * sizeof(Real) * places()});
    if (surfel_moved_normal_.size()) {
      list.push_back({"surfels", surfel_position_.bytes() + surfel_normal_.bytes() +
                                     surfel_offsets_.bytes() + surfel_carriers_.bytes() +
                                     surfel_weight_.bytes() + surfel_displacement_.bytes() +
                                     surfel_moved_normal_.bytes()});
    }
    return list;
  }

  std::size_t step_traffic() const override {
    const std::size_t lists = tiling_.neighbours.bytes() + tiling_.second().bytes();
    std::size_t each = 2 * Points<Real>::bytes + Points<Real>::bytes + 2 * Stresses<Real>::bytes;
    each += (7 + 4) * sizeof(Real) + 6 * sizeof(StateReal);
    if (mixed) each += 6 * sizeof(StateReal);
    if (load_.size()) each += 3 * sizeof(Real);
    return lists + each * places();
  }

 private:
  /// M^-1/2 K M^-1/2 at rest, by the linear law that every material has there: Cauchy's strain,
  /// with the volume's stiffness added to λ.
  class CudaVibration final : public Vibration {
   public:
    explicit CudaVibration(CudaBackend& backend)
        : b_(backend), amplitude_(b_.amplitude_at_rest()), tiles_(b_.rest_constants()) {
      const std::string what = "vectors of " + b_.subject_;
      const std::size_t count = 3 * b_.places();
      previous_ = {count, what};
      current_ = {count, what};
      next_ = {count, what};
      force_ = {count, what};
      PHYXEL_CUDA(cudaMemset(previous_.data(), 0, previous_.bytes()));
      launch("start_vector", start_vector<Real>, current_.data(), b_.places(),
             static_cast<const Index*>(b_.tiling_.phyxel_at.data()));
      scale(current_, 1 / std::sqrt(product(current_, current_)));
    }
    double apply(double beta) override {
      launch("bend", bend<Real, StateReal>, b_.fields_, current_.data(), amplitude_);
      AllFields at_rest = b_.fields_;
      at_rest.tiles = tiles_.data();
      b_.launch_pass_1(at_rest, {pass_1<Real, StateReal, false, false, false>, 0, b_.tiles()},
                       nullptr);
      b_.launch_pass_2(b_.only_forces(), StateReal(0), force_.data());
      launch("stiffness_times", stiffness_times<Real, StateReal>, b_.fields_, force_.data(),
             previous_.data(), static_cast<Real>(beta), amplitude_, next_.data());
      return product(next_, current_);
    }
    double subtract(double alpha) override {
      launch("subtract", subtract_multiple<Real>, next_.data(), current_.data(),
             static_cast<Real>(alpha));
      return std::sqrt(product(next_, next_));
    }
    void advance(double norm) override {
      std::swap(previous_, current_);
      std::swap(current_, next_);
      scale(current_, 1 / norm);
    }

   private:
    static double product(const DeviceArray<Real>& a, const DeviceArray<Real>& b) {
      const thrust::transform_iterator products(thrust::counting_iterator<std::int64_t>(0),
                                                Product<Real>{a.data(), b.data()});
      return reduce(products, static_cast<std::int64_t>(a.size()), 0.0, Plus{});
    }
    void scale(DeviceArray<Real>& a, double factor) {
      launch("scale", scale_vector<Real>, a.data(), static_cast<Real>(factor));
    }
    /// A thread a place.
    template <class... Parameters, class... Arguments>
    void launch(const char* name, void (*kernel)(Parameters...), Arguments... arguments) {
      const auto tiles = static_cast<unsigned>(b_.tiles());
      kernel<<<tiles, tile_size>>>(arguments...);
      b_.launched(name, tiles, tile_size);
    }
    CudaBackend& b_;
    Real amplitude_;  ///< Makes displacements of a vector's ones the size of a support.
    DeviceArray<BodyConstants> tiles_;
    DeviceArray<Real> previous_, current_, next_, force_;
  };

  /// Tiles side by side that one launch serves.
  template <class Kernel>
  struct Run {
    Kernel kernel;
    Index first_tile, tiles;
  };
  /// Phyxels on a path that moves, and not taken over by a later motion.
  struct Following {
    const Motion* of;
    DeviceArray<Index> places;
  };
  struct Loading {
    const Load* of;
    DeviceArray<Index> places;
    DeviceArray<Vec3<Real>> force;
  };

  std::size_t places() const { return static_cast<std::size_t>(tiling_.places()); }
  Index tiles() const { return tiling_.tiles(); }

  // --- set-up ---------------------------------------------------------------------------------

  bool one_support_each() const {
    for (const Part& part : model_.parts) {
      for (Index i = part.begin; i < part.end; ++i) {
        if (model_.neighbourhood.support[i] != model_.neighbourhood.support[part.begin]) {
          return false;
        }
      }
    }
    return true;
  }

  DeviceLists view_of(const DeviceTileLists& lists) const {
    check_shared_memory(lists);
    return {lists.halo.data(), lists.halo_stride, lists.slots(), lists.rows.data(),
            reinterpret_cast<const uint4*>(lists.entries.data())};
  }
  void make_lists() {
    lists_ = view_of(tiling_.neighbours);
    second_lists_ = view_of(tiling_.second());
  }
  /// @throws InputError if a tile does not fit what one block may have
  void check_shared_memory(const DeviceTileLists& lists) const {
    const int bytes = pass_2_bytes(lists.slots());
    if (bytes <= most_shared_memory_) return;
    throw InputError(device_.name + ": " + std::to_string(tile_size) +
                     " phyxels side by side and their " + std::to_string(lists.halo_stride) +
                     " neighbours take " + std::to_string(bytes) +
                     " bytes of shared memory, of which a block may have " +
                     std::to_string(most_shared_memory_) +
                     ": allowed are a smaller support, precision \"float\" or the CPU");
  }

  void make_fields() {
    const std::string of = " of " + subject_;
    if constexpr (sizeof(Real) == 4) {
      quads_ = {places(), "points" + of};
      pairs_ = {places(), "points" + of};
      fields_.points = {quads_.data(), pairs_.data()};
      stress_words_ = {3 * places(), "stresses" + of};
      fields_.stresses = {stress_words_.data(), stress_words_.data() + places(),
                          stress_words_.data() + 2 * places()};
    } else {
      point_words_ = {3 * places(), "points" + of};
      fields_.points = {point_words_.data(), point_words_.data() + places(),
                        point_words_.data() + 2 * places()};
      stress_words_ = {6 * places(), "stresses" + of};
      for (int k = 0; k < 6; ++k) fields_.stresses.word[k] = stress_words_.data() + k * places();
    }
    moment_constants_ = {7 * places(), "inverse moments" + of};
    force_constants_ = {4 * places(), "masses" + of};
    if (own_supports_) supports_ = {places(), "supports" + of};
    velocity_ = {3 * places(), "velocities" + of};
    if (mixed) displacement_ = {3 * places(), "displacements" + of};
    tiles_ = {tiling_.part.size(), "tiles" + of};
    std::vector<TileMaterial> materials;
    for (const Index part : tiling_.part) {
      const Material& m = model_.parts[part].material;
      materials.push_back({m.lame_lambda(), m.lame_mu(), m.volume_stiffness, m.damping,
                           origin_of(part), m.strain == Strain::green});
    }
    materials_ = {materials.size(), "tiles" + of};
    materials_.upload(materials.data());

    fields_.inverse_h_squared = supports_.data();
    fields_.moment_constants = moment_constants_.data();
    fields_.force_constants = force_constants_.data();
    fields_.velocity = velocity_.data();
    fields_.displacement = displacement_.data();
    fields_.tiles = tiles_.data();
    fields_.gravity = to<StateReal>(model_.gravity);
    fields_.places = places();
    send_constants(0);
    put_all_constants();
    PHYXEL_CUDA(cudaMemset(velocity_.data(), 0, velocity_.bytes()));
    if constexpr (mixed) PHYXEL_CUDA(cudaMemset(displacement_.data(), 0, displacement_.bytes()));
  }

  void put_all_constants() {
    const DeviceArray<Vec3d> position = sent(model_.position, "rest positions");
    const DeviceArray<double> volume = sent(model_.volume, "volumes"),
                              mass = sent(model_.mass, "masses"),
                              support = sent(model_.neighbourhood.support, "supports");
    std::vector<Vec3d> origins;
    for (const Index part : tiling_.part) origins.push_back(origin_of(part));
    const DeviceArray<Vec3d> origin = sent(origins, "tiles");
    std::vector<Index> held_places;
    DeviceArray<char> held_on_device;
    if (!model_.motions.empty()) {
      const std::vector<char> held = held_phyxels();
      for (Index i = 0; i < size(); ++i) {
        if (held[i]) held_places.push_back(tiling_.place[i]);
      }
      held_on_device = sent(held, "held phyxels");
    }
    held_places_ = sent(held_places, "held phyxels");
    const auto tiles = static_cast<unsigned>(tiling_.tiles());
    put_constants<<<tiles, tile_size>>>(
        fields_,
        {tiling_.phyxel_at.data(), position.data(), volume.data(), mass.data(), support.data(),
         held_on_device.data(), tiling_.inverse_moment.data(), tiling_.moment_offset.data(),
         origin.data()},
        moment_constants_.data(), force_constants_.data(), supports_.data());
    launched("put_constants", tiles, tile_size);
    wait();
    tiling_.inverse_moment = {};
    tiling_.moment_offset = {};
  }

  void send_constants(double dt) {
    dt_ = dt;
    std::vector<BodyConstants> tiles;
    for (const Index p : tiling_.part) tiles.push_back(constants_of(model_.parts[p], dt));
    tiles_.upload(tiles.data());
  }
  BodyConstants constants_of(const Part& part, double dt) const {
    const Material& m = part.material;
    const double half = m.damping * dt / 2;
    const double h = part.begin < part.end ? model_.neighbourhood.support[part.begin] : 0;
    return {static_cast<Real>(m.lame_lambda()),
            static_cast<Real>(m.lame_mu()),
            static_cast<Real>(m.volume_stiffness),
            static_cast<Real>(h > 0 ? 1 / (h * h) : 0),
            static_cast<StateReal>((1 - half) / (1 + half)),
            static_cast<StateReal>(dt / (1 + half)),
            m.strain == Strain::green,
            m.damping > 0};
  }
  /// Smallest support times the root of the smallest mass: with it, forces of a unit vector stay as
  /// far from the ends of float as those of a step.
  Real amplitude_at_rest() const {
    double support = 0, mass = 0;
    for (Index i = 0; i < size(); ++i) {
      const double h = model_.neighbourhood.support[i], m = model_.mass[i];
      if (h > 0 && (support == 0 || h < support)) support = h;
      if (m > 0 && (mass == 0 || m < mass)) mass = m;
    }
    return support > 0 && mass > 0 ? static_cast<Real>(support * std::sqrt(mass)) : Real(1);
  }
  /// For small displacements, whatever the law.
  DeviceArray<BodyConstants> rest_constants() const {
    std::vector<BodyConstants> constants;
    for (const Index p : tiling_.part) {
      const Part& part = model_.parts[p];
      constants.push_back(constants_of(part, 0));
      constants.back().lambda =
          static_cast<Real>(part.material.lame_lambda() + part.material.volume_stiffness);
    }
    return sent(constants, "tiles of " + subject_);
  }

  /// Positions are taken from the body's first phyxel, so that a body far from the origin keeps its
  /// digits in float.
  Vec3d origin_of(Index part) const { return model_.position[model_.parts[part].begin]; }

  /// The motion that has the last word on each phyxel.
  std::vector<const Motion*> last_motions() const {
    std::vector<const Motion*> last(static_cast<std::size_t>(size()), nullptr);
    for (const Motion& motion : model_.motions) {
      for (const Index i : motion.phyxels) last[i] = &motion;
    }
    return last;
  }
  std::vector<char> held_phyxels() const {
    std::vector<char> held(static_cast<std::size_t>(size()), 0);
    const auto last = last_motions();
    for (Index i = 0; i < size(); ++i) held[i] = last[i] && last[i]->stands_still();
    return held;
  }
  void make_motions() {
    const auto last = last_motions();
    std::vector<char> moved;
    for (const Motion& motion : model_.motions) {
      if (motion.stands_still()) continue;
      std::vector<Index> at;
      for (const Index i : motion.phyxels) {
        if (last[i] == &motion) at.push_back(tiling_.place[i]);
      }
      if (at.empty()) continue;
      motions_.push_back({&motion, {at.size(), "moved phyxels"}});
      motions_.back().places.upload(at.data());
      moved.resize(places(), 0);
      for (const Index place : at) moved[place] = 1;
    }
    if (moved.empty()) return;
    moved_ = {moved.size(), "moved phyxels"};
    moved_.upload(moved.data());
  }

  void make_loads() {
    if (model_.loads.empty()) return;
    load_ = {3 * places(), "loads of " + subject_};
    fields_.load = load_.data();
    for (const Load& load : model_.loads) {
      std::vector<Index> at;
      std::vector<Vec3<Real>> force;
      for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
        at.push_back(tiling_.place[load.phyxels[k]]);
        force.push_back(to<Real>(load.force[k]));
      }
      loads_.push_back({&load, {at.size(), "loaded phyxels"}, {at.size(), "loads"}});
      loads_.back().places.upload(at.data());
      loads_.back().force.upload(force.data());
    }
  }
  /// Again only while one of them still grows.
  void sum_loads(double time) {
    if (loads_.empty()) return;
    double scales = 0;
    for (const Loading& load : loads_) scales += load.of->scale_at(time);
    if (scales == load_scales_) return;
    load_scales_ = scales;
    PHYXEL_CUDA(cudaMemsetAsync(load_.data(), 0, load_.bytes()));
    for (const Loading& load : loads_) {
      const auto count = static_cast<int>(load.places.size());
      add_load<<<blocks_for(count), tile_size>>>(load_.data(), places(), load.places.data(),
                                                 load.force.data(), count,
                                                 static_cast<Real>(load.of->scale_at(time)));
      launched("add_load", blocks_for(count), tile_size);
    }
  }

  void make_surfels() {
    const Surfels& surfels = model_.surfels;
    const std::size_t count = surfels.position.size();
    std::vector<Vec3<Real>> position, normal;
    std::vector<Index> carriers;
    std::vector<Real> weights;
    Index part = 0;
    for (std::size_t s = 0; s < count; ++s) {
      while (static_cast<Index>(s) >= model_.parts[part].surfel_end) ++part;
      position.push_back(to<Real>(surfels.position[s] - origin_of(part)));
      normal.push_back(to<Real>(surfels.normal[s]));
      for (const Index i : surfels.carriers.row(static_cast<Index>(s))) {
        carriers.push_back(tiling_.place[i]);
      }
      for (const double w : carrier_weights(model_, static_cast<Index>(s))) {
        weights.push_back(static_cast<Real>(w));
      }
    }
    const std::string of = " of " + std::to_string(count) + " surfels";
    const auto send = [&](auto& array, const auto& values, const char* what) {
      array = {values.size(), what + of};
      array.upload(values.data());
    };
    send(surfel_position_, position, "positions");
    send(surfel_normal_, normal, "normals");
    send(surfel_offsets_, surfels.carriers.offsets, "carriers");
    send(surfel_carriers_, carriers, "carriers");
    send(surfel_weight_, weights, "weights");
    surfel_displacement_ = {count, "displacements" + of};
    surfel_moved_normal_ = {count, "normals" + of};
  }

  // --- launches ---------------------------------------------------------------------------------

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
    const bool loaded = !model_.loads.empty();
    if (m.damping > 0) {
      return loaded ? pass_2<Real, StateReal, own_supports, true, true, false>
                    : pass_2<Real, StateReal, own_supports, true, false, false>;
    }
    return loaded ? pass_2<Real, StateReal, own_supports, false, true, false>
                  : pass_2<Real, StateReal, own_supports, false, false, false>;
  }

  void make_runs() {
    const auto add = [](auto& runs, auto kernel, Index tile) {
      if (!runs.empty() && runs.back().kernel == kernel) {
        ++runs.back().tiles;
      } else {
        runs.push_back({kernel, tile, 1});
      }
    };
    for (Index tile = 0; tile < tiling_.tiles(); ++tile) {
      const Material& m = model_.parts[tiling_.part[tile]].material;
      add(stress_runs_, pass_1_of(m), tile);
      add(advance_runs_, own_supports_ ? pass_2_of<true>(m) : pass_2_of<false>(m), tile);
    }
  }

  /// Shared memory of a block of pass 2, which takes more than pass 1.
  int pass_2_bytes(int slots) const {
    return (Stresses<Real>::bytes + (own_supports_ ? static_cast<int>(sizeof(Real)) : 0)) * slots;
  }

  void launch_pass_1(const AllFields& fields, const Run<Pass1>& run, Real* gradient) {
    const int bytes = Points<Real>::bytes * lists_.slots;
    allow_shared_memory(reinterpret_cast<const void*>(run.kernel));
    run.kernel<<<run.tiles, tile_size, bytes>>>(fields, lists_, run.first_tile, gradient);
    launched("pass_1", run.tiles, tile_size);
  }
  void launch_pass_2(const Run<Pass2>& run, StateReal dt, Real* force) {
    const int bytes = pass_2_bytes(second_lists_.slots);
    allow_shared_memory(reinterpret_cast<const void*>(run.kernel));
    run.kernel<<<run.tiles, tile_size, bytes>>>(fields_, second_lists_, run.first_tile, dt, force);
    launched("pass_2", run.tiles, tile_size);
  }
  /// Beyond 48 KiB a kernel has to ask. It asks for all there is: the answer is the kernel's, not
  /// this object's, and other models may need more.
  void allow_shared_memory(const void* kernel) {
    if (std::find(allowed_.begin(), allowed_.end(), kernel) != allowed_.end()) return;
    PHYXEL_CUDA(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                     most_shared_memory_));
    allowed_.push_back(kernel);
  }
  void stress_now() {
    use_device();
    for (const Run<Pass1>& run : stress_runs_) launch_pass_1(fields_, run, nullptr);
  }

  // --- steps in residence -----------------------------------------------------------------------

  struct Resident {
    const void* kernel;
    int slices, cluster;  // cluster: blocks of one; 0: by mail
    unsigned blocks, threads;
    int bytes;
    DeviceArray<Slice> all_slices;
    DeviceArray<int> slice_of_block;
    DeviceArray<Index> place;
    DeviceArray<std::uint16_t> entries;
    DeviceArray<std::uint32_t> destinations;
    DeviceArray<Letter> displacements, stresses;
    ResidentView<Real> view;

    std::string describe() const {
      return cluster ? "resident, clusters of " + std::to_string(cluster)
                     : "resident, " + std::to_string(slices) + " blocks";
    }
    std::size_t held() const {
      return all_slices.bytes() + slice_of_block.bytes() + place.bytes() + entries.bytes() +
             destinations.bytes() + displacements.bytes() + stresses.bytes();
    }
  };
  /// Steps that may wait to be launched together.
  static constexpr int most_pending = 256;
  static constexpr int most_cluster_blocks = 16;  // on GPUs that have clusters

  /// Where nothing changes from step to step but the state, and a body fits a cluster, or all fit
  /// at once.
  void make_resident() {
    constexpr Index most_places = 1 << 18;  // far more than fit any GPU of today
    const bool ramped = std::any_of(model_.loads.begin(), model_.loads.end(),
                                    [](const Load& load) { return load.ramp > 0; });
    if (size() == 0 || tiling_.places() > most_places || ramped || !motions_.empty()) return;
    if (!may_fit()) return;
    Tiling tiling;
    tiling.phyxel = tiling_.phyxel;
    tiling.part = tiling_.part;
    const auto lists = [](const DeviceTileLists& on_device) {
      return TileLists{fetched(on_device.halo), on_device.halo_stride, fetched(on_device.rows),
                       fetched(on_device.entries)};
    };
    tiling.neighbours = lists(tiling_.neighbours);
    if (tiling_.inverse) tiling.inverse = lists(*tiling_.inverse);
    const ResidentPlan plan = make_resident_plan(tiling);

    Resident r{};
    if (!fits_clusters(plan, r) && !fits_at_once(plan, r)) return;
    const std::string what = "what stays in shared memory of " + subject_;
    r.slices = static_cast<int>(plan.slices.size());
    r.all_slices = sent(plan.slices, what);
    r.place = sent(plan.place, what);
    r.entries = sent(plan.entries, what);
    r.destinations = sent(plan.destinations, what);
    std::vector<int> slice_of_block(r.blocks, -1);
    for (int s = 0; s < r.slices; ++s) {
      slice_of_block[r.cluster ? plan.slices[s].body * r.cluster + plan.slices[s].rank : s] = s;
    }
    r.slice_of_block = sent(slice_of_block, what);
    if (!r.cluster) {
      r.displacements = {displacement_letters<Real> * places(), what};
      r.stresses = {stress_letters<Real> * places(), what};
    }
    r.view = {r.all_slices.data(),     r.place.data(),
              r.entries.data(),        r.destinations.data(),
              r.slice_of_block.data(), r.displacements.data(),
              r.stresses.data(),       plan.most_slots,
              plan.most_destinations,  {plan.longest[0], second_longest(plan)}};
    resident_ = std::move(r);
    clear_mail();
  }
  /// Before a plan is made, which takes its time.
  bool may_fit() const {
    const bool in_clusters = std::all_of(
        model_.parts.begin(), model_.parts.end(),
        [](const Part& part) { return part.end - part.begin <= most_cluster_blocks * slice_size; });
    const std::size_t shared = static_cast<std::size_t>(device_.multiprocessors) *
                               static_cast<std::size_t>(most_shared_memory_);
    return in_clusters || static_cast<std::size_t>(model_.pairs()) * sizeof(Pair<Real>) <= shared;
  }
  int second_longest(const ResidentPlan& plan) const {
    return tiling_.inverse ? plan.longest[1] : 0;
  }
  template <class Post>
  void use_post(const ResidentPlan& plan, Resident& r) {
    r.kernel = reinterpret_cast<const void*>(resident_steps<Real, StateReal, Post>);
    r.threads = Post::threads;
    r.bytes = ResidentMemory<Real>::bytes(plan.most_slots, plan.longest[0], second_longest(plan),
                                          Post::bytes(plan.most_slots, plan.most_destinations));
  }
  /// One cluster a body, as many blocks each as the largest has slices.
  bool fits_clusters(const ResidentPlan& plan, Resident& r) {
    if (device_.major < 9) return false;
    use_post<ClusterPost<Real>>(plan, r);
    const auto blocks = static_cast<std::size_t>(plan.bodies) * plan.most_slices;
    // Bodies of very different sizes would leave most blocks idle.
    if (plan.most_slices > most_cluster_blocks || blocks > 2 * plan.slices.size() ||
        r.bytes > most_shared_memory_) {
      return false;
    }
    r.cluster = plan.most_slices;
    r.blocks = static_cast<unsigned>(blocks);
    allow_shared_memory(r.kernel);
    PHYXEL_CUDA(cudaFuncSetAttribute(r.kernel, cudaFuncAttributeNonPortableClusterSizeAllowed, 1));
    cudaLaunchAttribute attribute;
    const cudaLaunchConfig_t config = launch_of(r, attribute);
    int clusters = 0;
    const cudaError_t error = cudaOccupancyMaxActiveClusters(&clusters, r.kernel, &config);
    if (error != cudaSuccess) cudaGetLastError();  // an answer: too large for this GPU
    return error == cudaSuccess && clusters > 0;
  }
  bool fits_at_once(const ResidentPlan& plan, Resident& r) {
    use_post<MailPost<Real>>(plan, r);
    r.cluster = 0;
    r.blocks = static_cast<unsigned>(plan.slices.size());
    if (r.bytes > most_shared_memory_) return false;
    allow_shared_memory(r.kernel);
    int blocks_each = 0;
    PHYXEL_CUDA(cudaOccupancyMaxActiveBlocksPerMultiprocessor(
        &blocks_each, r.kernel, static_cast<int>(r.threads), r.bytes));
    return r.blocks <= static_cast<unsigned>(blocks_each * device_.multiprocessors);
  }
  static cudaLaunchConfig_t launch_of(const Resident& r, cudaLaunchAttribute& attribute) {
    if (r.cluster) {
      attribute.id = cudaLaunchAttributeClusterDimension;
      attribute.val.clusterDim = {static_cast<unsigned>(r.cluster), 1, 1};
    } else {
      attribute.id = cudaLaunchAttributeCooperative;
      attribute.val.cooperative = 1;
    }
    cudaLaunchConfig_t config{};
    config.gridDim = r.blocks;
    config.blockDim = r.threads;
    config.dynamicSmemBytes = static_cast<std::size_t>(r.bytes);
    config.attrs = &attribute;
    config.numAttrs = 1;
    return config;
  }
  void clear_mail() const {
    next_tag_ = 1;
    if (resident_->cluster) return;
    PHYXEL_CUDA(
        cudaMemsetAsync(resident_->displacements.data(), 0, resident_->displacements.bytes()));
    PHYXEL_CUDA(cudaMemsetAsync(resident_->stresses.data(), 0, resident_->stresses.bytes()));
  }
  /// The first step after an upload goes by launches, which see held phyxels where they were put.
  bool stays_resident() const { return resident_ && !fresh_; }

  /// Makes this the current device and launches the steps that wait for it.
  void settle() const {
    use_device();
    if (pending_ == 0) return;
    if (next_tag_ > 0xF000'0000U) clear_mail();
    auto dt = static_cast<StateReal>(dt_);
    int steps = std::exchange(pending_, 0);  // once, whatever happens
    AllFields fields = fields_;
    ResidentView<Real> view = resident_->view;
    unsigned tag = std::exchange(next_tag_, next_tag_ + 2 * static_cast<unsigned>(steps));
    void* arguments[] = {&fields, &view, &dt, &steps, &tag};
    cudaLaunchAttribute attribute;
    const cudaLaunchConfig_t config = launch_of(*resident_, attribute);
    PHYXEL_CUDA(cudaLaunchKernelExC(&config, resident_->kernel, arguments));
    launched("resident_steps", resident_->blocks, resident_->threads);
  }

  void use_device() const { PHYXEL_CUDA(cudaSetDevice(device_.index)); }

  /// Lets the host run ahead by some ten milliseconds of steps, not by the hundreds that the queue
  /// takes: a signal would wait for them all.
  void bound_queue(int steps) {
    const int most = resident_ ? 2 * most_pending : 128;
    const auto ahead = static_cast<int>(
        std::clamp<std::size_t>(50'000'000 / places(), 1, static_cast<std::size_t>(most)));
    if ((steps_since_mark_ += steps) < ahead) return;
    steps_since_mark_ = 0;
    const Event& mark = marks_[batches_++ % 2];
    PHYXEL_CUDA(cudaEventSynchronize(mark.get()));  // of the last batch but one; at once if none
    PHYXEL_CUDA(cudaEventRecord(mark.get()));
  }

  void set_phyxels(const DeviceArray<Index>& at, Vec3d displacement, Vec3d velocity) {
    const auto count = static_cast<int>(at.size());
    follow<<<blocks_for(count), tile_size>>>(fields_, at.data(), count, to<StateReal>(displacement),
                                             to<StateReal>(velocity));
    launched("follow", blocks_for(count), tile_size);
  }

  Run<Pass2> only_forces() const {
    return {own_supports_ ? pass_2<Real, StateReal, true, false, false, true>
                          : pass_2<Real, StateReal, false, false, false, true>,
            0, tiles()};
  }
  DeviceArray<Real> forces_now() {
    settle();
    stress_now();
    DeviceArray<Real> forces(3 * places(), "forces of " + subject_);
    launch_pass_2(only_forces(), StateReal(0), forces.data());
    return forces;
  }
  DeviceArray<Real> gradients_now() {
    settle();
    DeviceArray<Real> gradients(9 * places(), "displacement gradients of " + subject_);
    launch_pass_1(fields_, {pass_1<Real, StateReal, true, false, true>, 0, tiles()},
                  gradients.data());
    return gradients;
  }

  static unsigned blocks_for(int count) {
    return static_cast<unsigned>((count + tile_size - 1) / tile_size);
  }
  void launched(const char* kernel, unsigned blocks, unsigned threads) const {
    last_launch_.kernel = kernel;
    last_launch_.blocks = blocks;
    last_launch_.threads = threads;
    if (last_launch_.subject.empty()) last_launch_.subject = subject_;
    check_launch(last_launch_);
  }

  // --- values -----------------------------------------------------------------------------------

  template <class T>
  std::vector<Vec3d> from_columns(const std::vector<T>& values) const {
    std::vector<Vec3d> out(places());
    for (std::size_t k = 0; k < places(); ++k) {
      out[k] = {values[k], values[places() + k], values[2 * places() + k]};
    }
    return out;
  }
  std::vector<Vec3d> by_phyxel(const std::vector<Vec3d>& by_place) const {
    std::vector<Vec3d> out(static_cast<std::size_t>(size()));
    for (Index i = 0; i < size(); ++i) out[i] = by_place[tiling_.place[i]];
    return out;
  }

  using Word = std::conditional_t<sizeof(Real) == 4, float4, double2>;

  const Model& model_;
  Device device_;
  DeviceTiling tiling_;
  int most_shared_memory_ = 0;  // of one block, in bytes
  bool own_supports_ = false;
  std::string subject_;
  double dt_ = -1, load_scales_ = -1;
  bool fresh_ = true;  // no step has been taken since the last upload
  Event marks_[2];
  int steps_since_mark_ = 0;
  unsigned batches_ = 0;
  std::vector<Run<Pass1>> stress_runs_;
  std::vector<Run<Pass2>> advance_runs_;
  std::vector<const void*> allowed_;
  mutable Launch last_launch_;
  std::optional<Resident> resident_;
  mutable int pending_ = 0;        // steps that wait to be launched
  mutable unsigned next_tag_ = 1;  // of the mail

  AllFields fields_{};
  DeviceLists lists_{}, second_lists_{};
  std::vector<Following> motions_;
  std::vector<Loading> loads_;

  DeviceArray<float4> quads_;  // points, where Real is float
  DeviceArray<float2> pairs_;
  DeviceArray<double2> point_words_;  // points, where it is double
  DeviceArray<Word> stress_words_;
  DeviceArray<Real> moment_constants_, force_constants_, supports_, load_;
  DeviceArray<StateReal> velocity_, displacement_;
  DeviceArray<BodyConstants> tiles_;
  DeviceArray<TileMaterial> materials_;
  DeviceArray<Index> held_places_;
  DeviceArray<char> moved_;  // empty unless phyxels follow a path
  DeviceArray<Vec3<Real>> surfel_position_, surfel_normal_;
  DeviceArray<Vec3<StateReal>> surfel_displacement_, surfel_moved_normal_;
  DeviceArray<Offset> surfel_offsets_;
  DeviceArray<Index> surfel_carriers_;
  DeviceArray<Real> surfel_weight_;
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
