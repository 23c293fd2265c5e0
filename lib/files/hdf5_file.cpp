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

/// An HDF5 identifier with RAII.
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

/// Turns off HDF5's printing of its error stack; phyxel's messages replace it.
void quiet() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

/// Property list for objects without time stamps, with creation of intermediate groups.
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

/// Selects the version of the file format that ParaView 5.10 reads.
void set_versions(hid_t access) {
  H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_V18);
}

/// Producer of a range of the layout.
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
void Hdf5Writer::collectively(const std::string& path, std::size_t rows, std::size_t columns,
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
    content.write_collectively = [all = std::move(together_)](const std::filesystem::path& file) {
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

#define PHYXEL_HDF5_TYPE(T)                                                                     \
  template void Hdf5Writer::array<T>(const std::string&, std::span<const T>, std::size_t);      \
  template void Hdf5Writer::collectively<T>(const std::string&, std::size_t, std::size_t,       \
                                            std::function<void(const std::filesystem::path&)>); \
  template void Hdf5Writer::later<T>(const std::string&, std::size_t, std::size_t, std::size_t, \
                                     Fill<T>);                                                  \
  template void Hdf5Writer::reserve<T>(const std::string&, std::size_t, std::size_t);           \
  template void Hdf5Writer::rows<T>(const std::string&, std::size_t, std::span<const T>,        \
                                    std::size_t);
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
