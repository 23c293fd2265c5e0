#include "program_ranks.hpp"

#include <string>

namespace phyxel::app {
namespace {

const Ranks* the_ranks = nullptr;

}  // namespace

void set_ranks(const Ranks& ranks) { the_ranks = &ranks; }
const Ranks& all_ranks() {
  static const Ranks alone;
  return the_ranks ? *the_ranks : alone;
}
const MpiCommunicator& ranks() { return all_ranks().communicator(); }

void require_alike(std::uint64_t value, const char* what) {
  const auto signed_value = static_cast<std::int64_t>(value);
  if (ranks().smallest(signed_value) == ranks().largest(signed_value)) return;
  throw AgreedError(ExitCode::bad_input,
                    std::string("the ranks have different ") + what +
                        "; allowed: the same files for all ranks, on a shared file system");
}

Traffic most_traffic(const Backend& backend) {
  const auto here = backend.exchanges();
  if (!here) return {};
  return {ranks().largest(here->traffic.bytes_sent), ranks().largest(here->traffic.seconds)};
}

}  // namespace phyxel::app
