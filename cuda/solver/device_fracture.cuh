/// Bodies that break, on the GPU.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "phyxel/diagnostics.hpp"
#include "phyxel/state.hpp"
#include "solver/breaking_kernels.cuh"
#include "solver/broken_pairs.hpp"
#include "solver/device_model.cuh"
#include "solver/device_sums.cuh"

namespace phyxel::cuda {

/// The pairs of a model that break. Without fracture and notches it has no arrays and does nothing.
template <class Real, class StateReal>
class DeviceFracture {
 public:
  /// @param model must outlive this; its lists are on the host
  explicit DeviceFracture(DeviceModel<Real, StateReal>& model) : m_(model) {
    if (!acts()) return;
    const Model& host = m_.model().with_lists();
    faces_.emplace(host);
    make_lists();
    make_arrays();
    if (host.fracture.breaks) make_watch();
  }

  /// True if pairs break or are broken from the start.
  bool acts() const { return m_.model().fracture.acts(); }
  /// True if pairs may break in steps.
  bool may_break() const { return m_.model().fracture.breaks; }

  /// Prepares for `count` steps, some tens at most. Call before they are launched or recorded.
  void prepare(int count) {
    if (!may_break()) return;
    taken_.prepare(2 * m_.places(), count, [&] { m_.wait(); });
  }
  /// The parity of the steps so far: launches of steps that follow an odd number of others differ
  /// from those that follow an even number, since two arrays change their roles.
  int parity() const { return parity_; }

  /// Breaks the pairs that are stretched too far at the present displacements, of which those of
  /// ghosts must have been received. @param in_step as of `break_from`
  void break_pairs(bool in_step) {
    if (!may_break()) return;
    const BreakingView<Real> breaking = view();
    const WatchView<Real> watch = watch_view();
    m_.launch_places("measure_motion", measure_motion<Real, StateReal>, m_.fields(), breaking,
                     watch);
    const auto launch = [&](const char* kernel_name, unsigned blocks, auto kernel,
                            auto... arguments) {
      if (blocks == 0) return;
      kernel<<<blocks, tile_size, 0, m_.stream()>>>(arguments...);
      m_.launched(kernel_name, blocks, tile_size);
    };
    constexpr unsigned warps = tile_size / warp_size;
    const unsigned rounds = (static_cast<unsigned>(m_.tiles()) + warps - 1) / warps,
                   at_once = 2U * static_cast<unsigned>(m_.device().multiprocessors);
    launch("look_at_tiles", std::min(rounds, at_once), look_at_tiles<Real, StateReal>, m_.fields(),
           breaking, watch, in_step, taken_.pointer());
    if (looks_++ % steps_between_turnings == 0) {
      launch("find_turning", static_cast<unsigned>(omega_.size()), find_turning<Real, StateReal>,
             m_.fields(), watch, static_cast<const Index*>(samples_.data()),
             static_cast<const Index*>(first_sample_.data()));
    }
    parity_ = 1 - parity_;
  }

  /// Finds the forces of closed cracks at the present displacements, of which those of ghosts must
  /// have been received. They may change before `add_closed`.
  void find_closed() const {
    if (acts()) launch_torn("find_closed", cuda::find_closed<Real, StateReal>, closed_.data());
  }
  /// Adds these forces to those of hourglass control, which the first pass has just found.
  void add_closed() const {
    if (!acts()) return;
    launch_torn("add_closed", cuda::add_closed<Real, StateReal>,
                static_cast<const double*>(closed_.data()));
  }

