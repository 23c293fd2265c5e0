/// Resident bodies, which stay in the shared memory of multiprocessors for many steps per launch.
#pragma once

#include <array>
#include <memory>
#include <string>

#include "solver/device_model.cuh"
#include "solver/resident.cuh"

namespace phyxel::cuda {

template <class Real, class StateReal>
class Residence {
 public:
  /// Largest number of steps per launch.
  static constexpr int most_steps = 256;

  /// The residence of a model, and the reason for or against it.
  struct Attempt {
    std::unique_ptr<Residence> residence;  ///< Null if the model cannot be resident.
    std::string reason;
  };
  /// Makes a model resident if each body fits a cluster, or all bodies fit at once.
  static Attempt of(const DeviceModel<Real, StateReal>& model) {
    std::unique_ptr<Residence> residence(new Residence(model));
    std::string reason = residence->make();
    if (!residence->kernel_) residence.reset();
    return {std::move(residence), std::move(reason)};
  }

  /// Description of the launches, for messages.
  std::string describe() const {
    return cluster_ ? "resident, clusters of " + std::to_string(cluster_)
                    : "resident, " + std::to_string(slices_.size()) + " blocks";
  }
  std::size_t bytes() const {
    return slices_.bytes() + slice_of_block_.bytes() + place_.bytes() + pairs_.bytes() +
           weights_.bytes() + destinations_.bytes() + displacements_.bytes() + stresses_.bytes();
  }

