// Compiled without fused multiplications, so that sums are those of the CPU.
#include <algorithm>
#include <optional>
#include <utility>

#include "device.hpp"
#include "exact_sum.hpp"
#include "model/closing_search.hpp"
#include "model/ghosts.hpp"
#include "phyxel/error.hpp"
#include "rank_sums.hpp"
#include "setup/closing.hpp"
#include "setup/device_neighbours.cuh"
#include "sort_unique.hpp"

namespace phyxel::cuda {
namespace {

using closing::Bodies;
using closing::Body;
using closing::Standing;

constexpr int closing_threads = 128;
/// Sums that the threads of a block share out among them, so that few add to the same words.
constexpr int closing_copies = 8;
/// Number of blocks that keep a GPU busy.
constexpr std::int64_t many_blocks = 4096;

/// Three numbers that are added and multiplied as the lanes of a vector register are.
struct alignas(16) DeviceLanes {
  double x, y, z, none;

  PHYXEL_HD double operator[](int r) const { return r == 0 ? x : r == 1 ? y : z; }
  PHYXEL_HD friend DeviceLanes operator+(DeviceLanes a, DeviceLanes b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z, 0};
  }
  PHYXEL_HD friend DeviceLanes operator-(DeviceLanes a, DeviceLanes b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z, 0};
  }
  PHYXEL_HD friend DeviceLanes operator*(DeviceLanes a, double s) {
    return {a.x * s, a.y * s, a.z * s, 0};
  }
  PHYXEL_HD friend DeviceLanes operator*(double s, DeviceLanes a) { return a * s; }
  PHYXEL_HD DeviceLanes& operator+=(DeviceLanes b) { return *this = *this + b; }
};

/// Phyxels [begin, end) of one body, which a block takes.
struct Stretch {
  Index body, begin, end;
};

template <class Each>
__global__ void visit_stretches(const Stretch* stretches, const Standing* bodies, Each each) {
  const Stretch stretch = stretches[blockIdx.x];
  const Standing& body = bodies[stretch.body];
  for (Index i = stretch.begin + static_cast<Index>(threadIdx.x); i < stretch.end;
       i += closing_threads) {
    each(body, i);
  }
}

/// Adds term(body, i) to the words of the sum of its body.
template <class Term>
__global__ void sum_stretches(const Stretch* stretches, const Standing* bodies,
                              unsigned long long* sums, Term term) {
  __shared__ unsigned long long words[closing_copies][ExactSum::words];
  for (int w = static_cast<int>(threadIdx.x); w < closing_copies * ExactSum::words;
       w += closing_threads) {
    words[0][w] = 0;
  }
  __syncthreads();
  const Stretch stretch = stretches[blockIdx.x];
  const Standing& body = bodies[stretch.body];
  unsigned long long* const own = words[threadIdx.x % closing_copies];
  for (Index i = stretch.begin + static_cast<Index>(threadIdx.x); i < stretch.end;
       i += closing_threads) {
    const double value = term(body, i);
    if (value == 0) continue;
    ExactSum::split(value, [&](int word, std::int64_t number) {
      if (number != 0) atomicAdd(own + word, static_cast<unsigned long long>(number));
    });
  }
  __syncthreads();
  for (int w = static_cast<int>(threadIdx.x); w < ExactSum::words; w += closing_threads) {
    unsigned long long all = 0;
    for (int copy = 0; copy < closing_copies; ++copy) all += words[copy][w];
    if (all != 0)
      atomicAdd(sums + static_cast<std::size_t>(stretch.body) * ExactSum::words + w, all);
  }
}

/// `moments_of` phyxel i, whose neighbours are listed in the order of global ids.
__device__ Moments moments_in_order(const NeighbourSource& near, Index i) {
  return moments_by(near, i, [&](auto&& visit) { near.visit(i, visit); });
}

/// The loops and vectors of the search on a device (see `closing::HostLoops`).
class DeviceLoops {
 public:
  template <class T>
  using Vector = DeviceArray<T>;
  template <class T>
  using Input = DeviceArray<T>;

