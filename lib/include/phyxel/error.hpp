/// The errors phyxel throws, and the exit code each one ends the program with.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace phyxel {

/// Exit codes of the program; documented in `phyxel --help`.
enum class ExitCode : int {
  success = 0,
  bad_input = 2,       ///< a file, key or option is wrong; nothing was computed or overwritten
  diverged = 3,        ///< NaN or runaway energy; the last good state is on disk
  device_failed = 4,   ///< no usable GPU, not enough memory on it, or it failed
  output_failed = 74,  ///< writing failed during the run (disk full); earlier files are intact
  stopped = 75,        ///< a signal ended the run; it can continue from the checkpoint
};

/// Base of phyxel's exceptions. `what()` is the complete message for the user.
class Error : public std::runtime_error {
 public:
  /// @param message the complete message for the user
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  /// Exit code of a program that ends with this error.
  ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

/// Wrong input. The message names the file (with line and column where known), the key or
/// element, the value found, and what is allowed.
class InputError : public Error {
 public:
  /// @param message the fault, its place, and what is allowed
  explicit InputError(const std::string& message) : Error(ExitCode::bad_input, message) {}
};

/// Writing a file failed during the simulation.
class OutputError : public Error {
 public:
  /// @param message the file, and the system's message
  explicit OutputError(const std::string& message) : Error(ExitCode::output_failed, message) {}
};

/// A GPU is missing, cannot run this program's kernels, has too little memory, or failed. The
/// message names the device and the request.
class DeviceError : public Error {
 public:
  /// @param message the device, and the request
  explicit DeviceError(const std::string& message) : Error(ExitCode::device_failed, message) {}
};

/// An error that all ranks throw: it occurred on each rank, or the ranks have agreed on the error
/// of one of them.
class AgreedError : public Error {
 public:
  /// @param message the error, with the rank on which it occurred
  using Error::Error;
};

/// An observer asked a search by Newton's method to stop; all ranks throw it alike.
class InterruptedError : public AgreedError {
 public:
  /// @param message the interrupted activity
  explicit InterruptedError(const std::string& message) : AgreedError(ExitCode::stopped, message) {}
};

/// The simulation became unstable.
class DivergedError : public Error {
 public:
  /// @param message where, when, and what may help
  explicit DivergedError(const std::string& message) : Error(ExitCode::diverged, message) {}
};

/// The entry of `allowed` with the smallest edit distance to `word`, or "" if none is close
/// (more than half of the longer word would have to change).
std::string nearest_name(std::string_view word, const std::vector<std::string>& allowed);

/// The suggestion " (did you mean \"young\"?)"; "" if no name is close.
std::string did_you_mean(std::string_view word, const std::vector<std::string>& allowed);

}  // namespace phyxel
