/// Contact of bodies with each other on the GPU.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "setup/device_touching_points.hpp"
#include "solver/body_contact_kernels.cuh"
#include "solver/contact_stiffness.hpp"
#include "solver/contact_watch.hpp"
#include "solver/contacts.cuh"
#include "solver/device_distances.cuh"
#include "solver/device_model.cuh"
#include "solver/device_sums.cuh"
#include "solver/passes.cuh"
#include "solver/stream.cuh"
#include "solver/thread_group.cuh"
#include "timeline.hpp"

namespace phyxel::cuda {

/// Keeps the bodies of a model out of each other.
template <class Real, class StateReal>
class DeviceBodyContacts {
 public:
  explicit DeviceBodyContacts(DeviceModel<Real, StateReal>& model)
      : m_(model),
        layer_(model.model()),
        points_(layer_, places_of(model.model().body_contact.layer.phyxels), model.tiling().tiles(),
                model.stream()),
        watch_(layer_, 1, 4),
        pushes_(has_body_penalties(model.model())),
        rubs_(pushes_ && has_body_friction(model.model().body_contact)) {
    if (!acts()) return;
    const BodyContact& contact = m_.model().body_contact;
    std::vector<PlacedDistances> fields;
    std::map<const DistanceArrays*, DistanceField> views;  // copies of a body share one
    for (const BodyDistances& distances : contact.distances) {
      const auto [view, is_new] = views.try_emplace(distances.arrays.get());
      if (is_new && distances) {
        view->second = distances_.emplace_back(*distances.arrays, name).view();
      }
      fields.push_back(distances.view(view->second));
    }
    fields_ = sent(fields, name);
    layer_place_ = sent(places_of(layer_.phyxels()), name);
    std::vector<Vec3<double>> positions;
    for (const SurfaceSite& site : layer_.sites()) positions.push_back(site.rest);
    layer_position_ = sent(positions, name);
    layer_found_ = {positions.size(), name};
    std::vector<Index> begin, end;
    for (const LayerGroup& group : layer_.groups()) {
      begin.push_back(static_cast<Index>(group.begin));
      end.push_back(static_cast<Index>(group.end));
    }
    group_begin_ = sent(begin, name);
    group_end_ = sent(end, name);
    ways_ = {numbers_of_way * begin.size(), name};
    const std::size_t bodies = contact.distances.size();
    const auto accumulators = static_cast<unsigned>(std::clamp<std::size_t>(256 / bodies, 2, 128));
    sums_ = DeviceSums(static_cast<int>(bodies) * ContactTerms::count, accumulators, name);
  }

  /// True if bodies touch each other.
  bool acts() const { return m_.model().body_contact.acts(); }

