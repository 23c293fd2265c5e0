/// NVIDIA's NCCL: messages between GPUs in the order of a stream, within a host and between hosts.
/// Loaded when it is first asked for, so that the program starts where it is not installed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

struct ncclComm;
struct CUstream_st;

namespace phyxel::cuda {

/// "2.28.9", or "no NCCL: " and why.
std::string nccl_version();
/// Whether it can be used here.
bool has_nccl();

/// Ranks that have a GPU each and send each other messages.
class NcclRanks {
 public:
  /// The same on all ranks; one of them makes it.
  using Name = std::array<std::int64_t, 16>;
  /// @throws DeviceError
  static Name make_name();

  /// For the current device. Collective. @throws DeviceError, above all where ranks share a GPU
  NcclRanks(const Name& name, int rank, int count);
  NcclRanks(const NcclRanks&) = delete;
  NcclRanks& operator=(const NcclRanks&) = delete;
  ~NcclRanks();

  struct Message {
    int rank;
    std::span<std::byte> bytes;  ///< In device memory.
  };
  /// Queues messages to and from other ranks, who queue theirs.
  void exchange(std::span<const Message> outgoing, std::span<const Message> incoming,
                CUstream_st* stream) const;

 private:
  ncclComm* ranks_ = nullptr;
};

}  // namespace phyxel::cuda
