#include "files/hdf5_file.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <type_traits>

#include "files/hdf5_memory.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

/// An HDF5 identifier that closes itself.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle(hid_t id, Close close) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }
  bool good() const { return id_ >= 0; }
  hid_t release() {
    const hid_t id = id_;
    id_ = -1;
    return id;
  }

 private:
  hid_t id_;
  Close close_;
};

template <class T>
hid_t type_of() {
  if constexpr (std::is_same_v<T, float>) return H5T_NATIVE_FLOAT;
  if constexpr (std::is_same_v<T, double>) return H5T_NATIVE_DOUBLE;
  if constexpr (std::is_same_v<T, std::int32_t>) return H5T_NATIVE_INT32;
  if constexpr (std::is_same_v<T, std::int64_t>) return H5T_NATIVE_INT64;
  if constexpr (std::is_same_v<T, std::uint8_t>) return H5T_NATIVE_UINT8;
}

/// HDF5 prints its error stack to stderr unless told not to; our messages replace it.
void quiet() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

/// Property list for objects without time stamps, with the groups on the way made.
hid_t link_list() {
  const hid_t list = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(list, 1);
  return list;
}

Handle text_type(std::size_t length) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, length);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  return {type, H5Tclose};
}

Handle space_of(std::size_t rows, std::size_t columns) {
  const hsize_t extent[2] = {rows, columns};
  return {H5Screate_simple(columns > 0 ? 2 : 1, extent, nullptr), H5Sclose};
}

void demand(bool good, const std::string& file, const std::string& what) {
  if (!good) throw OutputError(fmt::format("{}: {} could not be written", file, what));
}

hid_t make_array(hid_t file, const std::string& path, hid_t type, hid_t space,
                 const std::string& name) {
  const Handle links(link_list(), H5Pclose);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(properties, false);
  H5Pset_fill_time(properties, H5D_FILL_TIME_NEVER);
  const hid_t array = H5Dcreate2(file, path.c_str(), type, space, links, properties, H5P_DEFAULT);
  demand(array >= 0, name, path);
  return array;
}

void put_attribute(hid_t file, const std::string& path, const std::string& attribute, hid_t type,
                   hid_t space, const void* value, const std::string& name) {
  const Handle object(H5Oopen(file, path.c_str(), H5P_DEFAULT), H5Oclose);
  const Handle handle(
      object.good() ? H5Acreate2(object, attribute.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT)
                    : -1,
      H5Aclose);
  demand(handle.good() && H5Awrite(handle, type, value) >= 0, name, path + "@" + attribute);
}

/// What every ParaView reads.
void set_versions(hid_t access) {
  H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_V18);
}

/// Hands over a stretch of the layout.
std::function<void(const Content::Sink&)> from_memory(std::shared_ptr<const SparseBytes> memory,
                                                      std::uint64_t begin, std::uint64_t end) {
  return [=, memory = std::move(memory)](const Content::Sink& sink) {
    std::vector<std::byte> some;
    for (std::uint64_t at = begin; at < end; at += some.size()) {
      some.resize(std::min<std::uint64_t>(end - at, std::uint64_t{1} << 20));
      memory->read(at, some);
      sink(some);
    }
  };
}

}  // namespace

// --- Writing ------------------------------------------------------------------------------------
Hdf5Writer::Hdf5Writer() : name_("HDF5 file in memory"), memory_(std::make_shared<SparseBytes>()) {
  quiet();
  const Handle access(memory_access_list(*memory_), H5Pclose);
  set_versions(access);
  file_ = H5Fcreate("phyxel", H5F_ACC_TRUNC, H5P_DEFAULT, access);
  demand(file_ >= 0, name_, "the file");
}

Hdf5Writer::Hdf5Writer(const std::filesystem::path& file) : name_(file.string()) {
  quiet();
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  set_versions(access);
  const Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  H5Pset_userblock(creation, seal_size);
  file_ = H5Fcreate(file.c_str(), H5F_ACC_TRUNC, creation, access);
  demand(file_ >= 0, name_, "the file");
}

