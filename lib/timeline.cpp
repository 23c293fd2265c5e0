#include "timeline.hpp"

#include <mutex>
#include <thread>

#include "model/host_memory.hpp"

namespace phyxel {
namespace {

using Clock = std::chrono::steady_clock;

struct Record {
  std::mutex mutex;
  Clock::time_point start;
  std::thread::id thread;
  std::vector<Timeline::Span> spans;
  std::size_t left_out = 0;
};
Record& record() {
  static Record the_record;
  return the_record;
}

}  // namespace

bool Timeline::on_ = false;

void Timeline::start() {
  Record& r = record();
  const std::lock_guard lock(r.mutex);
  r.start = Clock::now();
  r.thread = std::this_thread::get_id();
  r.spans.clear();
  r.spans.reserve(most_spans);
  r.left_out = 0;
  on_ = true;
}

void Timeline::add(const char* what, Clock::time_point since) {
  const auto now = Clock::now();
  const auto seconds = [](auto duration) {
    return std::chrono::duration<double>(duration).count();
  };
  Record& r = record();
  const std::lock_guard lock(r.mutex);
  if (r.spans.size() == most_spans) {
    ++r.left_out;
    return;
  }
  r.spans.push_back({what, seconds(since - r.start), seconds(now - since),
                     std::this_thread::get_id() != r.thread, peak_memory()});
}

std::vector<Timeline::Span> Timeline::spans() {
  Record& r = record();
  const std::lock_guard lock(r.mutex);
  return r.spans;
}

std::size_t Timeline::left_out() {
  Record& r = record();
  const std::lock_guard lock(r.mutex);
  return r.left_out;
}

}  // namespace phyxel