  /// Notes that phyxels have been moved other than by steps.
  void forget_ways() {
    knows_ways_ = false;
    watch_.look_next();
  }
  /// Begins a step of `dt` [s]: finds how far phyxels have moved, if it is time to look where
  /// bodies are and the step before has not found it. The host looks in `begin_step`, while
  /// launches in between run; these must not move phyxels.
  void begin_look(double dt) {
    is_looking_ = acts() && watch_.is_due(dt);
    if (is_looking_ && !knows_ways_) find_ways_now();
  }
  /// Prepares for the step of `begin_look`. Of a share: collective.
  void begin_step(double dt, const Passes<Real, StateReal>& passes) {
    if (!acts()) return;
    if (is_looking_) look(dt);
    is_looking_ = false;
    // The next look is then at what the device has found during this step.
    if (watch_.is_due_next() && !knows_ways_) {
      find_ways_now();
      knows_ways_ = true;
    }
    dt_ = dt;
    if (!points_.any()) return;
    sums_.prepare(own().place.size(), 1, [&] { m_.wait(); });
    passes.put_gradients({gradients_.data(), stride(), own().tiles.data()},
                         static_cast<Index>(own().tiles.size()));
    m_.launch_each("begin_motion", begin_motion<Real, StateReal>, count(), m_.fields(), places(),
                   way_.data());
  }
  /// Changes the velocities with which the step starts by penalties. Of a share: collective.
  void push_apart() {
    if (!pushes_ || !points_.any()) return;
    const PenaltyPasses passes = penalties();
    end_motion();
    if (m_.share()) refresh(motion_);
    find_touches(passes);
    find_carriers(passes);
    launch_groups("find_row_pushes", find_row_pushes, rows(), passes, lists_of_step().inside);
    launch_groups("push_apart", cuda::push_apart<Real, StateReal>, points(), m_.fields(), passes,
                  places(), regain_.data(), lists_of_step().active);
  }
  /// Moves phyxels that the step has led into bodies out of them, or lets those rub that penalties
  /// push. Of a share: collective.
  void keep_apart() {
    if (!acts() || !points_.any()) return;
    if (pushes_) m_.launch_each("end_way", end_way, 1, way_.data());
    end_motion();
    if (!pushes_) move_apart();
    if (rubs_) rub_apart();
    m_.launch_each("add_contact_terms", add_contact_terms<Real>, count(), places(), dt_,
                   sums_.pointer());
  }
  /// The depths, before `push_apart`, of phyxels of each body in other bodies, as of
  /// `BodyContacts::depths`. Waits.
  std::vector<double> depths() {
    const std::size_t bodies = m_.model().body_contact.distances.size();
    std::vector<double> deepest(2 * bodies);
    if (!acts() || !points_.any()) return deepest;
    DeviceArray<double> all(deepest.size(), name);
    all.clear();
    const DeviceArray<double> ranges = sent(layer_.ranges_of_bodies(), name);
    end_motion();
    if (m_.share()) refresh(motion_);
    find_touches(passes());
    m_.launch_each("find_depths", find_depths, rows(), passes(), own().body.data(), ranges.data(),
                   static_cast<int>(bodies), count(), rows(), all.data());
    m_.launch_each("end_way", end_way, 1, way_.data());
    m_.wait();
    return fetched(all);
  }
  /// The forces on phyxels of this device in the last step that its other forces do not contain
  /// [N]: of a step that is tried. Waits.
  std::vector<Vec3d> forces() const {
    std::vector<Vec3d> forces;
    if (!acts()) return forces;
    forces.resize(static_cast<std::size_t>(m_.size()));
    if (!points_.any()) return forces;
    m_.wait();
    const std::vector<PointForces> of_points = fetched(forces_);
    const std::vector<Index> layer = fetched(own().layer);
    for (std::size_t p = 0; p < layer.size(); ++p) {
      // Penalties are among the other forces.
      forces[layer_.phyxels()[layer[p]]] = pushes_ ? of_points[p].tangential : of_points[p].sum();
    }
    return forces;
  }
  /// Replaces the sums: takes steps back.
  void set_sums(std::vector<ExactSum> sums) {
    if (acts()) sums_.set(std::move(sums));
  }
  /// The sums of each body so far (`ContactTerms`). Waits for the steps in progress.
  std::vector<ExactSum> sums() const {
    if (!acts()) return {};
    m_.wait();
    return sums_.sums();
  }
  std::size_t bytes() const {
    if (!acts()) return 0;
    std::size_t bytes =
        fields_.bytes() + layer_place_.bytes() + layer_position_.bytes() + layer_found_.bytes() +
        group_begin_.bytes() + group_end_.bytes() + ways_.bytes() + sums_.bytes() +
        points_.bytes() + motion_.bytes() + velocity_.bytes() + response_.bytes() +
        carries_.bytes() + carriers_.bytes() + carrier_count_.bytes() + in_patch_.bytes() +
        touch_.bytes() + force_.bytes() + share_.bytes() + forces_.bytes() + gradients_.bytes() +
        regain_.bytes() + modulus_.bytes() + wakes_.bytes() + is_inside_.bytes() +
        is_active_.bytes() + way_.bytes() + near_rows_.bytes() + inside_rows_.bytes() +
        active_points_.bytes() + in_range_.bytes() + list_counts_.bytes();
    for (const DeviceDistances& distances : distances_) bytes += distances.bytes();
    return bytes;
  }

 private:
  static constexpr const char* name = "contact";