  /// Replaces the broken pairs by those of a state.
  /// @throws InputError as `BrokenPairs::set`
  void put(const State& state) {
    if (!acts()) {
      if (state.broken.empty()) return;
      throw InputError("a state with " + std::to_string(state.broken.size()) +
                       " broken pairs for a model without fracture and notches; allowed: none");
    }
    BrokenPairs next(m_.model());
    next.set(state.broken, state.worn);
    restore();
    cut(next, state.worn);
  }
  /// Begins to watch tiles anew from the displacements of a state that has been put in.
  void remember_displacements() {
    if (!may_break()) return;
    m_.launch_places("remember_motion", remember_motion<Real, StateReal>, m_.fields(),
                     displacement_[parity_].data());
    m_.launch_each("begin_watch", begin_watch, m_.tiles(), watch_.data(), m_.tiles());
    PHYXEL_CUDA(cudaMemsetAsync(omega_.data(), 0, omega_.bytes(), m_.stream()));
    m_.wait();
  }
  /// The broken pairs now. Waits for the steps in progress.
  BrokenPairs broken() const {
    BrokenPairs all(m_.model());
    if (!acts()) return all;
    m_.wait();
    const std::vector<Index> lost = fetched(lost_);
    std::vector<Index> places;
    std::vector<Offset> first{0};
    for (std::size_t place = 0; place < lost.size(); ++place) {
      if (lost[place] == 0) continue;
      places.push_back(static_cast<Index>(place));
      first.push_back(first.back() + lost[place]);
    }
    if (places.empty()) return all;
    const DeviceArray<Index> at = sent(places, name),
                             found(static_cast<std::size_t>(first.back()), name);
    const DeviceArray<Offset> begins = sent(first, name);
    const auto count = static_cast<int>(places.size());
    m_.launch_each("list_broken", list_broken<Real>, count, view(), at.data(), begins.data(), count,
                   found.data());
    m_.wait();
    const std::vector<Index> neighbours = fetched(found);
    const std::vector<double> carried = fetched(carried_);
    for (std::size_t k = 0; k < places.size(); ++k) {
      const Index i = m_.tiling().phyxel[places[k]];
      std::vector<Index> own;
      for (Offset e = first[k]; e < first[k + 1]; ++e) {
        own.push_back(m_.tiling().phyxel[neighbours[static_cast<std::size_t>(e)]]);
      }
      all.add(i, own);
      all.set_carried(i, carried[static_cast<std::size_t>(places[k])]);
    }
    return all;
  }
  /// What broken pairs have left of each phyxel at the present displacements, of which those of
  /// ghosts must have been received.
  Breakage breakage() const {
    const BrokenPairs now = broken();
    State state;
    if (!now.empty()) m_.take(state);
    return breakage_of(m_.model(), now, *faces_, [&](Index i) { return state.displacement[i]; });
  }
  /// The energy that broken pairs have taken on this rank [J]; none if no pair may break. Waits for
  /// the steps in progress.
  std::vector<ExactSum> taken() const {
    if (!may_break()) return {};
    m_.wait();
    return taken_.sums();
  }

  std::size_t bytes() const {
    return whole_.bytes() + second_whole_.bytes() + parts_.bytes() + part_of_tile_.bytes() +
           volume_.bytes() + growth_.bytes() + carried_.bytes() + lost_.bytes() +
           lost_in_tile_.bytes() + closed_.bytes() + displacement_[0].bytes() +
           displacement_[1].bytes() + boxes_.bytes() + omega_.bytes() + neighbours_.bytes() +
           first_neighbour_.bytes() + watch_.bytes() + samples_.bytes() + first_sample_.bytes() +
           taken_.bytes();
  }

 private:
  static constexpr const char* name = "pairs that break";
  static constexpr int steps_between_turnings = 16;  // a body turns evenly for so long
  static constexpr Index most_samples = 512;         // of a body, by which its turning is found

