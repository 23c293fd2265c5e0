#include "progress.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>

#include "terminal.hpp"

namespace phyxel::app {
namespace {

constexpr double redraw_interval = 0.1;  // [s]
constexpr std::size_t bar_length = 16;   // [columns]; leaves room for the speed on 80 columns

int terminal_columns(std::FILE* stream) {
  winsize size = {};
  if (::ioctl(::fileno(stream), TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double usual_line_interval() {
  const char* said = std::getenv("PHYXEL_PROGRESS_SECONDS");
  return said ? std::atof(said) : 5;
}

/// A duration as "0:07", "12:34" or "5:06:07"; "-:--" if unknown.
std::string clock_text(double seconds) {
  if (!(seconds >= 0 && seconds < 1e9)) return "-:--";
  const auto s = static_cast<std::int64_t>(std::ceil(seconds));
  if (s < 3600) return fmt::format("{}:{:02d}", s / 60, s % 60);
  return fmt::format("{}:{:02d}:{:02d}", s / 3600, s / 60 % 60, s % 60);
}

}  // namespace

Progress::Progress(double end_time, std::FILE* stream, const ProgressStyle& style)
    : end_time_(end_time),
      stream_(stream),
      phyxels_(style.phyxels),
      line_interval_(style.line_interval.value_or(usual_line_interval())),
      clock_(style.clock ? style.clock : steady_seconds),
      load_(style.load ? style.load : host_load) {
  if (stream_ == nullptr) return;
  terminal_ = style.terminal.value_or(is_terminal(stream_));
  if (terminal_) columns_ = style.columns.value_or(terminal_columns(stream_));
  // A terminal shows the first update at once; elsewhere a short run has its last line only.
  last_shown_ = clock_() - (terminal_ ? redraw_interval : 0);
}

Progress::~Progress() { finish(); }

void Progress::update(double time, std::int64_t step, double steps_per_second, double energy) {
  if (stream_ == nullptr) return;
  time_ = time;
  step_ = step;
  steps_per_second_ = steps_per_second;
  energy_ = energy;
  given_.clear();
  show_if_due();
}

void Progress::update(std::vector<std::string> parts) {
  if (stream_ == nullptr) return;
  given_ = std::move(parts);
  show_if_due();
}

void Progress::stage(std::string_view name, double share) {
  if (stream_ == nullptr) return;
  const double now = clock_();
  if (name != stage_ || share <= 0) {
    stage_ = name;
    stage_start_ = now;
  }
  given_ = share_parts(share < 1 ? std::min(share, 0.999) : 1);  // 100% only at the end
  given_.push_back(stage_);
  if (share > 0.01 && share < 1) {
    given_.push_back(
        fmt::format("{} left", clock_text((now - stage_start_) * (1 - share) / share)));
  }
  if (terminal_ && share >= 1) return take_away();
  if (terminal_ && share <= 0) last_shown_ = now - redraw_interval;
  show_if_due();
  pending_ = false;  // nothing remains to be shown at the end of set-up
}

void Progress::take_away() {
  if (drawn_) std::fputs("\r\x1b[K", stream_);
  std::fflush(stream_);
  drawn_ = false;
}

void Progress::say(const std::string& line) {
  if (stream_ == nullptr) return;
  std::fputs((terminal_ ? '\r' + line + "\x1b[K\n" : line + '\n').c_str(), stream_);
  std::fflush(stream_);
}

void Progress::show_if_due() {
  pending_ = true;
  const double now = clock_();
  if (now - last_shown_ < (terminal_ ? redraw_interval : line_interval_)) return;
  last_shown_ = now;
  show();
}

void Progress::finish() {
  if (stream_ == nullptr) return;
  if (pending_) show();
  if (drawn_) std::fputc('\n', stream_);
  std::fflush(stream_);
  stream_ = nullptr;
}

std::vector<std::string> Progress::share_parts(double share) const {
  std::vector<std::string> parts;
  if (terminal_) {
    const auto filled = static_cast<std::size_t>(std::clamp(share, 0.0, 1.0) * bar_length);
    parts.push_back('[' + std::string(filled, '#') + std::string(bar_length - filled, '.') + ']');
  }
  parts.push_back(fmt::format("{:5.1f}%", 100 * share));
  return parts;
}

// The parts of a line, in the order of importance: a narrow terminal drops the last ones.
std::vector<std::string> Progress::parts() const {
  if (!given_.empty()) return given_;
  // The last step ends at end_time except for rounding.
  const bool done = time_ >= end_time_ * (1 - 1e-9);
  const double fraction = done ? 1 : std::clamp(time_ / end_time_, 0.0, 0.999);  // 100% at the end
  // Remaining time from the remaining steps; the step size is time / step.
  const double dt = step_ > 0 ? time_ / static_cast<double>(step_) : 0;
  const double left = done ? 0 : (end_time_ - time_) / (dt * steps_per_second_);
  std::vector<std::string> parts = share_parts(fraction);
  parts.push_back(fmt::format("{} left", clock_text(left)));
  parts.push_back(fmt::format("{:.3f}/{:g} s", time_, end_time_));
  // The load includes this run's threads, which occupy at most all cores.
  if (const auto host = load_(); host && host->exceeds()) {
    parts.push_back(fmt::format("load {:.1f} on {} cores", host->load, host->cores));
  }
  if (phyxels_ > 0) {
    parts.push_back(
        fmt::format("{:.3g} phyxel-steps/s", steps_per_second_ * static_cast<double>(phyxels_)));
  }
  parts.push_back(fmt::format("{:.4g} steps/s", steps_per_second_));
  parts.push_back(fmt::format("step {}", step_));
  parts.push_back(fmt::format("E = {:.4g} J", energy_));
  return parts;
}

void Progress::show() {
  pending_ = false;
  std::string line;
  for (const std::string& part : parts()) {
    // One column stays free, so that the terminal does not wrap the line.
    if (terminal_ && static_cast<int>(line.size() + 2 + part.size()) >= columns_) break;
    if (!line.empty()) line += "  ";
    line += part;
  }
  // Not fmt::print, which would throw: a closed stderr must not end a run.
  std::fputs((terminal_ ? '\r' + line + "\x1b[K" : line + '\n').c_str(), stream_);
  std::fflush(stream_);
  drawn_ = terminal_;
}

}  // namespace phyxel::app
