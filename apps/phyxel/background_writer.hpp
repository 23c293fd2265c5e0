/// Writing beside the stepping: jobs on a thread of their own.
#pragma once

#include <atomic>
#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

namespace phyxel::app {

/// Does jobs one after the other, in the order they come, while the caller goes on. One job may
/// wait while another is done; whoever has a third waits. What a job throws ends all work: the job
/// that waits is dropped, and every later call throws the same.
class BackgroundWriter {
 public:
  /// @throws std::system_error if no thread can be started.
  BackgroundWriter();
  /// Does what still waits. An error of that is lost: `finish` tells.
  ~BackgroundWriter();
  BackgroundWriter(const BackgroundWriter&) = delete;
  BackgroundWriter& operator=(const BackgroundWriter&) = delete;

  /// Hands a job over, as soon as none waits. It is destroyed when it is done, with what it holds.
  /// @throws what an earlier job threw.
  void submit(std::function<void()> job);

  /// Returns when no job waits, so that what the next one is to hold need not be there before.
  /// @throws what an earlier job threw.
  void wait_for_room();

  /// Returns when all jobs are done. @throws what one of them threw.
  void finish();

  /// Cheap enough for every step. @throws what a job threw.
  void check();

 private:
  void work();
  void wait_until(std::unique_lock<std::mutex>& lock, const std::function<bool()>& holds);

  std::mutex mutex_;
  std::condition_variable changed_;
  std::function<void()> waiting_;
  bool busy_ = false, ending_ = false;
  std::exception_ptr error_;
  std::atomic<bool> failed_ = false;  // error_ is set
  std::thread thread_;                // last: it uses all the others
};

}  // namespace phyxel::app
