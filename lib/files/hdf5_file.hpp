/// The little of HDF5 that phyxel needs: contiguous arrays, texts and attributes. The C API behind
/// two classes; nothing else in the project but hdf5_memory and mpi/parallel_file includes hdf5.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "files/atomic_file.hpp"
#include "files/hdf5_layout.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

class SparseBytes;

/// Builds one HDF5 file, in memory or on disk. T may be float, double, std::int32_t, std::int64_t
/// and std::uint8_t. The bytes depend only on the content: no times are stored. Paths are absolute
/// ("/VTKHDF/Points"); groups on the way are made.
class Hdf5Writer {
 public:
  /// In memory, so that a full disk never meets HDF5; but for arrays that come `later`.
  Hdf5Writer();
  /// On disk, for files larger than memory, with `seal_size` bytes left free in front.
  explicit Hdf5Writer(const std::filesystem::path& file);
  ~Hdf5Writer();
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  void group(const std::string& path);
  /// Shape [values], or [values / columns, columns] if `columns` is given.
  template <class T>
  void array(const std::string& path, std::span<const T> values, std::size_t columns = 0);
  /// The same, whose values come when the content is asked for, at most `stretch` rows at a time:
  /// `fill(first row, values of some rows)` puts them there. For a file in memory.
  template <class T>
  using Fill = std::function<void(std::size_t first, std::span<T> values)>;
  template <class T>
  void later(const std::string& path, std::size_t rows, std::size_t columns, std::size_t stretch,
             Fill<T> fill);
  /// The same, written by `write(file)` when all that is not `later` is in the file.
  template <class T>
  void collectively(const std::string& path, std::size_t rows, std::size_t columns,
                    std::function<void(const std::filesystem::path& file)> write);
  /// Shape [n, 3], stored as float or double.
  void vectors(const std::string& path, std::span<const Vec3d> values, bool as_float);
  /// A text of any length; nothing is stored for an empty one.
  void text(const std::string& path, const std::string& value);

  /// An array to be filled by `rows`; `columns` 0: shape [rows].
  template <class T>
  void reserve(const std::string& path, std::size_t rows, std::size_t columns);
  template <class T>
  void rows(const std::string& path, std::size_t first, std::span<const T> values,
            std::size_t columns);

  void attribute(const std::string& path, const std::string& name, const std::string& value);
  void attribute(const std::string& path, const std::string& name, std::int64_t value);
  void attribute(const std::string& path, const std::string& name, double value);
  void attribute(const std::string& path, const std::string& name,
                 std::span<const std::int64_t> values);
  void attribute(const std::string& path, const std::string& name, std::span<const double> values);

  /// The finished file in memory; the writer is spent.
  Content content();
  /// Finishes a file on disk. @throws OutputError.
  void close();

 private:
  /// An array of which nothing is in memory.
  struct Later {
    std::uint64_t at = 0;
    Content::Piece piece;
  };
  /// Makes an array that has its place. @returns where that is
  template <class T>
  std::uint64_t place(const std::string& path, std::size_t rows, std::size_t columns);

  std::int64_t file_ = -1;
  std::string name_;  // for messages
  std::shared_ptr<SparseBytes> memory_;
  std::vector<Later> later_;
  std::vector<std::function<void(const std::filesystem::path&)>> together_;
};

/// Reads a sealed file of ours, by `read_hdf5_layout`: HDF5 itself reads none. Every extent is
/// compared with the file's size before memory is taken.
class Hdf5Reader {
 public:
  /// @throws InputError for a file of another structure than Hdf5Writer makes.
  explicit Hdf5Reader(const std::filesystem::path& file);
  Hdf5Reader(const Hdf5Reader&) = delete;
  Hdf5Reader& operator=(const Hdf5Reader&) = delete;

  bool has(const std::string& path) const;
  /// Names in a group, sorted.
  std::vector<std::string> names(const std::string& group) const;
  /// Shape of an array; columns 0: one dimension.
  struct Shape {
    std::size_t rows = 0, columns = 0;
  };
  Shape shape(const std::string& path) const;
  bool is_integer(const std::string& path) const;

  /// @throws InputError if it is missing, of another shape or of another kind of number.
  template <class T>
  std::vector<T> array(const std::string& path, std::size_t columns = 0) const;
  /// Rows `begin` to `end` of it. @throws likewise
  template <class T>
  std::vector<T> rows(const std::string& path, std::size_t columns, std::size_t begin,
                      std::size_t end) const;
  std::vector<Vec3d> vectors(const std::string& path) const;
  std::vector<Vec3d> vectors(const std::string& path, std::size_t begin, std::size_t end) const;
  /// The names of what a group holds.
  std::vector<std::string> members(const std::string& group) const;
  /// Numbers [begin, end) of an array of one dimension. @throws InputError likewise
  std::vector<double> numbers(const std::string& path, std::size_t begin, std::size_t end) const;
  std::string text(const std::string& path) const;

  bool has_attribute(const std::string& path, const std::string& name) const;
  std::string text_attribute(const std::string& path, const std::string& name) const;
  std::int64_t integer_attribute(const std::string& path, const std::string& name) const;
  double number_attribute(const std::string& path, const std::string& name) const;

  /// An InputError that names the file.
  [[noreturn]] void refuse(const std::string& why) const;

 private:
  const Hdf5Value& array_at(const std::string& path) const;
  /// The attribute, which must be a single value of that kind, called `what` in messages.
  const Hdf5Value& attribute_at(const std::string& path, const std::string& name,
                                Hdf5Value::Kind kind, const char* what) const;
  std::string text_of(const Hdf5Value& value) const;

  FileBytes file_;
  std::map<std::string, Hdf5Object> objects_;
};

/// Of the library that is linked, e.g. "1.10.8".
std::string hdf5_version();

}  // namespace phyxel
