/// Asynchronous output of values that are distributed over ranks.
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

/// This rank's values at one time, from which files are written.
struct Moment {
  std::shared_ptr<const State> state;
  SurfelState surfels;
  std::optional<std::vector<Triangle>> triangles;  ///< Those that cracks leave; unset: all.
  Frame frame;                                     ///< Refers to the other members.
  std::vector<Quantity> optional;                  ///< The optional quantities that any rank has.
};

/// Writer of files on a thread of the first rank, one file after the other, while all ranks step.
/// On several ranks that thread requests a chunk at a time, which ranks send when they call
/// `serve`. Ranks keep their values of a time until its file is written, and the first rank one
/// chunk more. With parallel HDF5, long arrays are written collectively. Only the stepping thread
/// calls MPI, and only the writer's thread HDF5. At most two files are pending: one being written
/// and one queued. Functions are collective, and throw the exception of a job on all ranks.
class FileWriter {
 public:
  /// A job, called on the first rank's writer thread; only that thread may read the source.
  using Job = std::function<void(ChunkedSource&)>;

  /// @param shared model whose values are written; must outlive the writer
  /// @param length number of rows of a chunk
  FileWriter(const SharedModel& shared, Index length);
  /// Completes queued jobs on one rank; drops them on several.
  ~FileWriter();
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;

  void submit(std::shared_ptr<const Moment> moment, Job job);
  /// Sends the values that the writer has requested, if any.
  void serve();
  /// Waits until no file is queued, so that the values of the next one can be made late.
  void wait_for_room();
  /// Waits until all files are written.
  void finish();

 private:
  class Asking;
  /// A request of the first rank to all ranks.
  struct Call {
    std::int64_t done = 0;  // number of files written
    bool failed = false;
    enum class Ask { nothing, stretch, array } ask = Ask::nothing;  // of the file that is open
    Quantity quantity{};
    RowRange stretch;
  };
  /// An array to be written collectively.
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
  std::int64_t done_ = 0;  // number of files written that all ranks know of

  // Shared between the two threads of the first rank.
  std::mutex mutex_;
  std::condition_variable changed_;
  Call call_;
  Array array_;  // the requested array, if any
  std::optional<std::vector<double>> answer_;
  bool leaving_ = false;

  BackgroundWriter writer_;  // last, since its jobs use the other members
};

}  // namespace phyxel::app
