/// Asynchronous output: jobs on a thread of their own.
#pragma once

#include <atomic>
#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

namespace phyxel::app {

/// A thread that runs jobs in the order of submission while the caller continues. The queue has
/// room for one job beside the running one; a third blocks the caller. An exception of a job ends
/// the work: the queued job is dropped, and each later call throws that exception.
class BackgroundWriter {
 public:
  /// @throws std::system_error if no thread can be started
  BackgroundWriter();
  /// Runs the queued job. Its error is lost; call `finish` to receive it.
  ~BackgroundWriter();
  BackgroundWriter(const BackgroundWriter&) = delete;
  BackgroundWriter& operator=(const BackgroundWriter&) = delete;

  /// Queues a job, after waiting for room. The job is destroyed as soon as it is done.
  /// @throws the exception of an earlier job
  void submit(std::function<void()> job);

  /// Waits until the queue is empty, so that the data of the next job can be made as late as
  /// possible.
  /// @throws the exception of an earlier job
  void wait_for_room();

  /// Waits until all jobs are done. @throws the exception of a job
  void finish();

  /// Checks for an error, at the price of an atomic load. @throws the exception of a job
  void check();

 private:
  void work();
  void wait_until(std::unique_lock<std::mutex>& lock, const std::function<bool()>& holds);

  std::mutex mutex_;
  std::condition_variable changed_;
  std::function<void()> waiting_;
  bool busy_ = false, ending_ = false;
  std::exception_ptr error_;
  std::atomic<bool> failed_ = false;  // true once error_ is set
  std::thread thread_;                // last, since it uses the other members
};

}  // namespace phyxel::app
