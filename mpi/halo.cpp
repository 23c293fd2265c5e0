#include "mpi/halo.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>

#include "parallel_sort.hpp"
#include "tabulated.hpp"
#include "timeline.hpp"

namespace phyxel {

Halo::Halo(const Communicator& ranks, const ModelShare& share)
    : ranks_(ranks), transfers_(ranks, Tag::halo) {
  const std::vector<Index>& number = share.share.number;
  const auto each = static_cast<std::size_t>(ranks.size());
  std::vector<std::vector<Index>> ghosts(each), wanted(each);  // here; their numbers
  const auto size = static_cast<Index>(number.size());
  for (const Index i : chosen(0, size, [&](Index i) { return share.owner[i] != ranks.rank(); })) {
    ghosts[share.owner[i]].push_back(i);
  }
  const auto by_number = [&](Index a, Index b) { return number[a] < number[b]; };
  for (std::size_t r = 0; r < each; ++r) {
    std::sort(ghosts[r].begin(), ghosts[r].end(), by_number);
    for (const Index i : ghosts[r]) wanted[r].push_back(number[i]);
  }
  std::vector<Index> own = chosen(0, size, [&](Index i) { return share.owner[i] == ranks.rank(); });
  parallel_sort(own, by_number);
  const std::vector<std::vector<Index>> asked = ranks.exchanged(wanted);
  for (std::size_t r = 0; r < each; ++r) {
    if (ghosts[r].empty() && asked[r].empty()) continue;
    Peer& peer = peers_.emplace_back();
    peer.rank = static_cast<int>(r);
    peer.same_host = ranks.host_of(peer.rank) == ranks.host_of(ranks.rank());
    peer.receive = ghosts[r];
    for (const Index n : asked[r]) {
      peer.send.push_back(
          *std::lower_bound(own.begin(), own.end(), n,
                            [&](Index i, Index wanted_one) { return number[i] < wanted_one; }));
    }
  }
  packed_->outgoing.resize(peers_.size());
  packed_->incoming.resize(peers_.size());
  transfers_.keep(packed_);
}

std::vector<std::vector<std::byte>> Halo::told(
    const std::vector<std::vector<std::byte>>& words) const {
  std::vector<std::vector<std::byte>> by_rank(static_cast<std::size_t>(ranks_.size())), heard;
  for (std::size_t p = 0; p < peers_.size(); ++p) by_rank[peers_[p].rank] = words[p];
  by_rank = ranks_.exchanged(by_rank);
  for (const Peer& peer : peers_) heard.push_back(std::move(by_rank[peer.rank]));
  return heard;
}

namespace {

/// Adds the time until it ends.
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

void Halo::begin(const Bytes& outgoing, const Bytes& incoming) const {
  const Timed timed(traffic_.seconds);
  for (std::size_t p = 0; p < peers_.size(); ++p) {
    transfers_.receive(peers_[p].rank, incoming[p]);
  }
  for (std::size_t p = 0; p < peers_.size(); ++p) {
    transfers_.send(peers_[p].rank, outgoing[p]);
    traffic_.bytes_sent += static_cast<std::int64_t>(outgoing[p].size());
  }
}

void Halo::begin(const Records& records) const {
  {
    const Phase phase("packing");
    const Timed timed(traffic_.seconds);
    under_way_ = records;
    for (std::size_t p = 0; p < peers_.size(); ++p) {
      packed_->incoming[p].resize(peers_[p].receive.size() * records.bytes);
      packed_->outgoing[p].resize(peers_[p].send.size() * records.bytes);
      std::byte* to = packed_->outgoing[p].data();
      for (const Index i : peers_[p].send) {
        std::memcpy(to, records.of(i), records.bytes);
        to += records.bytes;
      }
    }
  }
  begin(Bytes(packed_->outgoing.begin(), packed_->outgoing.end()),
        Bytes(packed_->incoming.begin(), packed_->incoming.end()));
}

void Halo::finish() const {
  const Timed timed(traffic_.seconds);
  {
    const Phase phase("waiting for other ranks");
    transfers_.wait();
  }
  if (!under_way_.base) return;
  for (std::size_t p = 0; p < peers_.size(); ++p) {
    const std::byte* from = packed_->incoming[p].data();
    for (const Index i : peers_[p].receive) {
      std::memcpy(under_way_.of(i), from, under_way_.bytes);
      from += under_way_.bytes;
    }
  }
  under_way_ = {};
}

}  // namespace phyxel
