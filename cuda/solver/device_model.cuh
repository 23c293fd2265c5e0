/// A model in device memory: its constants and its state, by tile slot.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "check.hpp"
#include "device.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "setup/device_tiling.hpp"
#include "setup/primitives.cuh"
#include "solver/device_history.cuh"
#include "solver/diagnose.cuh"
#include "solver/host_arrays.cuh"
#include "solver/hourglass.hpp"
#include "solver/kernels.cuh"
#include "solver/stream.cuh"

namespace phyxel::cuda {

/// CUDA allocates and shares memory in pages of this size [bytes]; smaller allocations lie
/// together.
inline constexpr std::size_t shared_page = std::size_t{2} << 20;

inline unsigned blocks_for(int count) {
  return static_cast<unsigned>((count + tile_size - 1) / tile_size);
}

template <class Real, class StateReal>
class DeviceModel {
 public:
  static constexpr bool mixed = !std::is_same_v<Real, StateReal>;
  using BodyConstants = TileConstants<Real, StateReal>;
  using AllFields = Fields<Real, StateReal>;

  /// Uploads a model. @throws DeviceError; InputError if a tile does not fit the shared memory of a
  /// block
  DeviceModel(const Model& model, int device)
      : model_(model),
        device_(use_cuda_device(device)),
        tiling_(make_device_tiling(model)),
        history_(model, tiling_) {
    PHYXEL_CUDA(cudaDeviceGetAttribute(&most_shared_memory_,
                                       cudaDevAttrMaxSharedMemoryPerBlockOptin, device_.index));
    pairwise_ = std::any_of(model.parts.begin(), model.parts.end(),
                            [](const Part& part) { return part.pair_length > 0; });
    own_supports_ = pairwise_ || !one_support_each();
    // Weights of pairs come with closed gradients (`WithPairWeights`).
    closed_ = pairwise_ || !model.closing.empty();
    if (share()) {
      own_supports_ = share()->communicator->largest(own_supports_) > 0;
      closed_ = share()->communicator->largest(closed_) > 0;
    }
    last_launch_.subject = subject_ = std::to_string(model.size()) + " phyxels";
    lists_ = view_of(tiling_.neighbours);
    second_lists_ = view_of(tiling_.second());
    make_fields();
  }
  DeviceModel(const DeviceModel&) = delete;
  DeviceModel& operator=(const DeviceModel&) = delete;

  const Model& model() const { return model_; }
  const Device& device() const { return device_; }
  const DeviceTiling& tiling() const { return tiling_; }
  /// The share; null if the model is whole.
  const Share* share() const { return model_.share.get(); }
  Index size() const { return model_.size(); }
  /// Number of tile slots. Those of ghosts come after all slots that this rank steps.
  std::size_t places() const { return static_cast<std::size_t>(tiling_.places()); }
  Index tiles() const { return tiling_.own_tiles; }  ///< Tiles that this rank steps.
  /// Number of boundary tiles, which come first: those that reach ghosts or are ghosts elsewhere.
  Index boundary_tiles() const { return tiling_.boundary_tiles; }
  const std::string& subject() const { return subject_; }  ///< For messages: "575 phyxels".
  bool own_supports() const { return own_supports_; }
  /// True if a law of any rank has a history.
  bool has_history() const { return history_.columns() > 0; }
  /// True with closed gradients, or with weights of pairs, on any rank.
  bool closed() const { return closed_; }
  /// True if a body has weights of pairs.
  bool pairwise() const { return pairwise_; }
  int most_shared_memory() const { return most_shared_memory_; }  ///< Limit for one block [bytes].

  const AllFields& fields() const { return fields_; }
  const DeviceLists& lists() const { return lists_; }
  const DeviceLists& second_lists() const { return second_lists_; }
  /// Constants of each tile's body for sums. @param lag lag of the velocities, as in `Instant` [s]
  const TileMaterial* materials(double lag) {
    if (lag == materials_lag_) return materials_.data();
    const std::vector<TileMaterial> materials = for_tiles<TileMaterial>([&](const Part& part) {
      const Material& m = part.material;
      const ChosenLaw law = chosen_law(m);
      TileMaterial tile{};
      std::copy(law.constants.begin(), law.constants.end(), tile.law);
      tile.law_index = law.index;
      tile.volume_stiffness = m.volume_stiffness;
      tile.hourglass = hourglass_stiffness(model_, part);
      tile.flow = damped_flow(m.damping, lag);
      tile.origin = part.origin;
      return tile;
    });
    materials_.upload(materials.data());
    materials_lag_ = lag;
    return materials_.data();
  }
  /// The global id of the phyxel in each tile slot; -1 if the slot is empty.
  const Index* number_at() const { return share() ? number_at_.data() : tiling_.phyxel_at.data(); }
  /// Pair stresses and closing stresses of a model with closed gradients.
  ClosedStresses<Real> closed_stresses() const {
    return {fields_.stresses, fields_.closing_stresses};
  }
  /// The memory behind `Fields::points`, `stresses` and `closing_stresses` (`Points::in`).
  void* points_memory() const { return points_.data(); }
  void* stresses_memory() const { return stresses_.data(); }
  void* closing_stresses_memory() const { return closing_stresses_.data(); }

