/// The little of HDF5 that phyxel needs: contiguous arrays, texts and attributes. The C API behind
/// two classes; nothing else in the project includes hdf5.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// Builds one HDF5 file, in memory or on disk. T may be float, double, std::int32_t, std::int64_t
/// and std::uint8_t. The bytes depend only on the content: no times are stored. Paths are absolute
/// ("/VTKHDF/Points"); groups on the way are made.
class Hdf5Writer {
 public:
  /// In memory, so that a full disk never meets HDF5.
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

  /// The finished file; the writer is spent.
  std::vector<std::byte> image();
  /// Finishes a file on disk. @throws OutputError.
  void close();

 private:
  std::int64_t file_ = -1;
  std::string name_;  // for messages
};

/// Reads an HDF5 file whose seal has been checked. Every extent is compared with the file's size
/// before memory is taken, and only plain things are followed: hard links, contiguous arrays
/// without filters.
class Hdf5Reader {
 public:
  /// @throws InputError.
  explicit Hdf5Reader(const std::filesystem::path& file);
  ~Hdf5Reader();
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
  std::vector<Vec3d> vectors(const std::string& path) const;
  std::string text(const std::string& path) const;

  bool has_attribute(const std::string& path, const std::string& name) const;
  std::string text_attribute(const std::string& path, const std::string& name) const;
  std::int64_t integer_attribute(const std::string& path, const std::string& name) const;
  double number_attribute(const std::string& path, const std::string& name) const;

  /// An InputError that names the file.
  [[noreturn]] void refuse(const std::string& why) const;

 private:
  std::int64_t open_array(const std::string& path) const;
  std::int64_t open_attribute(const std::string& path, const std::string& name) const;

  std::filesystem::path path_;
  std::uintmax_t size_ = 0;
  std::int64_t file_ = -1;
};

/// Of the library that is linked, e.g. "1.10.8".
std::string hdf5_version();

}  // namespace phyxel