Hdf5Writer::~Hdf5Writer() {
  if (file_ >= 0) H5Fclose(file_);
}

void Hdf5Writer::group(const std::string& path) {
  const Handle links(link_list(), H5Pclose);
  const Handle properties(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
  H5Pset_obj_track_times(properties, false);
  const Handle made(H5Gcreate2(file_, path.c_str(), links, properties, H5P_DEFAULT), H5Gclose);
  demand(made.good(), name_, path);
}

template <class T>
void Hdf5Writer::array(const std::string& path, std::span<const T> values, std::size_t columns) {
  reserve<T>(path, columns > 0 ? values.size() / columns : values.size(), columns);
  if (!values.empty()) rows<T>(path, 0, values, columns);
}

template <class T>
std::uint64_t Hdf5Writer::place(const std::string& path, std::size_t rows, std::size_t columns) {
  reserve<T>(path, rows, columns);
  this->rows<T>(path, 0, std::vector<T>(std::max<std::size_t>(columns, 1)), columns);
  const Handle array(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
  const haddr_t at = H5Dget_offset(array);
  demand(at != HADDR_UNDEF, name_, path);
  return at;
}

template <class T>
void Hdf5Writer::later(const std::string& path, std::size_t rows, std::size_t columns,
                       std::size_t stretch, Fill<T> fill) {
  if (rows == 0) return reserve<T>(path, rows, columns);
  const std::size_t width = std::max<std::size_t>(columns, 1);
  const auto produce = [=, fill = std::move(fill)](const Content::Sink& sink) {
    std::vector<T> values;
    for (std::size_t first = 0; first < rows; first += stretch) {
      values.resize(width * std::min(stretch, rows - first));
      fill(first, values);
      sink(std::as_bytes(std::span(values)));
    }
  };
  later_.push_back({place<T>(path, rows, columns), {rows * width * sizeof(T), produce}});
}

template <class T>
void Hdf5Writer::together(const std::string& path, std::size_t rows, std::size_t columns,
                          std::function<void(const std::filesystem::path& file)> write) {
  const std::size_t bytes = rows * std::max<std::size_t>(columns, 1) * sizeof(T);
  later_.push_back({place<T>(path, rows, columns), {bytes, nullptr}});
  together_.push_back(std::move(write));
}

void Hdf5Writer::vectors(const std::string& path, std::span<const Vec3d> values, bool as_float) {
  const std::span<const double> flat(values.empty() ? nullptr : &values.front().x,
                                     3 * values.size());
  if (!as_float) return array<double>(path, flat, 3);
  array<float>(path, std::vector<float>(flat.begin(), flat.end()), 3);
}

void Hdf5Writer::text(const std::string& path, const std::string& value) {
  if (value.empty()) return;
  const Handle type = text_type(value.size());
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle array(make_array(file_, path, type, space, name_), H5Dclose);
  demand(H5Dwrite(array, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, value.data()) >= 0, name_, path);
}

template <class T>
void Hdf5Writer::reserve(const std::string& path, std::size_t rows, std::size_t columns) {
  const Handle space = space_of(rows, columns);
  const Handle made(make_array(file_, path, type_of<T>(), space, name_), H5Dclose);
}

template <class T>
void Hdf5Writer::rows(const std::string& path, std::size_t first, std::span<const T> values,
                      std::size_t columns) {
  const Handle array(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
  const Handle whole(array.good() ? H5Dget_space(array) : -1, H5Sclose);
  const hsize_t start[2] = {first, 0};
  const hsize_t count[2] = {columns > 0 ? values.size() / columns : values.size(), columns};
  const Handle part(H5Screate_simple(columns > 0 ? 2 : 1, count, nullptr), H5Sclose);
  demand(whole.good() &&
             H5Sselect_hyperslab(whole, H5S_SELECT_SET, start, nullptr, count, nullptr) >= 0 &&
             H5Dwrite(array, type_of<T>(), part, whole, H5P_DEFAULT, values.data()) >= 0,
         name_, path);
}

void Hdf5Writer::attribute(const std::string& path, const std::string& name,
                           const std::string& value) {
  const std::string stored =
      value.empty() ? std::string(" ") : value;  // HDF5 has no text of length 0
  const Handle type = text_type(stored.size());
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  put_attribute(file_, path, name, type, space, stored.data(), name_);
}

void Hdf5Writer::attribute(const std::string& path, const std::string& name, std::int64_t value) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  put_attribute(file_, path, name, H5T_NATIVE_INT64, space, &value, name_);
}

void Hdf5Writer::attribute(const std::string& path, const std::string& name, double value) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  put_attribute(file_, path, name, H5T_NATIVE_DOUBLE, space, &value, name_);
}

void Hdf5Writer::attribute(const std::string& path, const std::string& name,
                           std::span<const std::int64_t> values) {
  const Handle space = space_of(values.size(), 0);
  put_attribute(file_, path, name, H5T_NATIVE_INT64, space, values.data(), name_);
}

void Hdf5Writer::attribute(const std::string& path, const std::string& name,
                           std::span<const double> values) {
  const Handle space = space_of(values.size(), 0);
  put_attribute(file_, path, name, H5T_NATIVE_DOUBLE, space, values.data(), name_);
}

Content Hdf5Writer::content() {
  close();
  std::sort(later_.begin(), later_.end(),
            [](const Later& a, const Later& b) { return a.at < b.at; });
  Content content{memory_->size(), {}, nullptr};
  std::uint64_t done = 0;
  const auto add_layout = [&](std::uint64_t end) {
    content.pieces.push_back({end - done, from_memory(memory_, done, end), true});
    done = end;
  };
  for (Later& array : later_) {
    add_layout(array.at);
    done += array.piece.bytes;
    content.pieces.push_back(std::move(array.piece));
  }
  add_layout(content.size);
  if (!together_.empty()) {
    content.write_together = [all = std::move(together_)](const std::filesystem::path& file) {
      for (const auto& write : all) write(file);
    };
  }
  return content;
}

void Hdf5Writer::close() {
  const bool good = H5Fclose(file_) >= 0;
  file_ = -1;
  demand(good, name_, "the file");
}

// --- Reading ------------------------------------------------------------------------------------
Hdf5Reader::Hdf5Reader(const std::filesystem::path& file) : path_(file) {
  quiet();
  std::error_code ignored;
  size_ = std::filesystem::file_size(file, ignored);
  file_ = H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  if (file_ < 0) refuse("not an HDF5 file that can be read");
}

Hdf5Reader::~Hdf5Reader() {
  if (file_ >= 0) H5Fclose(file_);
}

void Hdf5Reader::refuse(const std::string& why) const {
  throw InputError(fmt::format("{}: {}", path_.string(), why));
}

bool Hdf5Reader::has(const std::string& path) const {
  // Every link on the way must be a hard one: soft and external links lead out of the file.
  for (std::size_t end = path.find('/', 1);; end = path.find('/', end + 1)) {
    const std::string part = path.substr(0, end);
    H5L_info_t info;
    if (H5Lget_info(file_, part.c_str(), &info, H5P_DEFAULT) < 0 || info.type != H5L_TYPE_HARD) {
      return false;
    }
    if (end == std::string::npos) return true;
  }
}

std::vector<std::string> Hdf5Reader::names(const std::string& group) const {
  if (!has(group)) return {};
  std::vector<std::string> found;
  const auto collect = [](hid_t, const char* name, const H5L_info_t*, void* list) -> herr_t {
    static_cast<std::vector<std::string>*>(list)->emplace_back(name);
    return 0;
  };
  const Handle handle(H5Gopen2(file_, group.c_str(), H5P_DEFAULT), H5Gclose);
  if (!handle.good() ||
      H5Literate(handle, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect, &found) < 0) {
    refuse(group + " is not a group that can be read");
  }
  return found;
}

std::int64_t Hdf5Reader::open_array(const std::string& path) const {
  if (!has(path)) refuse(path + " is missing");
  Handle array(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (!array.good()) refuse(path + " is not an array");
  const Handle properties(H5Dget_create_plist(array), H5Pclose);
  if (H5Pget_layout(properties) != H5D_CONTIGUOUS || H5Pget_external_count(properties) != 0) {
    refuse(path + " is not stored as one contiguous block");
  }
  const Handle type(H5Dget_type(array), H5Tclose);
  const Handle space(H5Dget_space(array), H5Sclose);
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  const std::size_t width = H5Tget_size(type);
  if (count < 0 || width == 0 || static_cast<std::uintmax_t>(count) > size_ / width) {
    refuse(fmt::format("{} claims {} entries of {} bytes, more than the file holds", path, count,
                       width));
  }
  return array.release();
}

Hdf5Reader::Shape Hdf5Reader::shape(const std::string& path) const {
  const Handle array(open_array(path), H5Dclose);
  const Handle space(H5Dget_space(array), H5Sclose);
  hsize_t extent[2] = {0, 0};
  const int rank = H5Sget_simple_extent_ndims(space);
  if (rank < 1 || rank > 2)
    refuse(fmt::format("{} has {} dimensions; expected 1 or 2", path, rank));
  H5Sget_simple_extent_dims(space, extent, nullptr);
  return {static_cast<std::size_t>(extent[0]), rank == 2 ? static_cast<std::size_t>(extent[1]) : 0};
}

bool Hdf5Reader::is_integer(const std::string& path) const {
  const Handle array(open_array(path), H5Dclose);
  const Handle type(H5Dget_type(array), H5Tclose);
  return H5Tget_class(type) == H5T_INTEGER;
}

template <class T>
std::vector<T> Hdf5Reader::array(const std::string& path, std::size_t columns) const {
  return rows<T>(path, columns, 0, shape(path).rows);
}

template <class T>
std::vector<T> Hdf5Reader::rows(const std::string& path, std::size_t columns, std::size_t begin,
                                std::size_t end) const {
  const Shape found = shape(path);
  if (found.columns != columns) {
    refuse(fmt::format("{} has shape [{}, {}]; expected {}", path, found.rows, found.columns,
                       columns > 0 ? fmt::format("[n, {}]", columns) : "[n]"));
  }
  if (is_integer(path) != std::is_integral_v<T>) {
    refuse(fmt::format("{} does not hold {}", path, std::is_integral_v<T> ? "integers" : "reals"));
  }
  if (begin > end || end > found.rows) {
    refuse(fmt::format("{} has {} rows; wanted are {} to {}", path, found.rows, begin, end));
  }
  const Handle array(open_array(path), H5Dclose);
  std::vector<T> values((end - begin) * std::max<std::size_t>(columns, 1));
  if (values.empty()) return values;
  const Handle whole(H5Dget_space(array), H5Sclose);
  const Handle part = space_of(end - begin, columns);
  const hsize_t start[2] = {begin, 0}, count[2] = {end - begin, columns};
  if (H5Sselect_hyperslab(whole, H5S_SELECT_SET, start, nullptr, count, nullptr) < 0 ||
      H5Dread(array, type_of<T>(), part, whole, H5P_DEFAULT, values.data()) < 0) {
    refuse(path + " cannot be read");
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

std::string Hdf5Reader::text(const std::string& path) const {
  if (!has(path)) return "";
  const Handle array(open_array(path), H5Dclose);
  const Handle type(H5Dget_type(array), H5Tclose);
  const Handle space(H5Dget_space(array), H5Sclose);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0 ||
      H5Sget_simple_extent_npoints(space) != 1) {
    refuse(path + " is not a text of fixed length");
  }
  std::string value(H5Tget_size(type), '\0');
  if (H5Dread(array, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, value.data()) < 0)
    refuse(path + " cannot be read");
  return value;
}

bool Hdf5Reader::has_attribute(const std::string& path, const std::string& name) const {
  return has(path) && H5Aexists_by_name(file_, path.c_str(), name.c_str(), H5P_DEFAULT) > 0;
}

std::int64_t Hdf5Reader::open_attribute(const std::string& path, const std::string& name) const {
  if (!has_attribute(path, name))
    refuse(fmt::format("the attribute {} of {} is missing", name, path));
  Handle attribute(H5Aopen_by_name(file_, path.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT),
                   H5Aclose);
  const Handle space(attribute.good() ? H5Aget_space(attribute) : -1, H5Sclose);
  if (!space.good() || H5Sget_simple_extent_npoints(space) != 1) {
    refuse(fmt::format("the attribute {} of {} is not a single value", name, path));
  }
  return attribute.release();
}

std::string Hdf5Reader::text_attribute(const std::string& path, const std::string& name) const {
  const Handle attribute(open_attribute(path, name), H5Aclose);
  const Handle type(H5Aget_type(attribute), H5Tclose);
  const std::size_t length = H5Tget_size(type);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0 || length > size_) {
    refuse(fmt::format("the attribute {} of {} is not a text of fixed length", name, path));
  }
  std::string value(length, '\0');
  if (H5Aread(attribute, type, value.data()) < 0)
    refuse(fmt::format("the attribute {} cannot be read", name));
  return value == " " ? "" : value;
}

std::int64_t Hdf5Reader::integer_attribute(const std::string& path, const std::string& name) const {
  const Handle attribute(open_attribute(path, name), H5Aclose);
  const Handle type(H5Aget_type(attribute), H5Tclose);
  std::int64_t value = 0;
  if (H5Tget_class(type) != H5T_INTEGER || H5Aread(attribute, H5T_NATIVE_INT64, &value) < 0) {
    refuse(fmt::format("the attribute {} of {} is not an integer", name, path));
  }
  return value;
}

double Hdf5Reader::number_attribute(const std::string& path, const std::string& name) const {
  const Handle attribute(open_attribute(path, name), H5Aclose);
  const Handle type(H5Aget_type(attribute), H5Tclose);
  double value = 0;
  if (H5Tget_class(type) != H5T_FLOAT || H5Aread(attribute, H5T_NATIVE_DOUBLE, &value) < 0) {
    refuse(fmt::format("the attribute {} of {} is not a real", name, path));
  }
  return value;
}

#define PHYXEL_HDF5_TYPE(T)                                                                     \
  template void Hdf5Writer::array<T>(const std::string&, std::span<const T>, std::size_t);      \
  template void Hdf5Writer::together<T>(const std::string&, std::size_t, std::size_t,           \
                                        std::function<void(const std::filesystem::path&)>);     \
  template void Hdf5Writer::later<T>(const std::string&, std::size_t, std::size_t, std::size_t, \
                                     Fill<T>);                                                  \
  template void Hdf5Writer::reserve<T>(const std::string&, std::size_t, std::size_t);           \
  template void Hdf5Writer::rows<T>(const std::string&, std::size_t, std::span<const T>,        \
                                    std::size_t);                                               \
  template std::vector<T> Hdf5Reader::array<T>(const std::string&, std::size_t) const;          \
  template std::vector<T> Hdf5Reader::rows<T>(const std::string&, std::size_t, std::size_t,     \
                                              std::size_t) const;
PHYXEL_HDF5_TYPE(float)
PHYXEL_HDF5_TYPE(double)
PHYXEL_HDF5_TYPE(std::int32_t)
PHYXEL_HDF5_TYPE(std::int64_t)
PHYXEL_HDF5_TYPE(std::uint8_t)
#undef PHYXEL_HDF5_TYPE

std::string hdf5_version() {
  unsigned major = 0, minor = 0, release = 0;
  H5get_libversion(&major, &minor, &release);
  return fmt::format("{}.{}.{}", major, minor, release);
}

}  // namespace phyxel