  /// The origin of a body's positions, its first phyxel, so that a body far from the origin keeps
  /// its digits in float.
  Vec3d origin_of(Index part) const { return model_.parts[part].origin; }

  /// The step that the damping factors belong to [s].
  double dt() const { return dt_; }
  void send_constants(double dt) {
    dt_ = dt;
    tiles_.upload(
        for_tiles<BodyConstants>([&](const Part& part) { return constants_of(part, dt); }).data());
  }
  /// The constants of the linearisation of each tile's law at rest, volume conservation included.
  DeviceArray<BodyConstants> rest_constants() const {
    return sent(for_tiles<BodyConstants>([&](const Part& part) {
                  BodyConstants constants = constants_of(part, 0);
                  const ChosenLaw law = chosen_law(part.material);
                  Laws::with<double>(law.index, law.constants.data(), [&](const auto& own) {
                    const auto linear = own.at_rest(part.material.volume_stiffness);
                    double values[constants_of_law<decltype(linear), double>];
                    std::memcpy(values, &linear, sizeof(linear));
                    std::copy(std::begin(values), std::end(values), constants.law);
                  });
                  return constants;
                }),
                "tiles of " + subject_);
  }
  /// Allocates applied forces, initially undefined.
  void make_loads() {
    if (load_.size()) return;
    load_ = {3 * places(), "loads of " + subject_};
    fields_.load = load_.data();
    if (model_.following.empty()) return;
    following_ = {3 * places(), "loads of " + subject_};
    fields_.following = following_.data();
  }
  /// Sets the caller's forces [N], shape [3, places], which `loads` includes and whose energy is
  /// not counted. An empty list clears them, and `loads` too if the scene has no loads.
  void set_external(const std::vector<Real>& force) {
    external_ = {};
    if (force.empty()) {
      if (model_.loads.empty()) load_ = {};
    } else {
      make_loads();
      external_ = sent(force, "external forces of " + subject_);
    }
    fields_.load = load_.data();
    fields_.external = external_.data();
  }
  Real* loads() const { return load_.data(); }  ///< [3, places], or null.
  /// Room for the forces of loads that follow the surface, [3, places], or null.
  Real* following() const { return following_.data(); }

  /// Uploads a state. @throws InputError for a history of other laws
  void put(const State& state) {
    history_.put(state);
    const DeviceArray<Vec3d> u = sent(state.displacement, "displacements of " + subject_),
                             v = sent(state.velocity, "velocities of " + subject_);
    launch_places("put_state", put_state<Real, StateReal>, fields_, tiling_.phyxel_at.data(),
                  u.data(), v.data());
    wait();
  }
  /// Replaces the displacements; velocities and history do not change.
  void put_displacements(std::span<const Vec3d> displacement) {
    const DeviceArray<Vec3d> u = sent(std::vector<Vec3d>(displacement.begin(), displacement.end()),
                                      "displacements of " + subject_);
    launch_places("set_displacements", set_displacements<Real, StateReal>, fields_,
                  tiling_.phyxel_at.data(), u.data());
    wait();
  }
  void take(State& state) const {
    const auto n = static_cast<std::size_t>(size());
    const DeviceArray<Vec3d> u(n, "displacements of " + subject_),
        v(n, "velocities of " + subject_);
    launch_places("take_state", take_state<Real, StateReal>, fields_, tiling_.phyxel_at.data(),
                  u.data(), v.data());
    state.displacement = fetched(u);
    state.velocity = fetched(v);
    history_.take(state);
  }

  // --- launches ---------------------------------------------------------------------------------

