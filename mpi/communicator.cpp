#include "mpi/communicator.hpp"

#include <fmt/format.h>
#include <mpi.h>
#if __has_include(<mpi-ext.h>)
#include <mpi-ext.h>  // Open MPI's query of CUDA support
#endif

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <numeric>
#include <thread>

#include "mpi/copy_bytes.hpp"
#include "mpi/heartbeat.hpp"
#include "mpi/native.hpp"

namespace phyxel {

void check_mpi(int code, const char* call) {
  if (code == MPI_SUCCESS) return;
  char text[MPI_MAX_ERROR_STRING] = "";
  int length = 0;
  MPI_Error_string(code, text, &length);
  throw Error(ExitCode::bad_input, fmt::format("MPI: {} failed: {}", call, text));
}

namespace {

/// Largest message [bytes]: MPI's counts are ints, so larger messages are split.
constexpr std::size_t most_bytes = std::size_t{1} << 30;

template <class T>
T reduced(const MpiCommunicator& ranks, T value, MPI_Datatype type, MPI_Op operation) {
  if (ranks.size() == 1) return value;
  T result{};
  const Waiting waiting;
  PHYXEL_MPI_CALL(MPI_Allreduce(&value, &result, 1, type, operation, ranks.native()->all));
  return result;
}

template <class Call>
void in_pieces(std::size_t bytes, Call&& call) {
  for (std::size_t at = 0; at < bytes; at += most_bytes) {
    call(at, static_cast<int>(std::min(most_bytes, bytes - at)));
  }
}

/// The required thread level: one thread calls MPI, while those of OpenMP and of the writer run.
constexpr int needed_level = MPI_THREAD_FUNNELED;

const char* name_of_level(int level) {
  switch (level) {
    case MPI_THREAD_SINGLE:
      return "MPI_THREAD_SINGLE";
    case MPI_THREAD_FUNNELED:
      return "MPI_THREAD_FUNNELED";
    case MPI_THREAD_SERIALIZED:
      return "MPI_THREAD_SERIALIZED";
    default:
      return "MPI_THREAD_MULTIPLE";
  }
}

/// Checks MPI's thread level and that this is the main thread.
/// @throws Error naming the level that MPI runs with and the one that is required
void check_threads() {
  int level = 0, is_main = 0;
  PHYXEL_MPI_CALL(MPI_Query_thread(&level));
  if (level < needed_level) {
    throw Error(ExitCode::bad_input,
                fmt::format("MPI runs with the thread level {}; allowed: {} or a higher one, by "
                            "MPI_Init_thread",
                            name_of_level(level), name_of_level(needed_level)));
  }
  PHYXEL_MPI_CALL(MPI_Is_thread_main(&is_main));
  if (level < MPI_THREAD_SERIALIZED && !is_main) {
    throw Error(
        ExitCode::bad_input,
        fmt::format("MPI runs with the thread level {}; allowed: calls from the thread that "
                    "has started MPI",
                    name_of_level(level)));
  }
}

/// Duplicates the caller's communicator. Errors of the duplicate alone are returned as codes.
MPI_Comm duplicate_of(MPI_Comm callers) {
  MPI_Comm own = MPI_COMM_NULL;
  PHYXEL_MPI_CALL(MPI_Comm_dup(callers, &own));
  PHYXEL_MPI_CALL(MPI_Comm_set_errhandler(own, MPI_ERRORS_RETURN));
  return own;
}

}  // namespace

MpiCommunicator::MpiCommunicator(int& argc, char**& argv) : native_(std::make_shared<Native>()) {
  int running = 0, level = 0;
  MPI_Initialized(&running);
  if (!running) {
    PHYXEL_MPI_CALL(MPI_Init_thread(&argc, &argv, needed_level, &level));
    native_->started_here = true;
  }
  check_threads();
  native_->all = duplicate_of(MPI_COMM_WORLD);
  describe_hosts();
}

MpiCommunicator::MpiCommunicator(CommunicatorHandle callers) : native_(std::make_shared<Native>()) {
  int running = 0;
  MPI_Initialized(&running);
  if (!running) {
    throw Error(ExitCode::bad_input,
                "a communicator was given, but MPI does not run; allowed: after MPI_Init_thread");
  }
  check_threads();
  MPI_Comm all = MPI_Comm_f2c(callers.fortran);
  if (all == MPI_COMM_NULL) {
    throw Error(ExitCode::bad_input,
                "MPI_COMM_NULL was given; allowed: a communicator to which this rank belongs");
  }
  native_->all = duplicate_of(all);
  describe_hosts();
}

void MpiCommunicator::describe_hosts() {
  MPI_Comm all = native_->all;
  PHYXEL_MPI_CALL(MPI_Comm_rank(all, &rank_));
  PHYXEL_MPI_CALL(MPI_Comm_size(all, &size_));
  MPI_Comm host = MPI_COMM_NULL;
  PHYXEL_MPI_CALL(MPI_Comm_split_type(all, MPI_COMM_TYPE_SHARED, rank_, MPI_INFO_NULL, &host));
  PHYXEL_MPI_CALL(MPI_Comm_rank(host, &host_rank_));
  PHYXEL_MPI_CALL(MPI_Comm_size(host, &host_size_));
  int first = rank_;  // becomes the first rank of this host
  PHYXEL_MPI_CALL(MPI_Bcast(&first, 1, MPI_INT, 0, host));
  hosts_.resize(static_cast<std::size_t>(size_));
  PHYXEL_MPI_CALL(MPI_Allgather(&first, 1, MPI_INT, hosts_.data(), 1, MPI_INT, all));
  MPI_Comm_free(&host);
}

MpiCommunicator::~MpiCommunicator() = default;

void MpiCommunicator::close() {
  if (!native_ || native_->all == MPI_COMM_NULL) return;
  for (Native::Left& left : native_->left) {
    PHYXEL_MPI_CALL(MPI_Waitall(static_cast<int>(left.requests.size()), left.requests.data(),
                                MPI_STATUSES_IGNORE));
  }
  native_->left.clear();
  PHYXEL_MPI_CALL(MPI_Comm_free(&native_->all));
  if (native_->started_here) MPI_Finalize();
}

void MpiCommunicator::barrier() const {
  const Waiting waiting;
  if (size_ > 1) PHYXEL_MPI_CALL(MPI_Barrier(native_->all));
}

void MpiCommunicator::wait_asleep() const {
  if (size_ == 1) return;
  const Waiting waiting;
  MPI_Request request;
  PHYXEL_MPI_CALL(MPI_Ibarrier(native_->all, &request));
  for (int done = 0;;) {
    PHYXEL_MPI_CALL(MPI_Test(&request, &done, MPI_STATUS_IGNORE));
    if (done) return;
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
}

// MPI may add in any order; gathered numbers are summed in the order of ranks.
double MpiCommunicator::sum(double value) const {
  const std::vector<double> all = gathered(std::span<const double>(&value, 1));
  return std::accumulate(all.begin(), all.end(), 0.0);
}
std::int64_t MpiCommunicator::sum(std::int64_t value) const {
  return reduced(*this, value, MPI_INT64_T, MPI_SUM);
}
double MpiCommunicator::largest(double value) const {
  return reduced(*this, value, MPI_DOUBLE, MPI_MAX);
}
std::int64_t MpiCommunicator::largest(std::int64_t value) const {
  return reduced(*this, value, MPI_INT64_T, MPI_MAX);
}
double MpiCommunicator::smallest(double value) const {
  return reduced(*this, value, MPI_DOUBLE, MPI_MIN);
}
std::int64_t MpiCommunicator::smallest(std::int64_t value) const {
  return reduced(*this, value, MPI_INT64_T, MPI_MIN);
}

void MpiCommunicator::add(std::span<std::int64_t> values) const {
  if (size_ == 1) return;
  const Waiting waiting;
  PHYXEL_MPI_CALL(MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()),
                                MPI_INT64_T, MPI_SUM, native_->all));
}

