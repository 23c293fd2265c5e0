/// Collective writing of the arrays of an HDF5 file.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "mpi/communicator.hpp"
#include "mpi/row_redistribution.hpp"

namespace phyxel {

/// Returns true if HDF5 is parallel, and then initialises HDF5, which calls MPI.
bool can_write_collectively();

/// Returns the rows that this rank writes next, row by row, from the range of each rank.
/// Collective.
using RowsOf = std::function<std::vector<double>(std::span<const RowRange> of_ranks)>;

/// Writes an array whose disk space is allocated, since MPI-IO may hang on a full disk. Each rank
/// writes ranges of at most `length` rows, one after the other. Collective.
/// @param file must have its layout, which HDF5 may change and the caller must restore
/// @throws AgreedError if a rank cannot open the file
/// @throws OutputError on the first rank, which must then end all ranks: a parallel file that could
///   not be written cannot be closed
void write_collectively(const MpiCommunicator& ranks, const std::string& file,
                        const FileArray& array, Index length, const RowsOf& rows);

}  // namespace phyxel