  /// Copies the lists with all pairs.
  void make_lists() {
    const auto copy = [](const DeviceArray<std::uint16_t>& entries) {
      DeviceArray<std::uint16_t> whole(entries.size(), name);
      PHYXEL_CUDA(
          cudaMemcpy(whole.data(), entries.data(), entries.bytes(), cudaMemcpyDeviceToDevice));
      return whole;
    };
    whole_ = copy(m_.tiling().neighbours.entries);
    if (m_.tiling().inverse) second_whole_ = copy(m_.tiling().inverse->entries);
  }
  void make_arrays() {
    const Model& model = m_.model();
    std::vector<BreakingPart> parts;
    const std::vector<char> breaks = breaking_bodies(model);
    for (const Part& part : model.parts) {
      parts.push_back(constants_of(part, breaks[static_cast<std::size_t>(part.body)]));
    }
    parts_ = sent(parts, name);
    part_of_tile_ = sent(m_.tiling().part, name);
    std::vector<double> volume(m_.places(), 0);
    std::vector<Real> growth(model.fracture.growth.empty() ? 0 : m_.places(),
                             static_cast<Real>(unbreakable_growth));
    for (Index i = 0; i < model.size(); ++i) {
      const auto place = static_cast<std::size_t>(m_.tiling().place[i]);
      volume[place] = model.volume[i];
      if (!growth.empty()) growth[place] = static_cast<Real>(model.fracture.growth[i]);
    }
    volume_ = sent(volume, name);
    growth_ = sent(growth, name);
    carried_ = sent(std::vector<double>(m_.places(), 1), name);
    lost_ = sent(std::vector<Index>(m_.places(), 0), name);
    lost_in_tile_ = sent(std::vector<char>(static_cast<std::size_t>(m_.tiling().tiles()), 0), name);
    closed_ = {3 * m_.places(), name};
  }
  BreakingPart constants_of(const Part& part, bool breaks) const {
    const Material& material = part.material;
    const ChosenLaw law = chosen_law(material);
    BreakingPart constants{};
    std::copy(law.constants.begin(), law.constants.end(), constants.law);
    constants.law_index = law.index;
    constants.hourglass = hourglass_stiffness(m_.model(), part);
    const double h = part.pair_length > 0    ? part.pair_length
                     : part.begin < part.end ? m_.model().neighbourhood.support[part.begin]
                                             : 0;
    constants.inverse_h_squared = h > 0 ? 1 / (h * h) : 0;
    if (part.pair_length > 0) constants.inverse_h_squared = -constants.inverse_h_squared;
    const double speed = pressure_wave_speed(material);
    constants.modulus = material.density * speed * speed;
    constants.body = part.body;
    constants.breaks = breaks;
    constants.pulls = m_.closed() || material.hourglass.value_or(0) > 0;
    return constants;
  }
  void make_watch() {
    for (DeviceArray<Real>& array : displacement_) array = {3 * m_.places(), name};
    const auto tiles = static_cast<std::size_t>(m_.tiling().tiles());
    boxes_ = sent(std::vector<MotionBox<Real>>(tiles), name);
    watch_ = sent(std::vector<TileWatch>(static_cast<std::size_t>(m_.tiles())), name);
    taken_ = DeviceSums(1, 256, name);
    find_neighbours();
    choose_samples();
    remember_displacements();
  }
  /// Finds the tiles that the pairs of each tile reach.
  void find_neighbours() {
    const DeviceTileLists& lists = m_.tiling().neighbours;
    const std::vector<Index> halo = fetched(lists.halo);
    std::vector<Index> neighbours, first{0};
    for (Index tile = 0; tile < m_.tiles(); ++tile) {
      std::vector<Index> own{tile};
      const auto begin = halo.begin() + std::ptrdiff_t{tile} * lists.halo_stride;
      for (auto place = begin; place != begin + lists.halo_stride; ++place) {
        if (*place >= 0 && *place / tile_size != own.back()) own.push_back(*place / tile_size);
      }
      std::sort(own.begin(), own.end());
      own.erase(std::unique(own.begin(), own.end()), own.end());
      neighbours.insert(neighbours.end(), own.begin(), own.end());
      first.push_back(static_cast<Index>(neighbours.size()));
    }
    neighbours_ = sent(neighbours, name);
    first_neighbour_ = sent(first, name);
  }
  /// Chooses the phyxels by which the turning of each body is found.
  void choose_samples() {
    const std::vector<char> breaks = breaking_bodies(m_.model());
    std::vector<std::vector<Index>> of_body(breaks.size());
    for (const Part& part : m_.model().parts) {
      if (!breaks[static_cast<std::size_t>(part.body)]) continue;
      const Index apart = (part.owned_end() - part.begin) / most_samples + 1;
      for (Index i = part.begin; i < part.owned_end(); i += apart) {
        of_body[static_cast<std::size_t>(part.body)].push_back(m_.tiling().place[i]);
      }
    }
    std::vector<Index> samples, first{0};
    for (const std::vector<Index>& own : of_body) {
      samples.insert(samples.end(), own.begin(), own.end());
      first.push_back(static_cast<Index>(samples.size()));
    }
    samples_ = sent(samples, name);
    first_sample_ = sent(first, name);
    omega_ = sent(std::vector<Vec3<double>>(of_body.size()), name);
  }

  BreakingView<Real> view() const {
    BreakingView<Real> v;
    const auto lists = [](const DeviceTileLists& own, const DeviceArray<std::uint16_t>& whole) {
      return BreakingLists{own.halo.data(), own.halo_stride, own.rows.data(), own.entries.data(),
                           whole.data()};
    };
    v.first = lists(m_.tiling().neighbours, whole_);
    if (m_.tiling().inverse) v.second = lists(*m_.tiling().inverse, second_whole_);
    v.parts = parts_.data();
    v.part_of_tile = part_of_tile_.data();
    v.places = m_.places();
    v.volume = volume_.data();
    v.growth = growth_.data();
    v.supports = m_.fields().inverse_h_squared;
    v.before = displacement_[parity_].data();
    v.carried = carried_.data();
    v.lost = lost_.data();
    v.lost_in_tile = lost_in_tile_.data();
    v.moment_constants = m_.fields().moment_constants;
    v.force_constants = m_.fields().force_constants;
    v.closing = m_.fields().closing;
    return v;
  }
  WatchView<Real> watch_view() const {
    return {m_.tiling().phyxel_at.data(),
            displacement_[parity_].data(),
            displacement_[1 - parity_].data(),
            boxes_.data(),
            omega_.data(),
            neighbours_.data(),
            first_neighbour_.data(),
            watch_.data(),
            m_.tiles()};
  }
  /// Launches a warp for each tile.
  template <class... Parameters, class Force>
  void launch_torn(const char* kernel_name, void (*kernel)(Parameters...), Force force) const {
    m_.launch_each(kernel_name, kernel, m_.tiles() * warp_size, m_.fields(), view(), m_.tiles(),
                   force);
  }