  void use_device() const { PHYXEL_CUDA(cudaSetDevice(device_.index)); }
  cudaStream_t stream() const { return stream_.get(); }
  /// Checks a launch. Call right after it.
  void launched(const char* kernel, unsigned blocks, unsigned threads) const {
    last_launch_.kernel = kernel;
    last_launch_.blocks = blocks;
    last_launch_.threads = threads;
    check_launch(last_launch_);
  }
  /// Launches a thread for each tile slot that this rank steps.
  template <class... Parameters, class... Arguments>
  void launch_tiles(const char* name, void (*kernel)(Parameters...), Arguments... arguments) const {
    launch(name, kernel, static_cast<unsigned>(tiles()), arguments...);
  }
  /// Launches a thread for each tile slot, ghosts included.
  template <class... Parameters, class... Arguments>
  void launch_places(const char* name, void (*kernel)(Parameters...),
                     Arguments... arguments) const {
    launch(name, kernel, static_cast<unsigned>(tiling_.tiles()), arguments...);
  }
  /// Launches `count` threads.
  template <class... Parameters, class... Arguments>
  void launch_each(const char* name, void (*kernel)(Parameters...), int count,
                   Arguments... arguments) const {
    launch(name, kernel, blocks_for(count), arguments...);
  }
  /// Launches blocks of a tile's size with the given shared memory.
  /// @param overlapping true if the kernel may begin before the previous launch has ended; it then
  /// waits inside (`wait_for_last_launch`)
  template <class... Parameters, class... Arguments>
  void launch_blocks(const char* name, void (*kernel)(Parameters...), dim3 blocks, int shared_bytes,
                     bool overlapping, Arguments... arguments) const {
    if (blocks.x == 0 || blocks.y == 0) return;
    allow_shared_memory(reinterpret_cast<const void*>(kernel));
    cudaLaunchAttribute overlap = overlap_attribute();
    cudaLaunchConfig_t config{};
    config.gridDim = blocks;
    config.blockDim = tile_size;
    config.dynamicSmemBytes = static_cast<std::size_t>(shared_bytes);
    config.stream = stream();
    config.attrs = &overlap;
    config.numAttrs = overlapping && device_.major >= 9 ? 1 : 0;
    PHYXEL_CUDA(cudaLaunchKernelEx(&config, kernel, arguments...));
    launched(name, blocks.x * blocks.y, tile_size);
  }
  static cudaLaunchAttribute overlap_attribute() {
    cudaLaunchAttribute overlap;
    overlap.id = cudaLaunchAttributeProgrammaticStreamSerialization;
    overlap.val.programmaticStreamSerializationAllowed = 1;
    return overlap;
  }
  void wait() const { wait_for_device(last_launch_); }
  /// Allows a kernel more than 48 KiB of shared memory: all there is, because the setting belongs
  /// to the kernel, not to this object, and other models may need more.
  void allow_shared_memory(const void* kernel) const {
    if (std::find(allowed_.begin(), allowed_.end(), kernel) != allowed_.end()) return;
    PHYXEL_CUDA(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                     most_shared_memory_));
    allowed_.push_back(kernel);
  }
  /// Shared memory [bytes] of a block of pass 1.
  int pass_1_bytes(int slots) const {
    return (Points<Real>::bytes + (pairwise_ ? static_cast<int>(sizeof(Real)) : 0)) * slots;
  }
  /// Shared memory [bytes] of a block of pass 2, which needs more than pass 1.
  int pass_2_bytes(int slots) const {
    return (Stresses<Real>::bytes + (own_supports_ ? static_cast<int>(sizeof(Real)) : 0) +
            (closed() ? ClosingStresses<Real>::bytes : 0)) *
           slots;
  }

  // --- accounts ---------------------------------------------------------------------------------

