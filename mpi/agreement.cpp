#include <fmt/format.h>

#include <cstdlib>
#include <new>

#include "mpi/communicator.hpp"
#include "mpi/host_threads.hpp"

namespace phyxel {

bool launched_as_rank() {
  for (const char* variable : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_SIZE"}) {
    if (std::getenv(variable)) return true;
  }
  return false;
}

void MpiCommunicator::divided(bool works, const std::function<void()>& work) const {
  const HostThreads threads(*this, works);
  run(
      [&] {
        if (works) work();
      },
      true);
}

void MpiCommunicator::run(const std::function<void()>& work, bool divided) const {
  if (size_ == 1) {
    work();
    return;
  }
  std::string message;
  auto code = static_cast<int>(ExitCode::success);
  try {
    work();
  } catch (const Error& error) {
    message = error.what();
    code = static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    message = out_of_memory;
    code = static_cast<int>(ExitCode::bad_input);
  } catch (const std::exception& error) {
    message = error.what();
    code = static_cast<int>(ExitCode::bad_input);
  }
  if (divided) wait_asleep();
  const bool failed = code != static_cast<int>(ExitCode::success);
  const std::int64_t first = smallest(static_cast<std::int64_t>(failed ? rank_ : size_));
  if (first == size_) return;
  const std::int64_t failures = sum(static_cast<std::int64_t>(failed));
  const auto from = static_cast<int>(first);
  const std::vector<char> words =
      broadcast(std::vector<char>(message.begin(), message.end()), from);
  const int agreed = broadcast(std::vector<int>{code}, from).front();
  message.assign(words.begin(), words.end());
  // An error of all ranks needs no rank number.
  if (!divided && failures < size_)
    message = fmt::format("rank {} of {}: {}", from, size_, message);
  throw AgreedError(static_cast<ExitCode>(agreed), message);
}

}  // namespace phyxel
