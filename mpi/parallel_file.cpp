#include "mpi/parallel_file.hpp"

#include <fmt/format.h>
#include <hdf5.h>
#include <mpi.h>
#include <unistd.h>

#include <algorithm>

#include "mpi/heartbeat.hpp"
#include "mpi/native.hpp"

namespace phyxel {
namespace {

/// A file that all ranks have open. The destructor does not close it: after an error that would
/// hang.
class SharedFile {
 public:
  SharedFile(const MpiCommunicator& ranks, const std::string& file, const std::string& path)
      : ranks_(ranks), name_(file), path_(path) {
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_fapl_mpio(access, ranks.native()->all, MPI_INFO_NULL);
    H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_V18);
    H5Pset_all_coll_metadata_ops(access, true);
    H5Pset_coll_metadata_write(access, true);
    file_ = H5Fopen(file.c_str(), H5F_ACC_RDWR, access);
    demand(file_ >= 0);
    array_ = H5Dopen2(file_, path.c_str(), H5P_DEFAULT);
    demand(array_ >= 0);
    H5Pclose(access);
    transfer_ = H5Pcreate(H5P_DATASET_XFER);
    H5Pset_dxpl_mpio(transfer_, H5FD_MPIO_COLLECTIVE);
  }

  template <class T>
  void write(hid_t type, std::size_t width, RowRange rows, const std::vector<double>& values) {
    const std::vector<T> stored(values.begin(), values.end());
    const int dimensions = width > 1 ? 2 : 1;
    const hsize_t start[2] = {static_cast<hsize_t>(rows.begin), 0};
    const hsize_t count[2] = {static_cast<hsize_t>(rows.end - rows.begin), width};
    const hid_t all = H5Dget_space(array_), some = H5Screate_simple(dimensions, count, nullptr);
    if (rows.begin < rows.end) {
      H5Sselect_hyperslab(all, H5S_SELECT_SET, start, nullptr, count, nullptr);
    } else {
      H5Sselect_none(all);
      H5Sselect_none(some);
    }
    demand(H5Dwrite(array_, type, some, all, transfer_, stored.data()) >= 0);
    H5Sclose(some);
    H5Sclose(all);
  }

  void close() {
    H5Pclose(transfer_);
    H5Dclose(array_);
    demand(H5Fflush(file_, H5F_SCOPE_LOCAL) >= 0);
    demand(H5Fclose(file_) >= 0);
  }

 private:
  void demand(bool good) const {
    if (ranks_.smallest(std::int64_t{good}) == 1) return;
    if (ranks_.rank() == 0) {
      throw OutputError(fmt::format("{}: {} could not be written collectively", name_, path_));
    }
    ranks_.barrier();  // waits until the first rank ends all
  }

  const MpiCommunicator& ranks_;
  std::string name_, path_;
  hid_t file_ = -1, array_ = -1, transfer_ = -1;
};

}  // namespace

bool can_write_collectively() { return H5open() >= 0; }

void write_collectively(const MpiCommunicator& ranks, const std::string& file,
                        const FileArray& array, Index length, const RowsOf& rows) {
  // Checked before HDF5 opens the file, which would hang if one rank could not.
  ranks.collectively([&] {
    if (::access(file.c_str(), R_OK | W_OK) == 0) return;
    throw OutputError(fmt::format(
        "{}: cannot be opened by all ranks; allowed: a folder on a shared file system", file));
  });
  SharedFile out(ranks, file, array.path);
  const std::size_t width = width_of(array.terms[0]);
  std::vector<RowRange> of_ranks(static_cast<std::size_t>(ranks.size()));
  for (std::int64_t at = 0; at < array.count;) {
    for (RowRange& rows_of : of_ranks) {
      rows_of.begin = static_cast<Index>(at);
      rows_of.end = static_cast<Index>(at = std::min<std::int64_t>(array.count, at + length));
    }
    const std::vector<double> values = rows(of_ranks);
    const RowRange own = of_ranks[static_cast<std::size_t>(ranks.rank())];
    const Waiting waiting;
    if (array.as_float) {
      out.write<float>(H5T_NATIVE_FLOAT, width, own, values);
    } else {
      out.write<double>(H5T_NATIVE_DOUBLE, width, own, values);
    }
  }
  out.close();
}

}  // namespace phyxel