  void add_memory(std::vector<ArrayBytes>& list) const {
    list.insert(list.end(), {{"points", Points<Real>::bytes * places()},
                             {"stresses", Stresses<Real>::bytes * places()},
                             {"constants", moment_constants_.bytes() + force_constants_.bytes() +
                                               tiles_.bytes() + materials_.bytes()},
                             {"velocities", velocity_.bytes()},
                             {"neighbour lists", tiling_.neighbours.bytes()},
                             {"places", tiling_.phyxel_at.bytes()}});
    if (tiling_.inverse) list.push_back({"inverse neighbour lists", tiling_.inverse->bytes()});
    if (own_supports_) list.push_back({"supports", supports_.bytes()});
    if (mixed) list.push_back({"displacements", displacement_.bytes()});
    if (load_.size()) list.push_back({"loads", load_.bytes() + following_.bytes()});
    if (external_.size()) list.push_back({"external forces", external_.bytes()});
    if (pull_.size()) list.push_back({"hourglass control", pull_.bytes()});
    if (history_.bytes()) list.push_back({"history", history_.bytes()});
    if (closed()) {
      list.push_back(
          {"closing vectors and stresses", closing_.bytes() + closing_stresses_.bytes()});
    }
  }
  std::size_t step_traffic() const {
    const std::size_t lists = tiling_.neighbours.bytes() + tiling_.second().bytes();
    std::size_t each = 2 * Points<Real>::bytes + Points<Real>::bytes + 2 * Stresses<Real>::bytes;
    each += (7 + 4) * sizeof(Real) + 6 * sizeof(StateReal);
    if (mixed) each += 6 * sizeof(StateReal);
    if (load_.size()) each += 3 * sizeof(Real);
    if (pull_.size()) each += 6 * sizeof(Real);
    if (closed()) each += 6 * sizeof(Real) + 2 * ClosingStresses<Real>::bytes;
    return lists + each * places() + 2 * history_.bytes();
  }

 private:
  template <class... Parameters, class... Arguments>
  void launch(const char* name, void (*kernel)(Parameters...), unsigned blocks,
              Arguments... arguments) const {
    if (blocks == 0) return;  // a rank may have nothing
    kernel<<<blocks, tile_size, 0, stream()>>>(arguments...);
    launched(name, blocks, tile_size);
  }

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
  void check_shared_memory(const DeviceTileLists& lists) const {
    const int bytes = pass_2_bytes(lists.slots());
    if (bytes <= most_shared_memory_) return;
    throw InputError(device_.name + ": " + std::to_string(tile_size) +
                     " phyxels side by side and their " + std::to_string(lists.halo_stride) +
                     " neighbours take " + std::to_string(bytes) +
                     " bytes of shared memory, of which a block may have " +
                     std::to_string(most_shared_memory_) +
                     ": allowed are a smaller support, precision \"float\"" +
                     (closed() && !pairwise() ? ", closure = 0" : "") + " or the CPU");
  }

  void make_fields() {
    const std::string of = " of " + subject_;
    // Memory that other ranks may open is shared by whole pages, and never empty.
    const std::size_t more = share() ? shared_page : 0;
    points_ = {Points<Real>::bytes * places() + more, "points" + of};
    fields_.points = Points<Real>::in(points_.data(), places());
    stresses_ = {Stresses<Real>::bytes * places() + more, "stresses" + of};
    fields_.stresses = Stresses<Real>::in(stresses_.data(), places());
    moment_constants_ = {7 * places(), "inverse moments" + of};
    force_constants_ = {4 * places(), "masses" + of};
    if (own_supports_) supports_ = {places(), "supports" + of};
    velocity_ = {3 * places(), "velocities" + of};
    if (mixed) displacement_ = {3 * places(), "displacements" + of};
    if (has_hourglass_control(model_) || model_.fracture.acts()) {
      pull_ = {3 * places(), "hourglass control" + of};
      pull_.clear();
    }
    if (closed()) {
      closing_ = sent(closing_by_place(), "closing vectors" + of);
      closing_stresses_ = {ClosingStresses<Real>::bytes * places() + more, "closing stresses" + of};
      closing_stresses_.clear();
      fields_.closing_stresses = ClosingStresses<Real>::in(closing_stresses_.data(), places());
    }
    tiles_ = {tiling_.part.size(), "tiles" + of};
    materials_ = {tiling_.part.size(), "tiles" + of};

    fields_.inverse_h_squared = supports_.data();
    fields_.moment_constants = moment_constants_.data();
    fields_.force_constants = force_constants_.data();
    fields_.velocity = velocity_.data();
    fields_.displacement = displacement_.data();
    fields_.pull = pull_.data();
    fields_.closing = closing_.data();
    fields_.history = history_.data();
    fields_.history_numbers = history_.rows();
    fields_.tiles = tiles_.data();
    fields_.gravity = to<StateReal>(model_.gravity);
    fields_.places = places();
    if (share()) {
      number_at_ = sent(numbers_at(model_, tiling_.phyxel), "places");
    }
    send_constants(0);
    put_all_constants();
    velocity_.clear();
    if constexpr (mixed) displacement_.clear();
  }