  DeviceLoops(const Model& model, const Bodies& bodies)
      : model_(model),
        what_("closed gradients of " + std::to_string(model.size()) + " phyxels"),
        near_(neighbours_of(model)) {
    if (model.share) find_halo();
    if (model.has_lists()) {
      inverse_moment_ = sent(model.inverse_moment, what_);
      moment_offset_ = sent(model.moment_offset, what_);
    } else {
      find_lists(bodies);
    }
  }

  closing::Neighbourhoods neighbourhoods() const {
    return {near_.position.data(),      near_.support.data(),   near_.lists.offsets.data(),
            near_.lists.indices.data(), inverse_moment_.data(), moment_offset_.data()};
  }
  template <class T>
  Input<T> input(const std::vector<T>& values) const {
    return sent(values, what_);
  }
  template <class T>
  Vector<T> vector(const std::vector<T>& values) const {
    return sent(values, what_);
  }
  template <class T>
  Vector<T> make(std::size_t width = 1, std::size_t more = 0) const {
    Vector<T> values(static_cast<std::size_t>(model_.size()) * width + more, what_);
    values.clear();
    return values;
  }
  template <class T>
  std::vector<T> fetched(const Vector<T>& values) const {
    return cuda::fetched(values);
  }

  PHYXEL_HD static Vec3d terms(const closing::Gathers& gathers, Index j, closing::Row neighbours,
                               const RowWeights& weights, Vec3d start) {
    return gathers.terms<DeviceLanes>(j, neighbours, weights, start);
  }
  PHYXEL_HD static closing::Differences differences(const closing::Gathers& gathers, Index j,
                                                    closing::Row neighbours,
                                                    const RowWeights& weights) {
    return gathers.differences<DeviceLanes>(j, neighbours, weights);
  }

  template <class Each>
  void for_each(const Bodies& bodies, const Each& each) const {
    visit(own_, bodies, each);
  }
  template <class Each>
  void for_each_with_ghosts(const Bodies& bodies, const Each& each) const {
    visit(all_, bodies, each);
  }
  template <class Term>
  void sum(const Bodies& bodies, double Standing::*into, const Term& term) const {
    std::vector<ExactSum> sums(bodies.size());
    const Stretches& stretches = of(own_, bodies);
    const DeviceArray<unsigned long long> words(sums.size() * ExactSum::words, what_);
    words.clear();
    if (stretches.count > 0) {
      sum_stretches<<<stretches.count, closing_threads>>>(
          stretches.list.data(), standing(bodies).data(), words.data(), term);
      check_launch({"sum_stretches", stretches.count, closing_threads, what_});
    }
    const std::vector<unsigned long long> found = cuda::fetched(words);
    for (std::size_t b = 0; b < sums.size(); ++b) {
      std::copy_n(found.begin() + static_cast<std::ptrdiff_t>(b) * ExactSum::words, ExactSum::words,
                  sums[b].ready().begin());
    }
    add_over_ranks(model_, sums);
    for (std::size_t b = 0; b < bodies.size(); ++b) bodies[b].*into = sums[b].value();
  }
  template <class T>
  void refresh_ghosts(const Bodies& bodies, Vector<T>& values) const {
    if (!model_.share || bodies.empty()) return;
    const Index begin = bodies[0].begin(), end = bodies[bodies.size() - 1].end();
    std::vector<T> here(values.size());
    copy_out(values, begin, end, here);
    phyxel::refresh_ghosts(*model_.share, here, begin, end);
    copy_in(here, begin, end, values);
  }

 private:
  void find_halo() {
    std::vector<Index> send, ghosts;
    for (const HaloPlan::Peer& peer : model_.share->halo->peers) {
      send.insert(send.end(), peer.send.begin(), peer.send.end());
    }
    sort_unique(send);
    for (Index i = 0; i < model_.size(); ++i) {
      if (!model_.owns(i)) ghosts.push_back(i);
    }
    sent_ = Halves(std::move(send));
    received_ = Halves(std::move(ghosts));
  }

