#include "file_writer.hpp"

#include <algorithm>
#include <utility>

#include "files/frame_file.hpp"
#include "mpi/parallel_file.hpp"
#include "phyxel/error.hpp"
#include "timeline.hpp"

namespace phyxel::app {

/// The values of all ranks, as the writer's thread reads them.
class FileWriter::Asking : public ChunkedSource {
 public:
  Asking(FileWriter& writer, const Moment& moment)
      : ChunkedSource(writer.length_), writer_(writer), moment_(moment) {}

  bool has(Quantity quantity) const override {
    const auto& optional = moment_.optional;
    return std::find(optional.begin(), optional.end(), quantity) != optional.end();
  }
  std::span<const double> values(Quantity quantity, Index begin, Index end) override {
    return values_ = writer_.asked(quantity, {begin, end});
  }
  std::span<const Triangle> triangles() const override {
    const std::vector<Triangle>* of_frame = moment_.frame.triangles;
    return of_frame ? *of_frame : writer_.shared_.triangles();
  }
  /// True for arrays longer than one chunk, if HDF5 is parallel.
  bool writes_collectively(Index count) const override {
    return can_write_collectively() && count > length();
  }
  void write_collectively(const std::filesystem::path& file, const FileArray& array) override {
    writer_.have_written({std::filesystem::absolute(file).string(), array});
  }

 private:
  FileWriter& writer_;
  const Moment& moment_;
  std::vector<double> values_;
};

FileWriter::FileWriter(const SharedModel& shared, Index length) : shared_(shared), length_(length) {
  can_write_collectively();  // initialises HDF5, which calls MPI, on this thread
}

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
      FrameSource values(shared_.here(), moment->frame, length_);
      job(values);
    });
    return;
  }
  wait_for_room();
  ranks().collectively([&] {
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
    ranks().collectively([&] {
      if (leads()) writer_.finish();
    });
  }
  if (call.ask == Call::Ask::nothing) return;
  std::vector<double> values;
  if (call.ask == Call::Ask::stretch) {
    const Phase phase("gathering values");
    values = shared_.gathered(call.quantity, own_values(call.quantity), call.stretch.begin,
                              call.stretch.end);
  } else {
    const Phase phase("writing collectively");
    write_array();
  }
  if (!leads()) return;
  {
    const std::lock_guard lock(mutex_);
    call_.ask = Call::Ask::nothing;
    answer_ = std::move(values);
  }
  changed_.notify_all();
}

std::span<const double> FileWriter::own_values(Quantity quantity) const {
  return values_of(shared_.here(), open_.front()->frame, quantity);
}

void FileWriter::write_array() const {
  const auto told = [](const auto& values) {
    return ranks().broadcast(std::vector(values.begin(), values.end()));
  };
  const auto text = [](const std::vector<char>& letters) {
    return std::string(letters.begin(), letters.end());
  };
  struct Numbers {
    bool as_float;
    Index count;
  };
  const FileArray& asked = array_.array;  // valid on the first rank
  const std::string file = text(told(array_.file));
  const Numbers numbers =
      ranks().broadcast(std::vector{Numbers{asked.as_float, asked.count}}).front();
  const FileArray array{text(told(asked.path)), numbers.as_float, numbers.count, told(asked.terms)};
  phyxel::write_collectively(
      ranks(), file, array, length_, [&](std::span<const RowRange> of_ranks) {
        return sum_of_terms(array, [&](Quantity term) {
          return shared_.exchange().redistributed(term, own_values(term), of_ranks);
        });
      });
}

FileWriter::Call FileWriter::next_call(bool wait) {
  if (!leads()) return {};
  std::unique_lock lock(mutex_);
  if (wait) {
    changed_.wait(lock, [&] {
      return call_.ask != Call::Ask::nothing || call_.failed || call_.done > done_;
    });
  }
  return call_;
}

std::vector<double> FileWriter::asked(Quantity quantity, RowRange stretch) {
  std::unique_lock lock(mutex_);
  call_ = {call_.done, false, Call::Ask::stretch, quantity, stretch};
  return answered(lock);
}

void FileWriter::have_written(Array array) {
  std::unique_lock lock(mutex_);
  array_ = std::move(array);
  call_.ask = Call::Ask::array;
  answered(lock);
}

std::vector<double> FileWriter::answered(std::unique_lock<std::mutex>& lock) {
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