  /// ĉ as rows [3, places]; zero if this rank has no closed gradients.
  std::vector<Real> closing_by_place() const {
    std::vector<Real> values(3 * places());
    for (Index i = 0; i < static_cast<Index>(model_.closing.size()); ++i) {
      const auto place = static_cast<std::size_t>(tiling_.place[i]);
      const Vec3<Real> c = to<Real>(model_.closing[i]);
      values[place] = c.x;
      values[places() + place] = c.y;
      values[2 * places() + place] = c.z;
    }
    return values;
  }

  /// `Fields::inverse_h_squared` of a model with weights of pairs.
  std::vector<Real> supports_by_place() const {
    std::vector<Real> values(places());
    for (const Part& part : model_.parts) {
      for (Index i = part.begin; i < part.end; ++i) {
        const double h = model_.neighbourhood.support[i];
        values[static_cast<std::size_t>(tiling_.place[i])] =
            static_cast<Real>(part.pair_length > 0 ? relative_half_support(h, part.pair_length)
                              : h > 0              ? 1 / (h * h)
                                                   : 0);
      }
    }
    return values;
  }

  void put_all_constants() {
    const DeviceArray<Vec3d> position = sent(model_.position, "rest positions");
    const DeviceArray<double> volume = sent(model_.volume, "volumes"),
                              mass = sent(model_.mass, "masses"),
                              support = sent(model_.neighbourhood.support, "supports");
    std::vector<Vec3d> origins;
    for (const Index part : tiling_.part) origins.push_back(origin_of(part));
    const DeviceArray<Vec3d> origin = sent(origins, "tiles");
    DeviceArray<char> held;
    if (!model_.motions.empty()) held = sent(held_phyxels(model_), "held phyxels");
    const Constants constants{tiling_.phyxel_at.data(),
                              position.data(),
                              volume.data(),
                              mass.data(),
                              support.data(),
                              held.data(),
                              tiling_.inverse_moment.data(),
                              tiling_.moment_offset.data(),
                              origin.data()};
    launch_places("put_constants", put_constants<Real, StateReal>, fields_, constants,
                  moment_constants_.data(), force_constants_.data(), supports_.data());
    wait();
    if (pairwise_) supports_.upload(supports_by_place().data());
    tiling_.inverse_moment = {};
    tiling_.moment_offset = {};
  }

  BodyConstants constants_of(const Part& part, double dt) const {
    const Material& m = part.material;
    const DampedFlow flow = damped_flow(m.damping, dt);
    const double h = part.pair_length > 0    ? part.pair_length
                     : part.begin < part.end ? model_.neighbourhood.support[part.begin]
                                             : 0;
    const ChosenLaw law = chosen_law(m);
    BodyConstants tile{};
    for (int k = 0; k < law_numbers; ++k) tile.law[k] = static_cast<Real>(law.constants[k]);
    tile.hourglass = static_cast<Real>(hourglass_stiffness(model_, part));
    tile.inverse_h_squared = static_cast<Real>(h > 0 ? 1 / (h * h) : 0);
    if (part.pair_length > 0) tile.inverse_h_squared = -tile.inverse_h_squared;
    tile.keep = static_cast<StateReal>(flow.keep);
    tile.gain = static_cast<StateReal>(flow.gain);
    tile.damped = m.damping > 0;
    tile.law_index = law.index;
    return tile;
  }
  /// Returns make(part) for each tile's part.
  template <class Tile, class Make>
  std::vector<Tile> for_tiles(Make&& make) const {
    std::vector<Tile> parts, tiles;
    for (const Part& part : model_.parts) parts.push_back(make(part));
    for (const Index part : tiling_.part) tiles.push_back(parts[part]);
    return tiles;
  }

  const Model& model_;
  Device device_;
  DeviceTiling tiling_;
  Stream stream_;
  int most_shared_memory_ = 0;
  bool own_supports_ = false, closed_ = false, pairwise_ = false;
  std::string subject_;
  double dt_ = -1;
  mutable Launch last_launch_;
  mutable std::vector<const void*> allowed_;

  AllFields fields_{};
  DeviceLists lists_{}, second_lists_{};
  DeviceArray<std::byte> points_, stresses_, closing_stresses_;
  DeviceArray<Real> moment_constants_, force_constants_, supports_, load_, following_, external_,
      pull_, closing_;
  DeviceHistory<Real> history_;
  DeviceArray<StateReal> velocity_, displacement_;
  DeviceArray<BodyConstants> tiles_;
  DeviceArray<TileMaterial> materials_;  // with the damped flow over the lag
  double materials_lag_ = -1;
  DeviceArray<Index> number_at_;  // of shares only
};

}  // namespace phyxel::cuda
