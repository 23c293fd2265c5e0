#include "files/hdf5_memory.hpp"

#include <hdf5.h>
#if H5_VERSION_GE(1, 13, 0)
#include <H5FDdevelop.h>
#endif

#include <algorithm>
#include <cstring>
#include <exception>

namespace phyxel {
namespace {

constexpr std::uint64_t page_size = 4096;

/// Calls `piece(page number, first byte in the page, first byte in the range, count)`.
template <class Piece>
void by_page(std::uint64_t at, std::size_t count, Piece&& piece) {
  for (std::size_t done = 0; done < count;) {
    const std::uint64_t in_page = (at + done) % page_size;
    const std::size_t some = std::min<std::size_t>(page_size - in_page, count - done);
    piece((at + done) / page_size, in_page, done, some);
    done += some;
  }
}

// --- A file driver of HDF5 ----------------------------------------------------------------------
struct Access {
  SparseBytes* bytes;
};
struct OpenFile {
  H5FD_t common;  // must be first: HDF5 accesses the object through it
  SparseBytes* bytes;
  haddr_t end_of_allocation;
};
OpenFile& opened(H5FD_t* file) { return *reinterpret_cast<OpenFile*>(file); }
const OpenFile& opened(const H5FD_t* file) { return *reinterpret_cast<const OpenFile*>(file); }

/// Runs `work` and turns its exceptions into an HDF5 error: none may pass through HDF5's C code.
template <class Work>
herr_t succeeds(Work&& work) {
  try {
    work();
    return 0;
  } catch (const std::exception&) {
    return -1;
  }
}

H5FD_t* open_file(const char*, unsigned flags, hid_t list, haddr_t) {
  const auto* access = static_cast<const Access*>(H5Pget_driver_info(list));
  if (!access) return nullptr;
  if (flags & H5F_ACC_TRUNC) access->bytes->resize(0);
  return &(new OpenFile{{}, access->bytes, 0})->common;
}
herr_t close_file(H5FD_t* file) {
  delete &opened(file);
  return 0;
}
/// The feature flags of HDF5's core driver, so that both give files the same layout.
herr_t features_of(const H5FD_t*, unsigned long* flags) {
  *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
           H5FD_FEAT_AGGREGATE_SMALLDATA;
  return 0;
}
haddr_t end_of_allocation(const H5FD_t* file, H5FD_mem_t) { return opened(file).end_of_allocation; }
herr_t set_end_of_allocation(H5FD_t* file, H5FD_mem_t, haddr_t end) {
  opened(file).end_of_allocation = end;
  return 0;
}
haddr_t end_of_file(const H5FD_t* file, H5FD_mem_t) { return opened(file).bytes->size(); }
herr_t read_bytes(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t at, std::size_t count, void* to) {
  opened(file).bytes->read(at, {static_cast<std::byte*>(to), count});
  return 0;
}
herr_t write_bytes(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t at, std::size_t count,
                   const void* from) {
  return succeeds([&] {
    opened(file).bytes->write(at, {static_cast<const std::byte*>(from), count});
  });
}
herr_t truncate(H5FD_t* file, hid_t, hbool_t) {
  return succeeds([&] { opened(file).bytes->resize(opened(file).end_of_allocation); });
}

H5FD_class_t driver_class() {
  H5FD_class_t driver{};
#if H5_VERSION_GE(1, 13, 0)
  driver.version = H5FD_CLASS_VERSION;
  driver.value = static_cast<H5FD_class_value_t>(H5_VFD_RESERVED + 1);
#endif
  driver.name = "phyxel_memory";
  driver.maxaddr = HADDR_MAX;
  driver.fc_degree = H5F_CLOSE_WEAK;
  driver.fapl_size = sizeof(Access);
  driver.open = open_file;
  driver.close = close_file;
  driver.query = features_of;
  driver.get_eoa = end_of_allocation;
  driver.set_eoa = set_end_of_allocation;
  driver.get_eof = end_of_file;
  driver.read = read_bytes;
  driver.write = write_bytes;
  driver.truncate = truncate;
  const H5FD_mem_t map[] = H5FD_FLMAP_DICHOTOMY;
  std::copy(std::begin(map), std::end(map), driver.fl_map);
  return driver;
}

}  // namespace

void SparseBytes::resize(std::uint64_t size) {
  size_ = size;
  pages_.erase(pages_.lower_bound((size + page_size - 1) / page_size), pages_.end());
  const auto last = pages_.find(size / page_size);
  if (last == pages_.end()) return;
  std::fill(last->second.begin() + static_cast<std::ptrdiff_t>(size % page_size),
            last->second.end(), std::byte{0});
}

void SparseBytes::write(std::uint64_t at, std::span<const std::byte> bytes) {
  by_page(at, bytes.size(),
          [&](std::uint64_t number, std::uint64_t first, std::size_t from, std::size_t count) {
            std::vector<std::byte>& page = pages_[number];
            page.resize(page_size);
            std::memcpy(page.data() + first, bytes.data() + from, count);
          });
  size_ = std::max(size_, at + bytes.size());
}

void SparseBytes::read(std::uint64_t at, std::span<std::byte> bytes) const {
  by_page(at, bytes.size(),
          [&](std::uint64_t number, std::uint64_t first, std::size_t to, std::size_t count) {
            const auto page = pages_.find(number);
            if (page == pages_.end()) {
              std::memset(bytes.data() + to, 0, count);
            } else {
              std::memcpy(bytes.data() + to, page->second.data() + first, count);
            }
          });
}

std::int64_t memory_access_list(SparseBytes& bytes) {
  static const H5FD_class_t driver = driver_class();
  static const hid_t registered = H5FDregister(&driver);
  const hid_t list = H5Pcreate(H5P_FILE_ACCESS);
  const Access access{&bytes};
  H5Pset_driver(list, registered, &access);
  return list;
}

}  // namespace phyxel
