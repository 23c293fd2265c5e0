#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include "files/hdf5_file.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

using Kind = Hdf5Value::Kind;

/// Number of values converted at a time.
constexpr std::uint64_t some_numbers = 1 << 16;

/// Converts stored numbers to T. @returns false if one is out of T's range
template <class Stored, class T>
bool convert(const std::vector<std::byte>& bytes, std::span<T> values) {
  for (std::size_t k = 0; k < values.size(); ++k) {
    Stored stored;
    std::memcpy(&stored, bytes.data() + k * sizeof stored, sizeof stored);
    if constexpr (std::is_integral_v<T>) {
      if (!std::in_range<T>(stored)) return false;
    }
    values[k] = static_cast<T>(stored);
  }
  return true;
}

/// Converts numbers of the file's type to T. @returns false if one is out of T's range
template <class T>
bool convert_stored(const Hdf5Value& value, const std::vector<std::byte>& bytes,
                    std::span<T> values) {
  if constexpr (std::is_floating_point_v<T>) {
    return value.width == 4 ? convert<float>(bytes, values) : convert<double>(bytes, values);
  } else {
    if (value.width == 1) return convert<std::uint8_t>(bytes, values);
    return value.width == 4 ? convert<std::int32_t>(bytes, values)
                            : convert<std::int64_t>(bytes, values);
  }
}

}  // namespace

Hdf5Reader::Hdf5Reader(const std::filesystem::path& file)
    : file_(file.string()), objects_(read_hdf5_layout(file_)) {}

void Hdf5Reader::refuse(const std::string& why) const { file_.refuse(why); }

bool Hdf5Reader::has(const std::string& path) const { return objects_.count(path) > 0; }

std::vector<std::string> Hdf5Reader::names(const std::string& group) const {
  if (!has(group)) return {};
  if (!objects_.at(group).is_group) refuse(group + " is not a group");
  std::vector<std::string> found;
  const std::string before = group + '/';
  for (auto at = objects_.lower_bound(before); at != objects_.end(); ++at) {
    if (!at->first.starts_with(before)) break;
    const std::string name = at->first.substr(before.size());
    if (name.find('/') == name.npos) found.push_back(name);
  }
  return found;
}

const Hdf5Value& Hdf5Reader::array_at(const std::string& path) const {
  const auto found = objects_.find(path);
  if (found == objects_.end()) refuse(path + " is missing");
  if (found->second.is_group) refuse(path + " is not an array");
  return found->second.value;
}

Hdf5Reader::Shape Hdf5Reader::shape(const std::string& path) const {
  const Hdf5Value& value = array_at(path);
  if (value.extent.empty()) refuse(path + " has 0 dimensions; expected 1 or 2");
  return {value.extent[0], value.extent.size() > 1 ? value.extent[1] : 0};
}

bool Hdf5Reader::is_integer(const std::string& path) const {
  return array_at(path).kind == Kind::integer;
}

template <class T>
std::vector<T> Hdf5Reader::array(const std::string& path, std::size_t columns) const {
  return rows<T>(path, columns, 0, shape(path).rows);
}

template <class T>
std::vector<T> Hdf5Reader::rows(const std::string& path, std::size_t columns, std::size_t begin,
                                std::size_t end) const {
  const Shape found = shape(path);
  const Hdf5Value& value = array_at(path);
  if (found.columns != columns || value.extent.size() != (columns > 0 ? 2 : 1)) {
    refuse(fmt::format("{} has shape [{}, {}]; expected {}", path, found.rows, found.columns,
                       columns > 0 ? fmt::format("[n, {}]", columns) : "[n]"));
  }
  if (value.kind != (std::is_integral_v<T> ? Kind::integer : Kind::real)) {
    refuse(fmt::format("{} does not hold {}", path, std::is_integral_v<T> ? "integers" : "reals"));
  }
  if (begin > end || end > found.rows) {
    refuse(fmt::format("{} has {} rows; wanted are {} to {}", path, found.rows, begin, end));
  }
  const std::size_t wide = std::max<std::size_t>(columns, 1);
  std::vector<T> values((end - begin) * wide);
  std::uint64_t at = value.at + begin * wide * value.width;
  std::vector<std::byte> bytes;
  for (std::size_t done = 0; done < values.size();) {
    const std::size_t some = std::min<std::size_t>(some_numbers, values.size() - done);
    bytes.resize(some * value.width);
    file_.read(at, bytes.size(), bytes.data());
    if (!convert_stored<T>(value, bytes, std::span(values).subspan(done, some))) {
      refuse(fmt::format("{} holds a number beyond {} bits", path, 8 * sizeof(T)));
    }
    done += some;
    at += bytes.size();
  }
  return values;
}