  /// Ascending phyxels, on both sides.
  struct Halves {
    Halves() = default;
    explicit Halves(std::vector<Index> list)
        : on_host(std::move(list)), on_device(sent(on_host, "ghosts")) {}
    std::vector<Index> on_host;
    DeviceArray<Index> on_device;
    /// Calls use(first, count) for those in [begin, end), unless there are none.
    template <class Use>
    void within(Index begin, Index end, Use&& use) const {
      const auto first = std::lower_bound(on_host.begin(), on_host.end(), begin);
      const auto last = std::lower_bound(first, on_host.end(), end);
      if (first != last) use(first - on_host.begin(), last - first);
    }
  };
  /// What blocks take of bodies.
  struct Stretches {
    explicit Stretches(bool ghosts) : with_ghosts(ghosts) {}
    bool with_ghosts;
    std::optional<Bodies> bodies;
    DeviceArray<Stretch> list;
    unsigned count = 0;
  };

  /// Copies the values that others need of phyxels [begin, end) to the host.
  template <class T>
  void copy_out(const Vector<T>& values, Index begin, Index end, std::vector<T>& here) const {
    sent_.within(begin, end, [&](std::ptrdiff_t first, std::ptrdiff_t count) {
      const DeviceArray<T> packed(static_cast<std::size_t>(count), what_);
      gather(values.data(), sent_.on_device.data() + first, count, packed.data());
      const std::vector<T> fetched = cuda::fetched(packed);
      for (std::ptrdiff_t k = 0; k < count; ++k) here[sent_.on_host[first + k]] = fetched[k];
    });
  }
  /// Copies the values of ghosts in [begin, end) to the device.
  template <class T>
  void copy_in(const std::vector<T>& here, Index begin, Index end, Vector<T>& values) const {
    received_.within(begin, end, [&](std::ptrdiff_t first, std::ptrdiff_t count) {
      std::vector<T> packed(static_cast<std::size_t>(count));
      for (std::ptrdiff_t k = 0; k < count; ++k) packed[k] = here[received_.on_host[first + k]];
      const DeviceArray<T> on_device = sent(packed, what_);
      scatter(on_device.data(), received_.on_device.data() + first, count, values.data());
      PHYXEL_CUDA(cudaDeviceSynchronize());
    });
  }

  template <class Each>
  void visit(Stretches& kept, const Bodies& bodies, const Each& each) const {
    const Stretches& stretches = of(kept, bodies);
    if (stretches.count == 0) return;
    visit_stretches<<<stretches.count, closing_threads>>>(stretches.list.data(),
                                                          standing(bodies).data(), each);
    check_launch({"visit_stretches", stretches.count, closing_threads, what_});
  }