  const DeviceTouchingPoints::Own& own() const { return points_.own(); }
  const DeviceTouchingPoints::Lists& lists() const { return points_.lists(); }
  int count() const { return static_cast<int>(own().place.size()); }
  int rows() const { return static_cast<int>(lists().rows.size()); }
  int points() const { return static_cast<int>(lists().site.size()); }
  std::size_t stride() const { return own().tiles.size() * tile_size; }
  std::vector<Index> places_of(const std::vector<Index>& phyxels) const {
    std::vector<Index> places;
    for (const Index i : phyxels) places.push_back(m_.tiling().place[i]);
    return places;
  }

  void end_motion() const {
    m_.launch_each("end_motion", cuda::end_motion<Real, StateReal>, count(), m_.fields(), places(),
                   way_.data());
  }
  void find_touches(const ContactPasses& passes) const {
    const ContactLists of_step = lists_of_step();
    m_.launch_each("empty_lists", empty_lists, points(), of_step, is_active_.data(), points());
    launch_whole("find_near_rows", find_near_rows, rows(), passes, of_step, rows());
    if (passes.in_patch) launch_groups("find_patches", find_patches, rows(), passes, of_step);
    launch_groups("find_touches", cuda::find_touches, rows(), passes, of_step);
    launch_groups("find_carrying", find_carrying, rows(), passes, of_step);
  }
  void find_carriers(const ContactPasses& passes) const {
    const NumberList active = lists_of_step().active;
    m_.launch_each("list_active", list_active, points(), is_active_.data(), points(), active);
    launch_groups("find_carriers", cuda::find_carriers, points(), passes, active);
  }
  /// Finds the shares of active points and the responses of rows whose points are inside.
  void find_responses(const ContactPasses& passes) const {
    launch_groups("find_shares", find_shares, points(), passes, lists_of_step().active);
    launch_groups("find_responses", cuda::find_responses, rows(), passes, lists_of_step().inside);
  }
  /// Moves phyxels out of the bodies that the step has led them into.
  void move_apart() {
    const ContactPasses passes = this->passes();
    if (m_.share()) {
      refresh(motion_);
      refresh(velocity_);
    }
    find_touches(passes);
    find_carriers(passes);
    find_responses(passes);
    for (int sweep = 0; sweep < m_.model().body_contact.sweeps; ++sweep) {
      if (sweep > 0 && m_.share()) refresh(velocity_);
      launch_groups("find_row_forces", find_row_forces, rows(), passes, lists_of_step().inside);
      launch_groups("move_apart", cuda::move_apart<Real, StateReal>, points(), m_.fields(), passes,
                    places(), lists_of_step().active);
    }
  }
  /// Adds friction to penalties.
  void rub_apart() {
    const PenaltyPasses passes = penalties();
    if (m_.share()) refresh(velocity_);
    find_responses(passes);
    launch_groups("find_row_rubs", find_row_rubs, rows(), passes, lists_of_step().inside);
    launch_groups("rub_apart", cuda::rub_apart<Real, StateReal>, points(), m_.fields(), passes,
                  places(), lists_of_step().active);
  }
  PenaltyPasses penalties() const {
    return {passes(), modulus_.data(), share_of_layer * m_.model().body_contact.penalty};
  }