std::vector<std::byte> MpiCommunicator::gathered_bytes(std::span<const std::byte> bytes) const {
  const auto ranks = static_cast<std::size_t>(size_);
  const auto size = static_cast<std::int64_t>(bytes.size());
  const std::vector<std::int64_t> sizes = alltoall(std::vector<std::int64_t>(ranks, size));
  std::vector<std::byte> all(
      static_cast<std::size_t>(std::accumulate(sizes.begin(), sizes.end(), std::int64_t{0})));
  std::vector<std::span<std::byte>> from_each;
  std::size_t at = 0;
  for (const std::int64_t more : sizes) {
    from_each.push_back(std::span(all).subspan(at, static_cast<std::size_t>(more)));
    at += static_cast<std::size_t>(more);
  }
  exchange(std::vector<std::span<const std::byte>>(ranks, bytes), from_each);
  return all;
}

void MpiCommunicator::broadcast_bytes(std::span<std::byte> bytes, int from) const {
  if (size_ == 1) return;
  const Waiting waiting;
  in_pieces(bytes.size(), [&](std::size_t at, int count) {
    PHYXEL_MPI_CALL(MPI_Bcast(bytes.data() + at, count, MPI_BYTE, from, native_->all));
  });
}

std::vector<std::int64_t> MpiCommunicator::alltoall(
    const std::vector<std::int64_t>& numbers) const {
  if (size_ == 1) return numbers;
  const Waiting waiting;
  std::vector<std::int64_t> from_each(numbers.size());
  PHYXEL_MPI_CALL(
      MPI_Alltoall(numbers.data(), 1, MPI_INT64_T, from_each.data(), 1, MPI_INT64_T, native_->all));
  return from_each;
}

