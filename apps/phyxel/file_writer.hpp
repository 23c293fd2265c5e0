/// Files written beside the stepping, of values that no rank has all of.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "background_writer.hpp"
#include "mpi/row_redistribution.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/shared_model.hpp"
#include "program_ranks.hpp"

namespace phyxel::app {

/// This rank's values of one moment, of which files are written.
struct Moment {
  std::shared_ptr<const State> state;
  SurfelState surfels;
  Frame frame;                     ///< Points into the two.
  std::vector<Quantity> optional;  ///< Which of those that a frame may lack it has, on any rank.
};

/// Has files written on the first rank, on a thread of its own, one after the other, while all go
/// on. On several ranks that thread asks for a stretch at a time, and ranks bring it when they
/// `serve`: they keep their own values of a moment until its file is there, and the first rank a
/// stretch more. With parallel HDF5, long arrays are written by all of them at once. MPI is used by
/// the thread that steps alone, and HDF5 by the writer's alone. At most two files are open, the one
/// being written and one that waits. Every function is collective, and throws on all ranks what a
/// job threw.
class FileWriter {
 public:
  /// Called on the first rank's thread, with values that its thread alone may ask for.
  using Job = std::function<void(ChunkedSource&)>;

  /// @param shared whose values are written; must outlive this
  /// @param length of a stretch
  FileWriter(const SharedModel& shared, Index length);
  /// On one rank, does what still waits; on several, drops it.
  ~FileWriter();
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;

  void submit(std::shared_ptr<const Moment> moment, Job job);
  /// Brings what is asked for at the moment. Costs nothing while no file is written.
  void serve();
  /// Returns when no file waits, so that what the next one is to hold need not be there before.
  void wait_for_room();
  /// Returns when all files are written.
  void finish();

 private:
  class Asking;
  /// What the first rank tells the others.
  struct Call {
    std::int64_t done = 0;  // files, since the start
    bool failed = false;
    enum class Ask { nothing, stretch, array } ask = Ask::nothing;  // of the file that is open
    Quantity quantity{};
    RowRange stretch;
  };
  /// What is to be written together.
  struct Array {
    std::string file;
    FileArray array;
  };

  static bool alone() { return ranks().size() == 1; }
  static bool leads() { return ranks().rank() == 0; }
  void serve(bool wait);
  Call next_call(bool wait);
  std::vector<double> asked(Quantity quantity, RowRange stretch);
  void have_written(Array array);
  std::vector<double> answered(std::unique_lock<std::mutex>& lock);
  std::span<const double> own_values(Quantity quantity) const;
  void write_array() const;
  void ended(bool well);

  const SharedModel& shared_;
  Index length_;
  std::deque<std::shared_ptr<const Moment>> open_;
  std::int64_t done_ = 0;  // as all ranks know

  // Between the two threads of the first rank.
  std::mutex mutex_;
  std::condition_variable changed_;
  Call call_;
  Array array_;  // if it asks for one
  std::optional<std::vector<double>> answer_;
  bool leaving_ = false;

  BackgroundWriter writer_;  // last: its jobs use all the others
};

}  // namespace phyxel::app