  /// The numbers of bodies, on the device.
  const DeviceArray<Standing>& standing(const Bodies& bodies) const {
    std::vector<Standing> all;
    for (const Body* body : bodies) all.push_back(*body);
    if (standing_.size() != all.size()) standing_ = {all.size(), what_};
    standing_.upload(all.data());
    return standing_;
  }
  const Stretches& of(Stretches& kept, const Bodies& bodies) const {
    if (kept.bodies == bodies) return kept;
    const auto end_of = [&](const Part& part) {
      return kept.with_ghosts ? part.end : part.owned_end();
    };
    std::int64_t phyxels = 0;
    for (const Body* body : bodies) {
      for (const Part& part : body->parts) phyxels += end_of(part) - part.begin;
    }
    const std::int64_t turns = phyxels / (many_blocks * closing_threads) + 1;
    const auto length = static_cast<Index>(closing_threads * turns);
    std::vector<Stretch> list;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      for (const Part& part : bodies[b].parts) {
        const Index end = end_of(part);
        for (Index begin = part.begin; begin < end; begin += std::min(length, end - begin)) {
          list.push_back({static_cast<Index>(b), begin, begin + std::min(length, end - begin)});
        }
      }
    }
    kept.list = sent(list, what_);
    kept.count = static_cast<unsigned>(list.size());
    kept.bodies = bodies;
    return kept;
  }

 public:
  /// Makes the lists of own phyxels and their moments; ghosts get those of their owners.
  void find_lists(const Bodies& bodies) {
    DeviceArray<Index> global_id;
    DeviceArray<char> owned;
    if (model_.share) {
      global_id = sent(model_.share->global_id, what_);
      owned = sent(model_.share->owned, what_);
    }
    near_.lists = rows_of(near_.near(), model_.size(), owned.data(), global_id.data(), what_);
    near_.table.reset();
    inverse_moment_ = make<Sym3d>();
    moment_offset_ = make<Vec3d>();
    cuda::for_each("moments", model_.size(),
                   [near = near_.near(), inverse_moment = inverse_moment_.data(),
                    moment_offset = moment_offset_.data()] __device__(std::int64_t k) {
                     const auto i = static_cast<Index>(k);
                     const Moments found = moments_in_order(near, i);
                     inverse_moment[i] = pseudo_inverse(found.moment).matrix;
                     moment_offset[i] = found.offset;
                   });
    refresh_ghosts(bodies, inverse_moment_);
    refresh_ghosts(bodies, moment_offset_);
  }

  template <class T>
  static void gather(const T* from, const Index* which, std::int64_t count, T* to) {
    cuda::for_each("gather", count, [=] __device__(std::int64_t k) { to[k] = from[which[k]]; });
  }
  template <class T>
  static void scatter(const T* from, const Index* which, std::int64_t count, T* to) {
    cuda::for_each("scatter", count, [=] __device__(std::int64_t k) { to[which[k]] = from[k]; });
  }

 private:
  const Model& model_;
  std::string what_;
  Neighbours near_;
  DeviceArray<Sym3d> inverse_moment_;
  DeviceArray<Vec3d> moment_offset_;
  Halves sent_, received_;
  mutable DeviceArray<Standing> standing_;
  mutable Stretches own_{false}, all_{true};
};

/// True if the device has room for a search, on all ranks, which may share a device.
bool has_room(const Model& model) {
  const std::size_t per_phyxel = sizeof(Vec3d) * 5 + sizeof(Sym3d) +
                                 sizeof(double) * (4 + closing::Gathers::term_size) +
                                 sizeof(Offset) + 3 + 3 * sizeof(closing::Unknown) + sizeof(Vec3d);
  const auto phyxels = static_cast<std::size_t>(model.size());
  // A share with a search of its own has about as many pairs as the whole, phyxel by phyxel.
  const std::size_t pairs =
      model.has_lists()
          ? model.neighbourhood.neighbours.indices.size()
          : static_cast<std::size_t>(1.1 * static_cast<double>(model.pairs()) *
                                     static_cast<double>(phyxels) /
                                     static_cast<double>(std::max(1, model.global_count())));
  const std::size_t bytes = phyxels * per_phyxel + pairs * sizeof(Index) + (std::size_t{64} << 20);
  DeviceArray<char> room;
  bool fits = true;
  try {
    room = {bytes, "closed gradients"};
  } catch (const DeviceError&) {
    cudaGetLastError();
    fits = false;
  }
  return model.share ? model.share->communicator->smallest(fits ? 1.0 : 0.0) == 1 : fits;
}

}  // namespace
}  // namespace phyxel::cuda

namespace phyxel {

ClosingSearch cuda_closing_search(int device) {
  return [device](const Model& model, const closing::Bodies& bodies,
                  const std::vector<Vec3d>& areas) {
    use_cuda_device(device);
    if (!cuda::has_room(model)) {
      if (model.has_lists()) return search_on_host(model, bodies, areas);
      throw DeviceError("the memory of GPU " + std::to_string(device) +
                        " has no room to close the gradients of " + std::to_string(model.size()) +
                        " phyxels; allowed: fewer phyxels, more GPUs, the CPU, or closure = 0");
    }
    const cuda::DeviceLoops loops(model, bodies);
    return closing::Search<cuda::DeviceLoops>(loops, model, bodies, areas).run();
  };
}

}  // namespace phyxel