void MpiCommunicator::exchange(const std::vector<std::span<const std::byte>>& send,
                               const std::vector<std::span<std::byte>>& receive) const {
  constexpr int alltoallv_tag = static_cast<int>(Tag::alltoallv);
  const Waiting waiting;
  std::vector<MPI_Request> requests;
  for (int r = 0; r < size_; ++r) {
    if (r == rank_) continue;
    in_pieces(receive.at(r).size(), [&](std::size_t at, int count) {
      PHYXEL_MPI_CALL(MPI_Irecv(receive[r].data() + at, count, MPI_BYTE, r, alltoallv_tag,
                                native_->all, &requests.emplace_back()));
    });
  }
  for (int r = 0; r < size_; ++r) {
    if (r == rank_) continue;
    in_pieces(send.at(r).size(), [&](std::size_t at, int count) {
      PHYXEL_MPI_CALL(MPI_Isend(send[r].data() + at, count, MPI_BYTE, r, alltoallv_tag,
                                native_->all, &requests.emplace_back()));
    });
  }
  copy_bytes(send.at(rank_), receive.at(rank_));
  if (size_ == 1) return;  // MPI may not have been started
  PHYXEL_MPI_CALL(
      MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE));
}

struct Transfers::Requests {
  std::vector<MPI_Request> list;
  std::shared_ptr<void> memory;
};
Transfers::Transfers(const MpiCommunicator& ranks, Tag tag)
    : native_(ranks.native()), tag_(tag), requests_(std::make_unique<Requests>()) {}
Transfers::~Transfers() {
  if (requests_->list.empty()) return;
  native_->left.push_back({std::move(requests_->list), std::move(requests_->memory)});
}

void Transfers::receive(int from, std::span<std::byte> bytes) {
  in_pieces(bytes.size(), [&](std::size_t at, int count) {
    PHYXEL_MPI_CALL(MPI_Irecv(bytes.data() + at, count, MPI_BYTE, from, static_cast<int>(tag_),
                              native_->all, &requests_->list.emplace_back()));
  });
}
void Transfers::send(int to, std::span<const std::byte> bytes) {
  in_pieces(bytes.size(), [&](std::size_t at, int count) {
    PHYXEL_MPI_CALL(MPI_Isend(bytes.data() + at, count, MPI_BYTE, to, static_cast<int>(tag_),
                              native_->all, &requests_->list.emplace_back()));
  });
}
void Transfers::keep(std::shared_ptr<void> memory) { requests_->memory = std::move(memory); }
void Transfers::progress() {
  std::vector<MPI_Request>& list = requests_->list;
  int done = 0;
  if (list.empty()) return;
  PHYXEL_MPI_CALL(
      MPI_Testall(static_cast<int>(list.size()), list.data(), &done, MPI_STATUSES_IGNORE));
  if (done) list.clear();
}
void Transfers::wait() {
  std::vector<MPI_Request>& list = requests_->list;
  if (list.empty()) return;
  const Waiting waiting;
  PHYXEL_MPI_CALL(MPI_Waitall(static_cast<int>(list.size()), list.data(), MPI_STATUSES_IGNORE));
  list.clear();
}

bool mpi_takes_device_memory() {
#ifdef MPIX_CUDA_AWARE_SUPPORT
  return MPIX_Query_cuda_support() != 0;
#else
  return false;  // an MPI with CUDA support would define the query
#endif
}

std::string mpi_description() {
  char text[MPI_MAX_LIBRARY_VERSION_STRING] = "";
  int length = 0;
  MPI_Get_library_version(text, &length);
  std::string name(text);
  name = name.substr(0, name.find_first_of(",\n"));  // Open MPI appends the packager's name
#ifdef MPIX_CUDA_AWARE_SUPPORT
  name += mpi_takes_device_memory() ? ", CUDA-aware" : ", not CUDA-aware";
#endif
  return name;
}

void MpiCommunicator::abort(ExitCode code) const {
  if (size_ > 1) MPI_Abort(native_->all, static_cast<int>(code));
  std::_Exit(static_cast<int>(code));
}

}  // namespace phyxel
