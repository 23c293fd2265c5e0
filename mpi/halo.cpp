#include "mpi/halo.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>

namespace phyxel {

Halo::Halo(const Communicator& ranks, const ModelShare& share) : ranks_(ranks) {
  const std::vector<Index>& number = share.share.number;
  const auto each = static_cast<std::size_t>(ranks.size());
  std::vector<std::vector<Index>> ghosts(each), wanted(each);  // here; their numbers
  std::vector<std::pair<Index, Index>> own;                    // number, here
  for (Index i = 0; i < static_cast<Index>(number.size()); ++i) {
    const int owner = share.owner[i];
    if (owner == ranks.rank()) {
      own.emplace_back(number[i], i);
    } else {
      ghosts[owner].push_back(i);
    }
  }
  std::sort(own.begin(), own.end());
  for (std::size_t r = 0; r < each; ++r) {
    std::sort(ghosts[r].begin(), ghosts[r].end(),
              [&](Index a, Index b) { return number[a] < number[b]; });
    for (const Index i : ghosts[r]) wanted[r].push_back(number[i]);
  }
  const std::vector<std::vector<Index>> asked = ranks.exchanged(wanted);
  for (std::size_t r = 0; r < each; ++r) {
    if (ghosts[r].empty() && asked[r].empty()) continue;
    Peer& peer = peers_.emplace_back();
    peer.rank = static_cast<int>(r);
    peer.receive = ghosts[r];
    for (const Index n : asked[r]) {
      peer.send.push_back(std::lower_bound(own.begin(), own.end(), std::pair{n, Index{0}})->second);
    }
  }
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

void Halo::begin(const Records& records) const {
  const Timed timed(traffic_.seconds);
  under_way_ = records;
  for (const Peer& peer : peers_) {
    peer.incoming.resize(peer.receive.size() * records.bytes);
    transfers_.receive(peer.rank, peer.incoming);
  }
  for (const Peer& peer : peers_) {
    peer.outgoing.resize(peer.send.size() * records.bytes);
    std::byte* to = peer.outgoing.data();
    for (const Index i : peer.send) {
      std::memcpy(to, records.of(i), records.bytes);
      to += records.bytes;
    }
    transfers_.send(peer.rank, peer.outgoing);
    traffic_.bytes_sent += static_cast<std::int64_t>(peer.outgoing.size());
  }
}

void Halo::finish() const {
  const Timed timed(traffic_.seconds);
  transfers_.wait();
  for (const Peer& peer : peers_) {
    const std::byte* from = peer.incoming.data();
    for (const Index i : peer.receive) {
      std::memcpy(under_way_.of(i), from, under_way_.bytes);
      from += under_way_.bytes;
    }
  }
}

Model connected(const Communicator& ranks, ModelShare share) {
  share.share.others = std::make_shared<Halo>(ranks, share);
  share.model.share = std::make_shared<Share>(std::move(share.share));
  return std::move(share.model);
}

}  // namespace phyxel
