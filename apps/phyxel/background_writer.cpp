#include "background_writer.hpp"

#include <utility>

namespace phyxel::app {

BackgroundWriter::BackgroundWriter() : thread_([this] { work(); }) {}

BackgroundWriter::~BackgroundWriter() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void BackgroundWriter::submit(std::function<void()> job) {
  std::unique_lock lock(mutex_);
  wait_until(lock, [this] { return !waiting_; });
  waiting_ = std::move(job);
  changed_.notify_all();
}

void BackgroundWriter::wait_for_room() {
  std::unique_lock lock(mutex_);
  wait_until(lock, [this] { return !waiting_; });
}

void BackgroundWriter::finish() {
  std::unique_lock lock(mutex_);
  wait_until(lock, [this] { return !waiting_ && !busy_; });
}

void BackgroundWriter::check() {
  if (failed_) finish();
}

void BackgroundWriter::wait_until(std::unique_lock<std::mutex>& lock,
                                  const std::function<bool()>& holds) {
  changed_.wait(lock, [&] { return error_ || holds(); });
  if (error_) std::rethrow_exception(error_);
}

void BackgroundWriter::work() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return waiting_ || ending_; });
    if (!waiting_) return;
    std::function<void()> job = std::exchange(waiting_, nullptr);
    busy_ = true;
    changed_.notify_all();
    lock.unlock();
    std::exception_ptr error;
    try {
      job();
    } catch (...) {
      error = std::current_exception();
    }
    job = nullptr;
    lock.lock();
    busy_ = false;
    if (error) {
      error_ = error;
      failed_ = true;
      waiting_ = nullptr;
    }
    changed_.notify_all();
  }
}

}  // namespace phyxel::app