std::vector<Vec3d> Hdf5Reader::vectors(const std::string& path) const {
  return vectors(path, 0, shape(path).rows);
}

std::vector<Vec3d> Hdf5Reader::vectors(const std::string& path, std::size_t begin,
                                       std::size_t end) const {
  const std::vector<double> flat = rows<double>(path, 3, begin, end);
  std::vector<Vec3d> values(flat.size() / 3);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = {flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]};
  return values;
}

std::vector<std::string> Hdf5Reader::members(const std::string& group) const {
  std::vector<std::string> names;
  const std::string prefix = group + "/";
  for (const auto& [path, object] : objects_) {
    if (path.size() > prefix.size() && path.compare(0, prefix.size(), prefix) == 0 &&
        path.find('/', prefix.size()) == std::string::npos) {
      names.push_back(path.substr(prefix.size()));
    }
  }
  return names;
}

std::vector<double> Hdf5Reader::numbers(const std::string& path, std::size_t begin,
                                        std::size_t end) const {
  return rows<double>(path, 0, begin, end);
}

std::string Hdf5Reader::text_of(const Hdf5Value& value) const {
  std::string text(value.width, '\0');
  file_.read(value.at, value.width, text.data());
  return text;
}

std::string Hdf5Reader::text(const std::string& path) const {
  if (!has(path)) return "";
  const Hdf5Value& value = array_at(path);
  if (value.kind != Kind::text || value.count() != 1)
    refuse(path + " is not a text of fixed length");
  return text_of(value);
}

bool Hdf5Reader::has_attribute(const std::string& path, const std::string& name) const {
  return has(path) && objects_.at(path).attributes.count(name) > 0;
}

const Hdf5Value& Hdf5Reader::attribute_at(const std::string& path, const std::string& name,
                                          Kind kind, const char* what) const {
  if (!has_attribute(path, name))
    refuse(fmt::format("the attribute {} of {} is missing", name, path));
  const Hdf5Value& value = objects_.at(path).attributes.at(name);
  if (value.count() != 1)
    refuse(fmt::format("the attribute {} of {} is not a single value", name, path));
  if (value.kind != kind) refuse(fmt::format("the attribute {} of {} is not {}", name, path, what));
  return value;
}

std::string Hdf5Reader::text_attribute(const std::string& path, const std::string& name) const {
  const std::string value = text_of(attribute_at(path, name, Kind::text, "a text of fixed length"));
  return value == " " ? "" : value;
}

std::int64_t Hdf5Reader::integer_attribute(const std::string& path, const std::string& name) const {
  const Hdf5Value& value = attribute_at(path, name, Kind::integer, "an integer");
  std::vector<std::byte> bytes(value.width);
  file_.read(value.at, value.width, bytes.data());
  std::int64_t number = 0;
  convert_stored<std::int64_t>(value, bytes, {&number, 1});
  return number;
}

double Hdf5Reader::number_attribute(const std::string& path, const std::string& name) const {
  const Hdf5Value& value = attribute_at(path, name, Kind::real, "a real");
  std::vector<std::byte> bytes(value.width);
  file_.read(value.at, value.width, bytes.data());
  double number = 0;
  convert_stored<double>(value, bytes, {&number, 1});
  return number;
}

#define PHYXEL_HDF5_TYPE(T)                                                                 \
  template std::vector<T> Hdf5Reader::array<T>(const std::string&, std::size_t) const;      \
  template std::vector<T> Hdf5Reader::rows<T>(const std::string&, std::size_t, std::size_t, \
                                              std::size_t) const;
PHYXEL_HDF5_TYPE(float)
PHYXEL_HDF5_TYPE(double)
PHYXEL_HDF5_TYPE(std::int32_t)
PHYXEL_HDF5_TYPE(std::int64_t)
PHYXEL_HDF5_TYPE(std::uint8_t)
#undef PHYXEL_HDF5_TYPE

}  // namespace phyxel
