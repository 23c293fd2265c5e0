#include <algorithm>
#include <optional>
#include <string>
#include <type_traits>

#include "check.hpp"
#include "device.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/surfel.hpp"
#include "solver/carrier_weights.hpp"
#include "solver/cuda_backend.hpp"
#include "solver/diagnose.cuh"
#include "solver/kernels.cuh"
#include "solver/tiling.hpp"

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
  point.u = {static_cast<Real>(displacement.x), static_cast<Real>(displacement.y),
             static_cast<Real>(displacement.z)};
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
  const auto wide = [](Vec3<Real> v) {
    return Vec3<StateReal>{static_cast<StateReal>(v.x), static_cast<StateReal>(v.y),
                           static_cast<StateReal>(v.z)};
  };
  SurfelBlend<StateReal> blend;
  for (Offset k = surfels.offsets[s]; k < surfels.offsets[s + 1]; ++k) {
    const Index place = surfels.carriers[k];
    const auto point = f.points.get(place);
    Vec3<StateReal> u = wide(point.u);
    if constexpr (!std::is_same_v<Real, StateReal>) u = column3(f.displacement, f.places, place);
    Mat3<StateReal> grad_u;
    for (int e = 0; e < 9; ++e) grad_u(e / 3, e % 3) = gradient[e * f.places + place];
    blend.add(surfels.weight[k], u, grad_u, wide(surfels.position[s] - point.x));
  }
  const Vec3<StateReal> normal = blend.surfel_normal(wide(surfels.normal[s]));
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
  using Constants = TileConstants<Real, StateReal>;
  using AllFields = Fields<Real, StateReal>;
  using Pass1 = void (*)(AllFields, DeviceLists, Index, Real*);
  using Pass2 = void (*)(AllFields, DeviceLists, Index, StateReal, Real*);

 public:
  CudaBackend(const Model& model, int device)
      : model_(model), device_(use_cuda_device(device)), tiling_(make_tiling(model)) {
    PHYXEL_CUDA(cudaDeviceGetAttribute(&most_shared_memory_,
                                       cudaDevAttrMaxSharedMemoryPerBlockOptin, device_.index));
    own_supports_ = !one_support_each();
    subject_ = std::to_string(model.size()) + " phyxels";
    make_lists();
    make_fields();
    make_motions();
    make_loads();
    make_runs();
  }

  std::string name() const override {
    const char* precision = mixed ? "mixed" : sizeof(Real) == 4 ? "float" : "double";
    return device_.name + ", " + precision + ", tiles of " + std::to_string(tile_size);
  }
  Index size() const override { return model_.size(); }
  int threads() const override { return 0; }

  void upload(const State& state) override {
    wait();
    dt_ = -1;  // whatever depends on it is sent with the next step
    fresh_ = true;
    std::vector<Vec3d> u(places()), v(places());
    for (Index i = 0; i < size(); ++i) {
      u[tiling_.place[i]] = state.displacement[i];
      v[tiling_.place[i]] = state.velocity[i];
    }
    velocity_.upload(columns<StateReal>(v).data());
    if constexpr (mixed) displacement_.upload(columns<StateReal>(u).data());
    upload_points(u);
  }

  void download(State& state) const override {
    wait();
    const std::vector<Vec3d> v = from_columns(copy_of(velocity_));
    std::vector<Vec3d> u;
    if constexpr (mixed) {
      u = from_columns(copy_of(displacement_));
    } else {
      u = points_displacement();
    }
    state.displacement = by_phyxel(u);
    state.velocity = by_phyxel(v);
  }

  void stress() override {
    use_device();
    for (const Run<Pass1>& run : stress_runs_) launch_pass_1(run, nullptr);
  }

  void advance(double time, double dt) override {
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
    bound_queue();
  }

  void wait() const override {
    use_device();
    wait_for_device(last_launch_);
  }

  std::optional<Diagnostics> diagnostics(double time, double dt) override {
    use_device();
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
    const Totals t = copy_of(all)[0];
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
    force = by_phyxel(from_columns(copy_of(forces)));
  }

  void displacement_gradients(std::vector<Mat3d>& gradient) override {
    use_device();
    const DeviceArray<Real> gradients = gradients_now();
    wait();
    const std::vector<Real> values = copy_of(gradients);
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
    use_device();
    if (surfel_moved_normal_.size() == 0) make_surfels();  // the array made last
    const DeviceArray<Real> gradients = gradients_now();
    const DeviceSurfels<Real, StateReal> surfels{
        surfel_position_.data(),     surfel_normal_.data(),  surfel_offsets_.data(),
        surfel_carriers_.data(),     surfel_weight_.data(),  surfel_displacement_.data(),
        surfel_moved_normal_.data(), static_cast<int>(count)};
    const unsigned blocks = blocks_for(static_cast<int>(count));
    advect<<<blocks, tile_size>>>(fields_, gradients.data(), surfels);
    launched("advect", blocks, tile_size);
    wait();
    const std::vector<Vec3<StateReal>> moved = copy_of(surfel_displacement_),
                                       normal = copy_of(surfel_moved_normal_);
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
        {"neighbour lists", list_bytes(lists_)}};
    if (inverse_lists_) list.push_back({"inverse neighbour lists", list_bytes(*inverse_lists_)});
    if (own_supports_) list.push_back({"supports", supports_.bytes()});
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
    const std::size_t lists = list_bytes(lists_) + list_bytes(inverse_lists_.value_or(lists_));
    std::size_t each = 2 * Points<Real>::bytes + Points<Real>::bytes + 2 * Stresses<Real>::bytes;
    each += (7 + 4) * sizeof(Real) + 6 * sizeof(StateReal);
    if (mixed) each += 6 * sizeof(StateReal);
    if (load_.size()) each += 3 * sizeof(Real);
    return lists + each * places();
  }

 private:
  /// Tiles side by side that one launch serves.
  template <class Kernel>
  struct Run {
    Kernel kernel;
    Index first_tile, tiles;
  };
  struct ListArrays {
    DeviceArray<Index> halo;
    DeviceArray<TileLists::Row> rows;
    DeviceArray<std::uint16_t> entries;
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

  DeviceLists send_lists(const TileLists& lists, ListArrays& arrays) {
    const std::string what = "neighbour lists of " + subject_;
    arrays.halo = {lists.halo.size(), what};
    arrays.halo.upload(lists.halo.data());
    arrays.rows = {lists.rows.size(), what};
    arrays.rows.upload(lists.rows.data());
    arrays.entries = {lists.entries.size(), what};
    arrays.entries.upload(lists.entries.data());
    check_shared_memory(lists);
    return {arrays.halo.data(), lists.halo_stride, lists.slots(), arrays.rows.data(),
            reinterpret_cast<const uint4*>(arrays.entries.data())};
  }
  void make_lists() {
    lists_ = send_lists(tiling_.neighbours, list_arrays_);
    if (!tiling_.inverse.rows.empty()) {
      inverse_lists_ = send_lists(tiling_.inverse, inverse_arrays_);
    }
    tiling_.neighbours = tiling_.inverse = {};  // the device has them now
  }
  /// @throws InputError if a tile does not fit what one block may have
  void check_shared_memory(const TileLists& lists) const {
    const int bytes = pass_2_bytes(lists.slots());
    if (bytes <= most_shared_memory_) return;
    throw InputError(device_.name + ": " + std::to_string(tile_size) +
                     " phyxels side by side and their " + std::to_string(lists.halo_stride) +
                     " neighbours take " + std::to_string(bytes) +
                     " bytes of shared memory, of which a block may have " +
                     std::to_string(most_shared_memory_) +
                     ": allowed are a smaller support, precision \"float\" or the CPU");
  }
  std::size_t list_bytes(const DeviceLists& lists) const {
    const ListArrays& a = lists.rows == lists_.rows ? list_arrays_ : inverse_arrays_;
    return a.halo.bytes() + a.rows.bytes() + a.entries.bytes();
  }

  /// Zero at places without a phyxel.
  template <class Value>
  std::vector<Real> per_place(int rows, Value&& value) const {
    std::vector<Real> out(static_cast<std::size_t>(rows) * places(), Real(0));
    for (Index i = 0; i < size(); ++i) {
      for (int r = 0; r < rows; ++r) {
        out[static_cast<std::size_t>(r) * places() + tiling_.place[i]] =
            static_cast<Real>(value(i, r));
      }
    }
    return out;
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
    const auto moments = per_place(7, [&](Index i, int r) {
      const Sym3d& a = model_.inverse_moment[i];
      const double values[] = {a.xx, a.xy, a.xz, a.yy, a.yz, a.zz, model_.volume[i]};
      return values[r];
    });
    moment_constants_ = {moments.size(), "inverse moments" + of};
    moment_constants_.upload(moments.data());

    const std::vector<char> held = held_phyxels();
    std::vector<Index> held_places;
    for (Index i = 0; i < size(); ++i) {
      if (held[i]) held_places.push_back(tiling_.place[i]);
    }
    held_places_ = {held_places.size(), "held phyxels"};
    held_places_.upload(held_places.data());
    const auto forces = per_place(4, [&](Index i, int r) {
      const Vec3d& b = model_.moment_offset[i];
      const double values[] = {b.x, b.y, b.z, (held[i] ? -1 : 1) / model_.mass[i]};
      return values[r];
    });
    force_constants_ = {forces.size(), "masses" + of};
    force_constants_.upload(forces.data());

    if (own_supports_) {
      const auto supports = per_place(1, [&](Index i, int) {
        const double h = model_.neighbourhood.support[i];
        return h > 0 ? 1 / (h * h) : 0;
      });
      supports_ = {supports.size(), "supports" + of};
      supports_.upload(supports.data());
    }
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
    const std::vector<Vec3d> rest(places());
    velocity_.upload(columns<StateReal>(rest).data());
    if constexpr (mixed) displacement_.upload(columns<StateReal>(rest).data());
    upload_points(rest);
  }

  void send_constants(double dt) {
    dt_ = dt;
    std::vector<Constants> tiles;
    for (const Index p : tiling_.part) {
      const Part& part = model_.parts[p];
      const Material& m = part.material;
      const double half = m.damping * dt / 2;
      const double h = part.begin < part.end ? model_.neighbourhood.support[part.begin] : 0;
      tiles.push_back({static_cast<Real>(m.lame_lambda()), static_cast<Real>(m.lame_mu()),
                       static_cast<Real>(m.volume_stiffness),
                       static_cast<Real>(h > 0 ? 1 / (h * h) : 0),
                       static_cast<StateReal>((1 - half) / (1 + half)),
                       static_cast<StateReal>(dt / (1 + half))});
    }
    tiles_.upload(tiles.data());
  }

  /// Positions are taken from the body's first phyxel, so that a body far from the origin keeps its
  /// digits in float.
  Vec3d origin_of(Index part) const { return model_.position[model_.parts[part].begin]; }

  void upload_points(const std::vector<Vec3d>& u) {
    std::vector<Vec3<Real>> x(places());
    for (Index place = 0; place < tiling_.places(); ++place) {
      const Index i = tiling_.phyxel[place];
      if (i >= 0)
        x[place] = to<Real>(model_.position[i] - origin_of(tiling_.part[place / tile_size]));
    }
    if constexpr (sizeof(Real) == 4) {
      std::vector<float4> quads(places());
      std::vector<float2> pairs(places());
      for (std::size_t k = 0; k < places(); ++k) {
        const Vec3<Real> d = to<Real>(u[k]);
        quads[k] = {x[k].x, x[k].y, x[k].z, d.x};
        pairs[k] = {d.y, d.z};
      }
      quads_.upload(quads.data());
      pairs_.upload(pairs.data());
    } else {
      std::vector<double2> words(3 * places());
      for (std::size_t k = 0; k < places(); ++k) {
        words[k] = {x[k].x, x[k].y};
        words[places() + k] = {x[k].z, u[k].x};
        words[2 * places() + k] = {u[k].y, u[k].z};
      }
      point_words_.upload(words.data());
    }
  }

  std::vector<Vec3d> points_displacement() const {
    std::vector<Vec3d> u(places());
    if constexpr (sizeof(Real) == 4) {
      const std::vector<float4> quads = copy_of(quads_);
      const std::vector<float2> pairs = copy_of(pairs_);
      for (std::size_t k = 0; k < places(); ++k) u[k] = {quads[k].w, pairs[k].x, pairs[k].y};
    } else {
      const std::vector<double2> words = copy_of(point_words_);
      for (std::size_t k = 0; k < places(); ++k) {
        u[k] = {words[places() + k].y, words[2 * places() + k].x, words[2 * places() + k].y};
      }
    }
    return u;
  }

  /// The motion that has the last word on each phyxel.
  std::vector<const Motion*> last_motions() const {
    std::vector<const Motion*> last(static_cast<std::size_t>(size()), nullptr);
    for (const Motion& motion : model_.motions) {
      for (const Index i : motion.phyxels) last[i] = &motion;
    }
    return last;
  }
  static bool stands_still(const Motion& m) {
    return m.displacement == Vec3d{} && m.velocity == Vec3d{} && m.amplitude == Vec3d{};
  }
  std::vector<char> held_phyxels() const {
    std::vector<char> held(static_cast<std::size_t>(size()), 0);
    const auto last = last_motions();
    for (Index i = 0; i < size(); ++i) held[i] = last[i] && stands_still(*last[i]);
    return held;
  }
  void make_motions() {
    const auto last = last_motions();
    std::vector<char> moved;
    for (const Motion& motion : model_.motions) {
      if (stands_still(motion)) continue;
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
  const DeviceLists& second_lists() const { return inverse_lists_ ? *inverse_lists_ : lists_; }

  void launch_pass_1(const Run<Pass1>& run, Real* gradient) {
    const int bytes = Points<Real>::bytes * lists_.slots;
    allow_shared_memory(reinterpret_cast<const void*>(run.kernel));
    run.kernel<<<run.tiles, tile_size, bytes>>>(fields_, lists_, run.first_tile, gradient);
    launched("pass_1", run.tiles, tile_size);
  }
  void launch_pass_2(const Run<Pass2>& run, StateReal dt, Real* force) {
    const int bytes = pass_2_bytes(second_lists().slots);
    allow_shared_memory(reinterpret_cast<const void*>(run.kernel));
    run.kernel<<<run.tiles, tile_size, bytes>>>(fields_, second_lists(), run.first_tile, dt, force);
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
  void use_device() const { PHYXEL_CUDA(cudaSetDevice(device_.index)); }

  /// Lets the host run ahead by some ten milliseconds of steps, not by the hundreds that the queue
  /// takes: a signal would wait for them all.
  void bound_queue() {
    const auto ahead = static_cast<int>(std::clamp<std::size_t>(50'000'000 / places(), 1, 128));
    if (++steps_since_mark_ < ahead) return;
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

  DeviceArray<Real> forces_now() {
    stress();
    DeviceArray<Real> forces(3 * places(), "forces of " + subject_);
    launch_pass_2({own_supports_ ? pass_2<Real, StateReal, true, false, false, true>
                                 : pass_2<Real, StateReal, false, false, false, true>,
                   0, tiling_.tiles()},
                  StateReal(0), forces.data());
    return forces;
  }
  DeviceArray<Real> gradients_now() {
    DeviceArray<Real> gradients(9 * places(), "displacement gradients of " + subject_);
    launch_pass_1({pass_1<Real, StateReal, true, false, true>, 0, tiling_.tiles()},
                  gradients.data());
    return gradients;
  }

  static unsigned blocks_for(int count) {
    return static_cast<unsigned>((count + tile_size - 1) / tile_size);
  }
  void launched(const char* kernel, unsigned blocks, unsigned threads) {
    last_launch_.kernel = kernel;
    last_launch_.blocks = blocks;
    last_launch_.threads = threads;
    if (last_launch_.subject.empty()) last_launch_.subject = subject_;
    check_launch(last_launch_);
  }

  // --- values -----------------------------------------------------------------------------------

  template <class To, class From>
  static Vec3<To> to(Vec3<From> v) {
    return {static_cast<To>(v.x), static_cast<To>(v.y), static_cast<To>(v.z)};
  }
  template <class T>
  static std::vector<T> copy_of(const DeviceArray<T>& array) {
    std::vector<T> values(array.size());
    array.download(values.data());
    return values;
  }
  template <class T>
  std::vector<T> columns(const std::vector<Vec3d>& values) const {
    std::vector<T> out(3 * places());
    for (std::size_t k = 0; k < places(); ++k) {
      out[k] = static_cast<T>(values[k].x);
      out[places() + k] = static_cast<T>(values[k].y);
      out[2 * places() + k] = static_cast<T>(values[k].z);
    }
    return out;
  }
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
  Tiling tiling_;
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
  Launch last_launch_;

  AllFields fields_{};
  DeviceLists lists_{};
  std::optional<DeviceLists> inverse_lists_;
  ListArrays list_arrays_, inverse_arrays_;
  std::vector<Following> motions_;
  std::vector<Loading> loads_;

  DeviceArray<float4> quads_;  // points, where Real is float
  DeviceArray<float2> pairs_;
  DeviceArray<double2> point_words_;  // points, where it is double
  DeviceArray<Word> stress_words_;
  DeviceArray<Real> moment_constants_, force_constants_, supports_, load_;
  DeviceArray<StateReal> velocity_, displacement_;
  DeviceArray<Constants> tiles_;
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

std::unique_ptr<Backend> make_cuda_backend(const Model& model, Precision precision, int device) {
  switch (precision) {
    case Precision::single:
      return std::make_unique<CudaBackend<float, float>>(model, device);
    case Precision::mixed:
      return std::make_unique<CudaBackend<float, double>>(model, device);
    case Precision::double_:
      break;
  }
  return std::make_unique<CudaBackend<double, double>>(model, device);
}

}  // namespace phyxel