  /// Gives all phyxels that have lost pairs these back.
  void restore() {
    const std::vector<Index> lost = fetched(lost_);
    const Model& model = m_.model();
    std::vector<WholePhyxel> whole;
    for (std::size_t place = 0; place < lost.size(); ++place) {
      if (lost[place] == 0) continue;
      const Index i = m_.tiling().phyxel[place];
      WholePhyxel phyxel{static_cast<Index>(place), {}, {}};
      phyxel.moments.inverse.matrix = model.inverse_moment[i];
      phyxel.moments.offset = model.moment_offset[i];
      if (!model.closing.empty()) phyxel.closing = model.closing[i];
      whole.push_back(phyxel);
    }
    if (whole.empty()) return;
    const auto copy = [&](const DeviceArray<std::uint16_t>& entries,
                          const DeviceArray<std::uint16_t>& from) {
      PHYXEL_CUDA(cudaMemcpyAsync(entries.data(), from.data(), from.bytes(),
                                  cudaMemcpyDeviceToDevice, m_.stream()));
    };
    copy(m_.tiling().neighbours.entries, whole_);
    if (m_.tiling().inverse) copy(m_.tiling().inverse->entries, second_whole_);
    const DeviceArray<WholePhyxel> phyxels = sent(whole, name);
    const auto count = static_cast<int>(whole.size());
    m_.launch_each("make_whole", make_whole<Real>, count, view(), phyxels.data(), count);
    // Forces of cracks that are closed no more.
    PHYXEL_CUDA(cudaMemsetAsync(m_.fields().pull, 0, 3 * m_.places() * sizeof(Real), m_.stream()));
    m_.wait();
  }
  /// Breaks the pairs of a state from phyxels that have lost none.
  void cut(const BrokenPairs& next, std::span<const WornPhyxel> worn) {
    std::unordered_map<Index, double> carried;
    for (const WornPhyxel& phyxel : worn) carried.emplace(phyxel.phyxel, phyxel.carried);
    std::vector<CutPair> pairs;
    std::vector<TornPhyxel> torn;
    for (const Index i : next.phyxels()) {
      const Index place = m_.tiling().place[i];
      for (const Index j : next.of(i)) pairs.push_back({place, m_.tiling().place[j]});
      const auto found = carried.find(m_.model().global_id(i));
      torn.push_back({place, found == carried.end() ? 1 : found->second});
    }
    if (torn.empty()) return;
    const DeviceArray<CutPair> cuts = sent(pairs, name);
    const DeviceArray<TornPhyxel> phyxels = sent(torn, name);
    m_.launch_each("cut_pairs", cut_pairs<Real>, static_cast<int>(pairs.size()), view(),
                   cuts.data(), static_cast<int>(pairs.size()));
    m_.launch_each("remake_torn", remake_torn<Real, StateReal>, static_cast<int>(torn.size()),
                   m_.fields(), view(), phyxels.data(), static_cast<int>(torn.size()));
    m_.wait();
  }
  DeviceModel<Real, StateReal>& m_;
  std::optional<CrackFaces> faces_;
  DeviceArray<std::uint16_t> whole_, second_whole_;
  DeviceArray<BreakingPart> parts_;
  DeviceArray<Index> part_of_tile_;
  DeviceArray<double> volume_;
  DeviceArray<Real> growth_;
  DeviceArray<double> carried_;
  DeviceArray<Index> lost_;
  DeviceArray<char> lost_in_tile_;
  DeviceArray<double> closed_;  // forces of closed cracks [N], shape [3, places]
  // Of models whose pairs may break in steps.
  DeviceArray<Real> displacement_[2];  // at both ends of a step
  int parity_ = 0;                     // number of the one at the start of the next step
  DeviceArray<MotionBox<Real>> boxes_;
  DeviceArray<Vec3<double>> omega_;
  DeviceArray<Index> neighbours_, first_neighbour_;
  DeviceArray<TileWatch> watch_;
  DeviceArray<Index> samples_, first_sample_;
  DeviceSums taken_;
  std::int64_t looks_ = 0;  // steps so far
};

}  // namespace phyxel::cuda
