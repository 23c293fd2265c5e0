#include "profile.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "files/atomic_file.hpp"
#include "phyxel/error.hpp"
#include "program_ranks.hpp"
#include "timeline.hpp"

namespace phyxel::app {
namespace {

/// The events of this rank, each followed by a comma.
std::string events_of_rank() {
  const int rank = ranks().rank();
  std::string text = fmt::format(
      R"({{"ph":"M","name":"process_name","pid":{0},"args":{{"name":"rank {0}"}}}},)"
      "\n"
      R"({{"ph":"M","name":"thread_name","pid":{0},"tid":0,"args":{{"name":"steps"}}}},)"
      "\n",
      rank);
  bool writes = false;
  double peak = 0;
  for (const Timeline::Span& span : Timeline::spans()) {
    text += fmt::format(R"({{"ph":"X","name":"{}","pid":{},"tid":{},"ts":{:.3f},"dur":{:.3f}}},)"
                        "\n",
                        span.what, rank, span.aside ? 1 : 0, 1e6 * span.start, 1e6 * span.seconds);
    writes = writes || span.aside;
    if (span.peak_memory > peak) {
      peak = span.peak_memory;
      text += fmt::format(
          R"({{"ph":"C","name":"host memory at most","pid":{},"ts":{:.3f},"args":{{"GB":{:.3f}}}}},)"
          "\n",
          rank, 1e6 * (span.start + span.seconds), 1e-9 * peak);
    }
  }
  if (writes) {
    text += fmt::format(
        R"({{"ph":"M","name":"thread_name","pid":{},"tid":1,"args":{{"name":"files"}}}},)"
        "\n",
        rank);
  }
  return text;
}

}  // namespace

void start_profile(const std::string& file, bool force) {
  ranks().collectively([&] {
    if (ranks().rank() == 0) check_output_file(file, force, Output::file_or_stream);
  });
  ranks().barrier();
  Timeline::start();
}

void write_profile(const std::string& file) {
  const std::string own = events_of_rank();
  std::vector<std::vector<char>> send(static_cast<std::size_t>(ranks().size()));
  send[0].assign(own.begin(), own.end());
  const std::vector<std::vector<char>> events = ranks().alltoallv(send);
  const std::int64_t left_out = ranks().sum(static_cast<std::int64_t>(Timeline::left_out()));
  ranks().collectively([&] {
    if (ranks().rank() > 0) return;
    std::string text = "{\"traceEvents\":[\n";
    for (const std::vector<char>& of_rank : events) text.append(of_rank.begin(), of_rank.end());
    text.erase(text.size() - 2);  // removes the last comma
    text += fmt::format("\n],\"otherData\":{{\"spans left out\":{}}}}}\n", left_out);
    write_whole_file(file, text, Durable::no);
  });
}

}  // namespace phyxel::app
