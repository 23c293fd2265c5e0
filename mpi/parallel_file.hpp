/// Arrays of one HDF5 file, written by all ranks at once.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "mpi/communicator.hpp"
#include "mpi/row_redistribution.hpp"

namespace phyxel {

/// Whether HDF5 is a parallel one. Then it starts here, if it has not yet, and talks to MPI.
bool can_write_collectively();

/// What each rank writes of an array next: its values, one row after the other. Collective.
using RowsOf = std::function<std::vector<double>(std::span<const RowRange> of_ranks)>;

/// Writes an array whose place is taken on the disk, since MPI-IO may hang on a full one; each rank
/// takes stretches of at most `length` rows, one after the other. Collective.
/// @param file must be laid out; what tells where arrays are may be changed, and is to be restored
/// @throws AgreedError if a rank does not see it; OutputError on the first rank, whereupon it must
/// end all: a parallel file that could not
///   be written cannot be closed
void write_collectively(const MpiCommunicator& ranks, const std::string& file,
                        const FileArray& array, Index length, const RowsOf& rows);

}  // namespace phyxel
