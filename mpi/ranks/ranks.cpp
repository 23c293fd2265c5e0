#include "phyxel/ranks.hpp"

#include <fmt/format.h>
#include <omp.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <string>

#include "exact_sum.hpp"
#include "model/host_memory.hpp"
#include "mpi/communicator.hpp"
#include "terminal.hpp"

namespace phyxel {
namespace {

std::unique_ptr<MpiCommunicator> communicator_of(int& argc, char**& argv) {
  // A single rank does not start MPI, which may be installed and yet fail outside mpirun.
  if (!launched_as_rank()) return std::make_unique<MpiCommunicator>();
  return std::make_unique<MpiCommunicator>(argc, argv);
}

void share_cores(int programs) {
  if (programs == 1 || std::getenv("OMP_NUM_THREADS")) return;
  const auto cores = static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
  omp_set_num_threads(std::clamp(omp_get_num_procs(), 1, std::max(1, cores / programs)));
}

}  // namespace

Ranks::Ranks() : communicator_(std::make_unique<MpiCommunicator>()) {}
Ranks::Ranks(int& argc, char**& argv) : communicator_(communicator_of(argc, argv)) { share_host(); }
Ranks::Ranks(CommunicatorHandle callers)
    : communicator_(std::make_unique<MpiCommunicator>(callers)) {
  share_host();
}
Ranks::~Ranks() = default;
void Ranks::close() { communicator_->close(); }
void Ranks::share_host() const {
  share_host_memory(host_size());
  if (size() > 1) share_cores(host_size());
}

int Ranks::rank() const { return communicator_->rank(); }
int Ranks::size() const { return communicator_->size(); }
int Ranks::host_size() const { return communicator_->host_size(); }
int Ranks::host_rank() const { return communicator_->host_rank(); }

void Ranks::barrier() const { communicator_->barrier(); }
std::int64_t Ranks::sum(std::int64_t value) const { return communicator_->sum(value); }
std::int64_t Ranks::largest(std::int64_t value) const { return communicator_->largest(value); }
std::int64_t Ranks::smallest(std::int64_t value) const { return communicator_->smallest(value); }
double Ranks::largest(double value) const { return communicator_->largest(value); }
double Ranks::smallest(double value) const { return communicator_->smallest(value); }

double Ranks::exact_sum(std::span<const double> terms) const {
  ExactSum sum;
  for (const double term : terms) sum.add(term);
  communicator_->add(sum.ready());
  return sum.value();
}

void Ranks::collectively(const std::function<void()>& work) const {
  communicator_->collectively(work);
}

int on_ranks(int& argc, char**& argv, const std::function<int(const Ranks&)>& program) {
  const std::string name = argc > 0 ? std::filesystem::path(argv[0]).filename().string() : "phyxel";
  std::optional<Ranks> ranks;
  const auto fail = [&](ExitCode code, const char* message, bool agreed = false) {
    if (!ranks || ranks->size() == 1) {
      fmt::print(stderr, "{}: {}{}\n", name, error_word(), message);
    } else if (!agreed) {
      fmt::print(stderr, "{}: {}rank {} of {}: {}\n", name, error_word(), ranks->rank(),
                 ranks->size(), message);
      ranks->communicator().abort(code);
    } else if (ranks->leads()) {
      fmt::print(stderr, "{}: {}{}\n", name, error_word(), message);
    }
    return static_cast<int>(code);
  };
  try {
    const int code = program(ranks.emplace(argc, argv));
    ranks->close();
    return code;
  } catch (const AgreedError& error) {
    const int code = fail(error.code(), error.what(), true);
    if (ranks) ranks->close();
    return code;
  } catch (const Error& error) {
    return fail(error.code(), error.what());
  } catch (const std::bad_alloc&) {
    return fail(ExitCode::bad_input, out_of_memory);
  } catch (const std::exception& error) {
    return fail(ExitCode::bad_input, error.what());
  }
}

}  // namespace phyxel
