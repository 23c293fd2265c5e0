/// NVIDIA's NCCL: messages between GPUs in the order of a stream, within a host and between hosts.
/// The library is loaded on first use, so that the program starts where it is not installed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

struct ncclComm;
struct CUstream_st;

namespace phyxel::cuda {

/// The version of NCCL, e.g. "2.28.9"; without it "no NCCL: " and the reason.
std::string nccl_version();
/// True if NCCL can be used.
bool has_nccl();

/// An NCCL communicator of ranks with one GPU each.
class NcclRanks {
 public:
  /// The id of a communicator, which one rank makes for all.
  using Name = std::array<std::int64_t, 16>;
  /// Makes an id. @throws DeviceError
  static Name make_name();

  /// Connects the current device. Collective. @throws DeviceError, in particular if ranks share a
  /// GPU
  NcclRanks(const Name& name, int rank, int count);
  NcclRanks(const NcclRanks&) = delete;
  NcclRanks& operator=(const NcclRanks&) = delete;
  ~NcclRanks();

  struct Message {
    int rank;
    std::span<std::byte> bytes;  ///< In device memory.
  };
  /// Queues messages to and from other ranks, which must queue the matching ones.
  void exchange(std::span<const Message> outgoing, std::span<const Message> incoming,
                CUstream_st* stream) const;

 private:
  ncclComm* ranks_ = nullptr;
};

}  // namespace phyxel::cuda
