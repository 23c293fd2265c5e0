#include "solver/nccl.hpp"

#include "phyxel/error.hpp"

#ifdef PHYXEL_HAVE_NCCL

#include <dlfcn.h>
#include <nccl.h>

#include <cstring>
#include <exception>

namespace phyxel::cuda {
namespace {

/// The functions of the installed library.
struct Nccl {
  std::string trouble;  ///< Reason why NCCL is not available; empty if it is.
  decltype(&ncclGetVersion) get_version = nullptr;
  decltype(&ncclGetUniqueId) get_unique_id = nullptr;
  decltype(&ncclCommInitRank) init_rank = nullptr;
  decltype(&ncclCommDestroy) destroy = nullptr;
  decltype(&ncclGroupStart) group_start = nullptr;
  decltype(&ncclGroupEnd) group_end = nullptr;
  decltype(&ncclSend) send = nullptr;
  decltype(&ncclRecv) receive = nullptr;
  decltype(&ncclGetErrorString) error_string = nullptr;

  Nccl() {
    void* library = dlopen("libnccl.so.2", RTLD_NOW | RTLD_LOCAL);
    if (!library) {
      trouble = dlerror();
      return;
    }
    const auto find = [&](auto& function, const char* name) {
      function =
          reinterpret_cast<std::remove_reference_t<decltype(function)>>(dlsym(library, name));
      if (!function) trouble = std::string("it has no ") + name;
    };
    find(get_version, "ncclGetVersion");
    find(get_unique_id, "ncclGetUniqueId");
    find(init_rank, "ncclCommInitRank");
    find(destroy, "ncclCommDestroy");
    find(group_start, "ncclGroupStart");
    find(group_end, "ncclGroupEnd");
    find(send, "ncclSend");
    find(receive, "ncclRecv");
    find(error_string, "ncclGetErrorString");
  }
};

const Nccl& nccl() {
  static const Nccl loaded;
  return loaded;
}

void require() {
  if (!nccl().trouble.empty()) throw DeviceError("NCCL cannot be loaded: " + nccl().trouble);
}
void check(ncclResult_t result, const char* what) {
  if (result == ncclSuccess) return;
  throw DeviceError(std::string("NCCL: ") + what + " failed: " + nccl().error_string(result));
}

}  // namespace

bool has_nccl() { return nccl().trouble.empty(); }

std::string nccl_version() {
  if (!has_nccl()) return "no NCCL: " + nccl().trouble;
  int version = 0;
  check(nccl().get_version(&version), "ncclGetVersion");
  return std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." +
         std::to_string(version % 100);
}

NcclRanks::Name NcclRanks::make_name() {
  require();
  ncclUniqueId id;
  check(nccl().get_unique_id(&id), "ncclGetUniqueId");
  Name name;
  static_assert(sizeof name == sizeof id);
  std::memcpy(name.data(), &id, sizeof id);
  return name;
}

NcclRanks::NcclRanks(const Name& name, int rank, int count) {
  require();
  ncclUniqueId id;
  std::memcpy(&id, name.data(), sizeof id);
  check(nccl().init_rank(&ranks_, count, id, rank), "ncclCommInitRank");
}

NcclRanks::~NcclRanks() {
  // `destroy` waits for the other ranks, which does not end if an error is about to end all ranks.
  if (std::uncaught_exceptions() == 0) nccl().destroy(ranks_);
}

void NcclRanks::exchange(std::span<const Message> outgoing, std::span<const Message> incoming,
                         CUstream_st* stream) const {
  check(nccl().group_start(), "ncclGroupStart");
  for (const Message& m : incoming) {
    if (m.bytes.empty()) continue;
    check(nccl().receive(m.bytes.data(), m.bytes.size(), ncclUint8, m.rank, ranks_, stream),
          "ncclRecv");
  }
  for (const Message& m : outgoing) {
    if (m.bytes.empty()) continue;
    check(nccl().send(m.bytes.data(), m.bytes.size(), ncclUint8, m.rank, ranks_, stream),
          "ncclSend");
  }
  check(nccl().group_end(), "ncclGroupEnd");
}

}  // namespace phyxel::cuda

#else

namespace phyxel::cuda {
namespace {
const std::string without = "this program was built without it";
}

bool has_nccl() { return false; }
std::string nccl_version() { return "no NCCL: " + without; }
NcclRanks::Name NcclRanks::make_name() { throw DeviceError("NCCL: " + without); }
NcclRanks::NcclRanks(const Name&, int, int) { throw DeviceError("NCCL: " + without); }
NcclRanks::~NcclRanks() = default;
void NcclRanks::exchange(std::span<const Message>, std::span<const Message>, CUstream_st*) const {}

}  // namespace phyxel::cuda

#endif
