#include "file_writer.hpp"

#include <algorithm>
#include <utility>

#include "phyxel/error.hpp"
#include "timeline.hpp"

namespace phyxel::app {

/// The values of all ranks, as the writer's thread sees them.
class FileWriter::Asking : public Stretches {
 public:
  Asking(FileWriter& writer, const Moment& moment)
      : Stretches(writer.length_), writer_(writer), moment_(moment) {}

  bool has(Quantity quantity) const override {
    const auto& optional = moment_.optional;
    return std::find(optional.begin(), optional.end(), quantity) != optional.end();
  }
  std::span<const double> values(Quantity quantity, Index begin, Index end) override {
    return values_ = writer_.asked(quantity, begin, end);
  }
  std::span<const Triangle> triangles() const override { return writer_.ensemble_.triangles(); }

 private:
  FileWriter& writer_;
  const Moment& moment_;
  std::vector<double> values_;
};

FileWriter::FileWriter(const Ensemble& ensemble, Index length)
    : ensemble_(ensemble), length_(length) {}

FileWriter::~FileWriter() {
  {
    const std::lock_guard lock(mutex_);
    leaving_ = true;
  }
  changed_.notify_all();
}

void FileWriter::submit(std::shared_ptr<const Moment> moment, Job job) {
  if (alone()) {
    writer_.submit([this, moment = std::move(moment), job = std::move(job)] {
      FrameStretches values(ensemble_.here(), moment->frame, length_);
      job(values);
    });
    return;
  }
  wait_for_room();
  ranks().together([&] {
    if (!leads()) return;
    writer_.submit([this, moment, job = std::move(job)] {
      try {
        Asking values(*this, *moment);
        job(values);
      } catch (...) {
        ended(false);
        throw;
      }
      ended(true);
    });
  });
  open_.push_back(std::move(moment));
}

void FileWriter::serve() {
  if (alone()) return writer_.check();
  if (!open_.empty()) serve(false);
}

void FileWriter::wait_for_room() {
  if (alone()) return writer_.wait_for_room();
  while (open_.size() > 1) serve(true);
}

void FileWriter::finish() {
  if (alone()) return writer_.finish();
  while (!open_.empty()) serve(true);
}

void FileWriter::serve(bool wait) {
  const Call call = ranks().broadcast(std::vector{next_call(wait)}).front();
  for (; done_ < call.done; ++done_) open_.pop_front();
  if (call.failed) {
    ranks().together([&] {
      if (leads()) writer_.finish();
    });
  }
  if (!call.asks) return;
  const Phase phase("bringing values together");
  const auto here = values_of(ensemble_.here(), open_.front()->frame, call.quantity);
  std::vector<double> all =
      ensemble_.exchange().gathered(call.quantity, here, call.begin, call.end);
  if (!leads()) return;
  {
    const std::lock_guard lock(mutex_);
    call_.asks = false;
    answer_ = std::move(all);
  }
  changed_.notify_all();
}

FileWriter::Call FileWriter::next_call(bool wait) {
  if (!leads()) return {};
  std::unique_lock lock(mutex_);
  if (wait) {
    changed_.wait(lock, [&] { return call_.asks || call_.failed || call_.done > done_; });
  }
  return call_;
}

std::vector<double> FileWriter::asked(Quantity quantity, Index begin, Index end) {
  std::unique_lock lock(mutex_);
  call_ = {call_.done, false, true, quantity, begin, end};
  changed_.notify_all();
  changed_.wait(lock, [&] { return answer_ || leaving_; });
  if (!answer_) throw OutputError("the run has ended before its files were written");
  return *std::exchange(answer_, std::nullopt);
}

void FileWriter::ended(bool well) {
  {
    const std::lock_guard lock(mutex_);
    if (well) ++call_.done;
    if (!well) call_.failed = true;
  }
  changed_.notify_all();
}

}  // namespace phyxel::app
