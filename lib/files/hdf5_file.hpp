/// The subset of HDF5 that phyxel uses: contiguous arrays, texts and attributes. Only this file,
/// hdf5_memory and mpi/parallel_file include hdf5.h.
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

/// Builder of one HDF5 file, in memory or on disk. T may be float, double, std::int32_t,
/// std::int64_t and std::uint8_t. The bytes depend only on the content: no times are stored. Paths
/// are absolute ("/VTKHDF/Points"); intermediate groups are created.
class Hdf5Writer {
 public:
  /// Begins a file in memory, except for arrays added by `later`, so that HDF5 never writes to a
  /// full disk.
  Hdf5Writer();
  /// Begins a file on disk, for files larger than memory, with `seal_size` bytes left free in
  /// front.
  explicit Hdf5Writer(const std::filesystem::path& file);
  ~Hdf5Writer();
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  void group(const std::string& path);
  /// Adds an array of shape [values], or [values / columns, columns] if `columns` is given.
  template <class T>
  void array(const std::string& path, std::span<const T> values, std::size_t columns = 0);
  /// Adds an array to a file in memory whose values are produced when the content is written, at
  /// most `stretch` rows at a time, by `fill(first row, values of some rows)`.
  template <class T>
  using Fill = std::function<void(std::size_t first, std::span<T> values)>;
  template <class T>
  void later(const std::string& path, std::size_t rows, std::size_t columns, std::size_t stretch,
             Fill<T> fill);
  /// Adds an array that `write(file)` writes collectively, after the layout and the other arrays.
  template <class T>
  void collectively(const std::string& path, std::size_t rows, std::size_t columns,
                    std::function<void(const std::filesystem::path& file)> write);
  /// Adds an array of vectors, of shape [n, 3], stored as float or double.
  void vectors(const std::string& path, std::span<const Vec3d> values, bool as_float);
  /// Adds a text; an empty one is not stored.
  void text(const std::string& path, const std::string& value);

  /// Adds an array to be filled by `rows`, of shape [rows] if `columns` is 0.
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

  /// Returns the finished file in memory; the writer must not be used afterwards.
  Content content();
  /// Finishes a file on disk. @throws OutputError
  void close();

 private:
  /// An array whose values are not in memory.
  struct Later {
    std::uint64_t at = 0;
    Content::Piece piece;
  };
  /// Creates an array and allocates its space in the file. @returns its offset [bytes]
  template <class T>
  std::uint64_t place(const std::string& path, std::size_t rows, std::size_t columns);

  std::int64_t file_ = -1;
  std::string name_;  // the file in error messages
  std::shared_ptr<SparseBytes> memory_;
  std::vector<Later> later_;
  std::vector<std::function<void(const std::filesystem::path&)>> together_;
};

/// Reader of sealed files, by `read_hdf5_layout` instead of HDF5. Each extent is compared with the
/// file's size before memory is allocated.
class Hdf5Reader {
 public:
  /// Opens a file. @throws InputError if its structure is not one that Hdf5Writer makes
  explicit Hdf5Reader(const std::filesystem::path& file);
  Hdf5Reader(const Hdf5Reader&) = delete;
  Hdf5Reader& operator=(const Hdf5Reader&) = delete;

  bool has(const std::string& path) const;
  /// Names of the members of a group, sorted.
  std::vector<std::string> names(const std::string& group) const;
  /// Shape of an array; `columns` is 0 for one dimension.
  struct Shape {
    std::size_t rows = 0, columns = 0;
  };
  Shape shape(const std::string& path) const;
  bool is_integer(const std::string& path) const;

  /// Reads an array. @throws InputError if it is missing, or has another shape or number type
  template <class T>
  std::vector<T> array(const std::string& path, std::size_t columns = 0) const;
  /// Reads rows `begin` to `end` of an array. @throws InputError in the same cases
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

  /// Throws an InputError that names the file.
  [[noreturn]] void refuse(const std::string& why) const;

 private:
  const Hdf5Value& array_at(const std::string& path) const;
  /// Finds an attribute, which must be a single value of a kind that messages call `what`.
  const Hdf5Value& attribute_at(const std::string& path, const std::string& name,
                                Hdf5Value::Kind kind, const char* what) const;
  std::string text_of(const Hdf5Value& value) const;

  FileBytes file_;
  std::map<std::string, Hdf5Object> objects_;
};

/// Version of the linked HDF5 library, e.g. "1.10.8".
std::string hdf5_version();

}  // namespace phyxel