  /// Finds the points that may touch anew if phyxels have moved far enough.
  void look(double dt) {
    const Phase phase("looking where bodies are");
    const bool is_late = watch_.is_late_by(ways_now(), dt, knows_ways_ ? 1 : 0);
    knows_ways_ = false;
    if (!is_late) return;
    find_places();
    points_.find(layer_found_, dt, watch_.skins());
    watch_.found(points_.reach());
    make_arrays(dt);
  }
  void find_places() const {
    const int count = static_cast<int>(layer_place_.size());
    m_.launch_each("copy_places", copy_places<Real, StateReal>, count, m_.fields(),
                   layer_place_.data(), layer_position_.data(), layer_found_.data(), count);
  }
  /// Begins to find the ways of the groups of the layer since places were found.
  void find_ways_now() {
    if (watch_.generation() == 0) find_places();
    const auto blocks = static_cast<unsigned>(layer_.groups().size());
    if (blocks == 0) return;
    find_ways<<<blocks, tile_size, 0, m_.stream()>>>(
        m_.fields(), layer_place_.data(), layer_position_.data(), layer_found_.data(),
        group_begin_.data(), group_end_.data(), ways_.data());
    m_.launched("find_ways", blocks, tile_size);
    found_ways_.begin_fetch(ways_, m_.stream());
    PHYXEL_CUDA(cudaEventRecord(ways_are_there_.get(), m_.stream()));
  }
  /// The ways. Waits for them.
  std::vector<SurfaceWay> ways_now() const {
    std::vector<SurfaceWay> ways(layer_.groups().size());
    if (ways.empty()) return ways;
    Phase phase("steps in progress");
    const cudaError_t error = cudaEventSynchronize(ways_are_there_.get());
    if (error != cudaSuccess) m_.wait();  // its message names the last launch
    check_cuda(error, "cudaEventSynchronize");
    phase.end();
    const std::span<const double> numbers = found_ways_.values();
    const auto vector = [&](std::size_t first) {
      return Vec3d{numbers[first], numbers[first + 1], numbers[first + 2]};
    };
    for (std::size_t g = 0; g < ways.size(); ++g) {
      const std::size_t first = numbers_of_way * g;
      ways[g] = {{vector(first), vector(first + 6)}, {vector(first + 3), vector(first + 9)}};
    }
    return ways;
  }
  /// Makes the arrays of the passes for the points that are found.
  void make_arrays(double dt) {
    const Phase phase("arrays of contact");
    const PooledMemory pooled(points_.pool());
    const std::size_t count = own().place.size(), points = lists().site.size(),
                      rows = lists().rows.size();
    // The array that was there is freed first, so that the new one gets its memory.
    const auto make = [](auto& array, std::size_t size) {
      array = {};
      array = {size, name};
    };
    const auto make_cleared = [&](auto& array, std::size_t size) {
      make(array, size);
      array.clear();
    };
    make(gradients_, 9 * stride());
    make(forces_, count);
    make_cleared(motion_, points);
    make_cleared(velocity_, points);
    make(share_, points);
    make(is_active_, points);
    make_cleared(touch_, rows);
    make_cleared(is_inside_, rows);
    make_cleared(wakes_, rows);
    make_cleared(way_, 1);
    make_cleared(carries_, lists().near.size());
    make(carriers_, lists().near.size());
    make(carrier_count_, contact_threads * points);
    make(near_rows_, rows);
    make(inside_rows_, rows);
    make(active_points_, points);
    make(in_range_, contact_threads * rows);
    make_cleared(list_counts_, 3);
    make(response_, rows);
    make(force_, rows);
    in_patch_ = {};
    if (lists().have_patches) {
      make(in_patch_, lists().near.size());
      PHYXEL_CUDA(cudaMemsetAsync(in_patch_.data(), 1, in_patch_.bytes(), m_.stream()));
    }
    if (!pushes_) return;
    regain_ = points_.regains(dt);
    modulus_ = points_.wave_moduli();
  }

  /// Launches a group of threads for each of `count` rows or points.
  template <class... Parameters, class... Arguments>
  void launch_whole(const char* kernel_name, void (*kernel)(Parameters...), int count,
                    Arguments... arguments) const {
    constexpr unsigned groups = ThreadGroup::in_block, threads = ThreadGroup::block;
    const unsigned blocks = (static_cast<unsigned>(count) + groups - 1) / groups;
    if (blocks == 0) return;
    kernel<<<blocks, threads, 0, m_.stream()>>>(arguments...);
    m_.launched(kernel_name, blocks, threads);
  }
  /// Launches groups of threads for a list of at most `count` rows or points (`NumberList`).
  template <class... Parameters, class... Arguments>
  void launch_groups(const char* kernel_name, void (*kernel)(Parameters...), int count,
                     Arguments... arguments) const {
    constexpr int most = 2048 * ThreadGroup::in_block;  // enough for any device
    launch_whole(kernel_name, kernel, std::min(count, most), arguments...);
  }
  /// The lists that each step fills anew.
  ContactLists lists_of_step() const {
    return {{near_rows_.data(), list_counts_.data()},
            {inside_rows_.data(), list_counts_.data() + 1},
            {active_points_.data(), list_counts_.data() + 2},
            in_range_.data()};
  }
  template <class T>
  void refresh(DeviceArray<T>& of_points) {
    m_.wait();
    points_.refresh(of_points);
  }