  void launch(double dt, int steps, Trail<Real, StateReal> trail = {}) {
    if (next_tag_ > 0xF000'0000U) clear_mailboxes();
    Fields<Real, StateReal> fields = m_.fields();
    auto step = static_cast<StateReal>(dt);
    unsigned tag = std::exchange(next_tag_, next_tag_ + 2 * static_cast<unsigned>(steps) + 1);
    void* arguments[] = {&fields, &view_, &step, &steps, &trail, &tag};
    const LaunchOf launch(*this);
    PHYXEL_CUDA(cudaLaunchKernelExC(&launch.config, kernel_, arguments));
    m_.launched("resident_steps", blocks_, threads_);
  }

 private:
  static constexpr int most_cluster_blocks = 16;  // on GPUs that have clusters

  explicit Residence(const DeviceModel<Real, StateReal>& model) : m_(model) {}

  /// Allocates the data of launches, or leaves `kernel_` null. @returns the reason of the outcome
  std::string make() {
    constexpr Index most_places = 1 << 18;  // far more than any GPU can hold
    const DeviceTiling& on_device = m_.tiling();
    if (m_.size() == 0) return "there are no phyxels";
    const std::string too_large =
        "neighbours of " + m_.subject() + " do not fit the GPU's shared memory";
    if (on_device.places() > most_places || !may_fit()) return too_large;
    const ResidentPlan plan = make_resident_plan(fetched_tiling(on_device));
    if (!fits_clusters(plan) && !fits_at_once(plan)) {
      kernel_ = nullptr;
      return too_large;
    }

    const std::string what = "what stays in shared memory of " + m_.subject();
    slices_ = sent(plan.slices, what);
    place_ = sent(plan.place, what);
    weigh(plan, what);
    destinations_ = sent(plan.destinations, what);
    std::vector<int> slice_of_block(blocks_, -1);
    for (int s = 0; s < static_cast<int>(plan.slices.size()); ++s) {
      slice_of_block[cluster_ ? plan.slices[s].body * cluster_ + plan.slices[s].rank : s] = s;
    }
    slice_of_block_ = sent(slice_of_block, what);
    if (!cluster_) {
      displacements_ = {displacement_packets<Real> * m_.places(), what};
      stresses_ = {stress_packets_each() * m_.places(), what};
    }
    view_ = {slices_.data(),
             place_.data(),
             pairs_.data(),
             weights_.data(),
             destinations_.data(),
             slice_of_block_.data(),
             displacements_.data(),
             stresses_.data(),
             plan.most_slots,
             plan.most_destinations,
             {plan.longest[0], second_longest(plan)}};
    clear_mailboxes();
    return cluster_ ? "each body fits the shared memory of a cluster"
                    : "all bodies fit the GPU's shared memory at once";
  }
  void weigh(const ResidentPlan& plan, const std::string& what) {
    constexpr unsigned threads = 256;
    const DeviceArray<std::uint16_t> entries = sent(plan.entries, what);
    pairs_ = {plan.entries.size(), what};
    if (kept_weights() != KeptWeights::none) weights_ = {plan.entries.size(), what};
    const auto slices = static_cast<unsigned>(plan.slices.size());
    const auto kernel =
        m_.pairwise() ? weigh_pairs<Real, StateReal, true> : weigh_pairs<Real, StateReal, false>;
    kernel<<<slices, threads, 0, m_.stream()>>>(m_.fields(), slices_.data(), place_.data(),
                                                entries.data(), m_.tiling().inverse ? 2 : 1,
                                                pairs_.data(), weights_.data());
    m_.launched("weigh_pairs", slices, threads);
    m_.wait();
  }
  /// Quick check before a plan is made, which takes time.
  bool may_fit() const {
    const bool in_clusters =
        std::all_of(m_.model().parts.begin(), m_.model().parts.end(), [&](const Part& part) {
          Index slices = 0;
          for (const Part& beside : m_.model().parts_of_body(part)) {
            slices += (beside.end - beside.begin + slice_size - 1) / slice_size;
          }
          return slices <= most_cluster_blocks;
        });
    const std::size_t shared = static_cast<std::size_t>(m_.device().multiprocessors) *
                               static_cast<std::size_t>(m_.most_shared_memory());
    return in_clusters ||
           static_cast<std::size_t>(m_.model().pairs()) * sizeof(Pair<Real>) <= shared;
  }
  bool hourglass() const { return m_.fields().pull; }
  KeptWeights kept_weights() const {
    return m_.closed()   ? KeptWeights::both_passes
           : hourglass() ? KeptWeights::first_pass
                         : KeptWeights::none;
  }
  int stress_packets_each() const {
    return m_.closed() ? stress_packets<Real, true> : stress_packets<Real, false>;
  }
  int second_longest(const ResidentPlan& plan) const {
    return m_.tiling().inverse ? plan.longest[1] : 0;
  }
  template <class Channel>
  void use_channel(const ResidentPlan& plan) {
    kernel_ = m_.closed() ? m_.has_history() ? kernel<Channel, AnyLawWithHistory, WithClosing>()
                                             : kernel<Channel, AnyLaw, WithClosing>()
                          : kernel_without_closing<Channel>();
    threads_ = Channel::threads;
    shared_bytes_ = ResidentMemory<Real>::bytes(
        plan.most_slots, plan.longest[0], second_longest(plan), stress_packets_each(),
        kept_weights(), Channel::bytes(plan.most_slots, plan.most_destinations));
  }
  template <class Channel, class Law, class Terms>
  static const void* kernel() {
    return reinterpret_cast<const void*>(resident_steps<Real, StateReal, Channel, Law, Terms>);
  }
  template <class Channel>
  const void* kernel_without_closing() const {
    // Only the default law and the paper's have a kernel without hourglass control; that of every
    // other law includes it, with κ = 0.
    const auto kernel_of = [&]<class Law>(std::type_identity<Law>) {
      constexpr bool common =
          std::is_same_v<Law, StVenantKirchhoff<Real>> || std::is_same_v<Law, NeoHookean<Real>>;
      using Fewest = std::conditional_t<common, NoPairTerms, WithHourglass>;
      return hourglass() ? kernel<Channel, Law, WithHourglass>() : kernel<Channel, Law, Fewest>();
    };
    const auto& parts = m_.model().parts;
    const int law = chosen_law(parts.front().material).index;
    const auto is_alike = [&](const Part& part) {
      return chosen_law(part.material).index == law && !(part.material.viscosity > 0);
    };
    if (std::all_of(parts.begin(), parts.end(), is_alike)) {
      return Laws::with_type<Real>(law, kernel_of);
    }
    return m_.has_history() ? kernel_of(std::type_identity<AnyLawWithHistory>{})
                            : kernel_of(std::type_identity<AnyLaw>{});
  }
  /// True if clusters fit: one per body, with as many blocks as the largest body has slices.
  bool fits_clusters(const ResidentPlan& plan) {
    if (m_.device().major < 9) return false;
    use_channel<ClusterChannel<Real>>(plan);
    const auto blocks = static_cast<std::size_t>(plan.bodies) * plan.most_slices;
    // Bodies of very different sizes would leave most blocks idle.
    if (plan.most_slices > most_cluster_blocks || blocks > 2 * plan.slices.size() ||
        shared_bytes_ > m_.most_shared_memory()) {
      return false;
    }
    cluster_ = plan.most_slices;
    blocks_ = static_cast<unsigned>(blocks);
    m_.allow_shared_memory(kernel_);
    PHYXEL_CUDA(cudaFuncSetAttribute(kernel_, cudaFuncAttributeNonPortableClusterSizeAllowed, 1));
    const LaunchOf launch(*this);
    int clusters = 0;
    const cudaError_t error = cudaOccupancyMaxActiveClusters(&clusters, kernel_, &launch.config);
    if (error != cudaSuccess) cudaGetLastError();  // too large for this GPU: clears the error
    return error == cudaSuccess && clusters > 0;
  }
  bool fits_at_once(const ResidentPlan& plan) {
    use_channel<MailboxChannel<Real>>(plan);
    cluster_ = 0;
    blocks_ = static_cast<unsigned>(plan.slices.size());
    if (shared_bytes_ > m_.most_shared_memory()) return false;
    m_.allow_shared_memory(kernel_);
    int blocks_each = 0;
    PHYXEL_CUDA(cudaOccupancyMaxActiveBlocksPerMultiprocessor(
        &blocks_each, kernel_, static_cast<int>(threads_), shared_bytes_));
    return blocks_ <= static_cast<unsigned>(blocks_each * m_.device().multiprocessors);
  }

  /// A launch of all blocks. CUDA keeps a pointer to the attributes.
  struct LaunchOf {
    cudaLaunchAttribute attributes[2];
    cudaLaunchConfig_t config{};

    explicit LaunchOf(const Residence& r) {
      config.gridDim = r.blocks_;
      config.blockDim = r.threads_;
      config.dynamicSmemBytes = static_cast<std::size_t>(r.shared_bytes_);
      config.stream = r.m_.stream();
      config.attrs = attributes;
      config.numAttrs = 1;
      if (r.cluster_) {
        attributes[0].id = cudaLaunchAttributeClusterDimension;
        attributes[0].val.clusterDim = {static_cast<unsigned>(r.cluster_), 1, 1};
        attributes[1] = r.m_.overlap_attribute();
        config.numAttrs = 2;
      } else {
        attributes[0].id = cudaLaunchAttributeCooperative;
        attributes[0].val.cooperative = 1;
      }
    }
    LaunchOf(const LaunchOf&) = delete;
    LaunchOf& operator=(const LaunchOf&) = delete;
  };

  void clear_mailboxes() {
    next_tag_ = 1;
    for (const DeviceArray<Packet>* boxes : {&displacements_, &stresses_}) {
      if (boxes->bytes() == 0) continue;
      PHYXEL_CUDA(cudaMemsetAsync(boxes->data(), 0, boxes->bytes(), m_.stream()));
    }
  }

  const DeviceModel<Real, StateReal>& m_;
  const void* kernel_ = nullptr;
  int cluster_ = 0;  // blocks per cluster; 0 with mailboxes
  unsigned blocks_ = 0, threads_ = 0;
  int shared_bytes_ = 0;
  unsigned next_tag_ = 1;  // of packets in mailboxes
  DeviceArray<Slice> slices_;
  DeviceArray<int> slice_of_block_;
  DeviceArray<Index> place_;
  DeviceArray<Pair<Real>> pairs_;
  DeviceArray<Real> weights_;
  DeviceArray<std::uint32_t> destinations_;
  DeviceArray<Packet> displacements_, stresses_;
  ResidentView<Real> view_{};
};

}  // namespace phyxel::cuda
