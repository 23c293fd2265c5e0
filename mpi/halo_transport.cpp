#include "mpi/halo_transport.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>

#include "model/following.hpp"
#include "parallel_sort.hpp"
#include "tabulated.hpp"
#include "timeline.hpp"

namespace phyxel {

HaloPlan make_halo_plan(const MpiCommunicator& ranks, const std::vector<int>& owner,
                        const std::vector<Index>& global_id) {
  const auto each = static_cast<std::size_t>(ranks.size());
  std::vector<std::vector<Index>> ghosts(each), wanted(each);  // indices; their global ids
  const auto size = static_cast<Index>(global_id.size());
  for (const Index i : chosen(0, size, [&](Index i) { return owner[i] != ranks.rank(); })) {
    ghosts[owner[i]].push_back(i);
  }
  const auto by_id = [&](Index a, Index b) { return global_id[a] < global_id[b]; };
  for (std::size_t r = 0; r < each; ++r) {
    std::sort(ghosts[r].begin(), ghosts[r].end(), by_id);
    for (const Index i : ghosts[r]) wanted[r].push_back(global_id[i]);
  }
  std::vector<Index> own = chosen(0, size, [&](Index i) { return owner[i] == ranks.rank(); });
  parallel_sort(own, by_id);
  const std::vector<std::vector<Index>> asked = ranks.alltoallv(wanted);
  HaloPlan plan;
  for (std::size_t r = 0; r < each; ++r) {
    if (ghosts[r].empty() && asked[r].empty()) continue;
    HaloPlan::Peer& peer = plan.peers.emplace_back();
    peer.rank = static_cast<int>(r);
    peer.same_host = ranks.host_of(peer.rank) == ranks.host_of(ranks.rank());
    peer.receive = ghosts[r];
    for (const Index id : asked[r]) {
      peer.send.push_back(
          *std::lower_bound(own.begin(), own.end(), id,
                            [&](Index i, Index asked_id) { return global_id[i] < asked_id; }));
    }
  }
  return plan;
}

MpiHaloTransport::MpiHaloTransport(const MpiCommunicator& ranks,
                                   std::shared_ptr<const HaloPlan> plan)
    : plan_(std::move(plan)), transfers_(ranks, Tag::halo) {
  packed_->outgoing.resize(plan_->peers.size());
  packed_->incoming.resize(plan_->peers.size());
  transfers_.keep(packed_);
}

namespace {

/// Adds the time of its scope to a total.
class Timed {
 public:
  explicit Timed(double& seconds) : seconds_(seconds) {}
  ~Timed() {
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

void MpiHaloTransport::start(const PeerBytes& outgoing, const PeerBytes& incoming) {
  const Timed timed(traffic_.seconds);
  const std::vector<HaloPlan::Peer>& peers = plan_->peers;
  for (std::size_t p = 0; p < peers.size(); ++p) transfers_.receive(peers[p].rank, incoming[p]);
  for (std::size_t p = 0; p < peers.size(); ++p) {
    transfers_.send(peers[p].rank, outgoing[p]);
    traffic_.bytes_sent += static_cast<std::int64_t>(outgoing[p].size());
  }
}

void MpiHaloTransport::start(const Records& records) {
  {
    const Phase phase("packing");
    const Timed timed(traffic_.seconds);
    under_way_ = records;
    for (std::size_t p = 0; p < plan_->peers.size(); ++p) {
      const HaloPlan::Peer& peer = plan_->peers[p];
      const std::span<const Index> sent = records.chosen(peer.send);
      packed_->incoming[p].resize(records.chosen(peer.receive).size() * records.bytes);
      packed_->outgoing[p].resize(sent.size() * records.bytes);
      std::byte* to = packed_->outgoing[p].data();
      for (const Index i : sent) {
        std::memcpy(to, records.of(i), records.bytes);
        to += records.bytes;
      }
    }
  }
  start(PeerBytes(packed_->outgoing.begin(), packed_->outgoing.end()),
        PeerBytes(packed_->incoming.begin(), packed_->incoming.end()));
}

void MpiHaloTransport::progress() {
  const Timed timed(traffic_.seconds);
  transfers_.progress();
}

void MpiHaloTransport::finish() {
  const Timed timed(traffic_.seconds);
  {
    const Phase phase("waiting for other ranks");
    transfers_.wait();
  }
  if (!under_way_.base) return;
  for (std::size_t p = 0; p < plan_->peers.size(); ++p) {
    const std::byte* from = packed_->incoming[p].data();
    for (const Index i : under_way_.chosen(plan_->peers[p].receive)) {
      std::memcpy(under_way_.of(i), from, under_way_.bytes);
      from += under_way_.bytes;
    }
  }
  under_way_ = {};
}

void connect(const MpiCommunicator& ranks, ModelShare& made) {
  Share& share = made.share;
  share.communicator = &ranks;
  share.halo = std::make_shared<HaloPlan>(make_halo_plan(ranks, made.owner, share.global_id));
  share.transport = std::make_shared<MpiHaloTransport>(ranks, share.halo);
}

Model model_of(ModelShare&& made) {
  made.model.share = std::make_shared<Share>(std::move(made.share));
  find_following(made.model);
  return std::move(made.model);
}

}  // namespace phyxel