  SurfacePlaces<Real> places() const {
    return {.place = own().place.data(),
            .position = own().position.data(),
            .site = lists().site.data(),
            .centre = own().centre.data(),
            .body = own().body.data(),
            .entry = own().entry.data(),
            .gradients = gradients_.data(),
            .stride = stride(),
            .motion = motion_.data(),
            .velocity = velocity_.data(),
            .forces = forces_.data(),
            .count = count()};
  }
  ContactPasses passes() const {
    return {.site = lists().site.data(),
            .motion = motion_.data(),
            .velocity = velocity_.data(),
            .row = lists().rows.data(),
            .near_start = lists().near_start.data(),
            .near = lists().near.data(),
            .entries_of_start = lists().entries_of_start.data(),
            .entries_of = lists().entries_of.data(),
            .rows_naming = lists().rows_naming.data(),
            .rows_from_start = lists().rows_from_start.data(),
            .rows_from = lists().rows_from.data(),
            .field = fields_.data(),
            .touch = touch_.data(),
            .response = response_.data(),
            .force = force_.data(),
            .carries = carries_.data(),
            .carriers = carriers_.data(),
            .carrier_count = carrier_count_.data(),
            .in_patch = in_patch_.data(),
            .share = share_.data(),
            // What points of other devices do is not among the ways here.
            .wakes = m_.share() ? nullptr : wakes_.data(),
            .way = way_.data(),
            .is_inside = is_inside_.data(),
            .is_active = is_active_.data(),
            .dt = dt_};
  }

  DeviceModel<Real, StateReal>& m_;
  SurfaceLayer layer_;
  DeviceTouchingPoints points_;
  LayerWatch watch_;
  bool pushes_;    // true if bodies act by penalties
  bool rubs_;      // true if some of these have friction
  double dt_ = 0;  // [s]
  DeviceSums sums_;
  std::vector<DeviceDistances> distances_;  // of bodies that are no copies of each other
  DeviceArray<PlacedDistances> fields_;
  DeviceArray<Index> layer_place_;
  DeviceArray<Vec3<double>> layer_position_, layer_found_;
  DeviceArray<Index> group_begin_, group_end_;  // groups of the layer
  DeviceArray<double> ways_;                    // of these groups
  PinnedArray<double> found_ways_;              // the same on the host
  Event ways_are_there_;                        // recorded after their copy
  bool is_looking_ = false;                     // from `begin_look` to `begin_step`
  bool knows_ways_ = false;                     // true if the step before has found them
  DeviceArray<Real> gradients_;                 // of this device's points
  DeviceArray<PointForces> forces_;             // on them
  DeviceArray<double> regain_, modulus_;        // of penalties; empty without them
  // As of `ContactPasses`.
  DeviceArray<SurfaceMotion> motion_;
  DeviceArray<Vec3<double>> velocity_;
  DeviceArray<SurfaceShare> carries_;
  DeviceArray<SurfaceCarrier> carriers_;
  DeviceArray<Index> carrier_count_;
  DeviceArray<char> in_patch_;
  DeviceArray<SurfaceTouch> touch_;
  DeviceArray<SurfaceResponse> response_;
  DeviceArray<SurfaceForce> force_;
  DeviceArray<double> share_, wakes_;
  DeviceArray<PointWay> way_;  // one
  DeviceArray<char> is_inside_, is_active_;
  // As of `ContactLists`.
  DeviceArray<Index> near_rows_, inside_rows_, active_points_;
  DeviceArray<std::uint64_t> in_range_;
  DeviceArray<int> list_counts_;
};

}  // namespace phyxel::cuda
