/// The communicator of one rank, for builds without MPI.
#include <cstdlib>

#include "mpi/communicator.hpp"
#include "mpi/copy_bytes.hpp"
#include "mpi/watchdog.hpp"

namespace phyxel {

MpiCommunicator::MpiCommunicator(int&, char**&) {
  const auto above = [](const char* variable, int limit) {
    const char* number = std::getenv(variable);
    return number && std::atoi(number) > limit;
  };
  // PMIx does not provide the number of ranks; Slurm does.
  const bool by_slurm = std::getenv("PMIX_RANK") && above("SLURM_NTASKS", 1);
  if (above("OMPI_COMM_WORLD_SIZE", 1) || above("PMI_SIZE", 1) || above("PMIX_RANK", 0) ||
      by_slurm) {
    throw Error(ExitCode::bad_input, "built without MPI; allowed: one rank, without mpirun");
  }
}
MpiCommunicator::MpiCommunicator(CommunicatorHandle) {
  throw Error(ExitCode::bad_input,
              "a communicator was given, but this program was built without MPI");
}
MpiCommunicator::~MpiCommunicator() = default;
void MpiCommunicator::close() {}

void MpiCommunicator::barrier() const {}
void MpiCommunicator::wait_asleep() const {}
double MpiCommunicator::sum(double value) const { return value; }
std::int64_t MpiCommunicator::sum(std::int64_t value) const { return value; }
double MpiCommunicator::largest(double value) const { return value; }
std::int64_t MpiCommunicator::largest(std::int64_t value) const { return value; }
double MpiCommunicator::smallest(double value) const { return value; }
std::int64_t MpiCommunicator::smallest(std::int64_t value) const { return value; }

void MpiCommunicator::add(std::span<std::int64_t>) const {}

std::vector<std::byte> MpiCommunicator::gathered_bytes(std::span<const std::byte> bytes) const {
  return {bytes.begin(), bytes.end()};
}
void MpiCommunicator::broadcast_bytes(std::span<std::byte>, int) const {}
std::vector<std::int64_t> MpiCommunicator::alltoall(
    const std::vector<std::int64_t>& numbers) const {
  return numbers;
}
void MpiCommunicator::exchange(const std::vector<std::span<const std::byte>>& send,
                               const std::vector<std::span<std::byte>>& receive) const {
  copy_bytes(send.at(0), receive.at(0));
}

struct Transfers::Requests {};
Transfers::Transfers(const MpiCommunicator&, Tag tag) : tag_(tag) {}  // there are no other ranks
Transfers::~Transfers() = default;
void Transfers::receive(int, std::span<std::byte>) {}
void Transfers::send(int, std::span<const std::byte>) {}
void Transfers::keep(std::shared_ptr<void>) {}
void Transfers::progress() {}
void Transfers::wait() {}

bool mpi_takes_device_memory() { return false; }
std::string mpi_description() { return "none: this program was built without MPI"; }

struct Watchdog::SharedHeartbeats {};
Watchdog::Watchdog(const MpiCommunicator&, double) {}  // there are no other ranks
Watchdog::~Watchdog() = default;
void Watchdog::close() {}
void Watchdog::beat(std::int64_t) const {}

void MpiCommunicator::abort(ExitCode code) const { std::_Exit(static_cast<int>(code)); }

}  // namespace phyxel
