/// Substitute for builds with serial HDF5, where the first rank writes.
#include "mpi/parallel_file.hpp"

namespace phyxel {

bool can_write_collectively() { return false; }

void write_collectively(const MpiCommunicator&, const std::string& file, const FileArray&, Index,
                        const RowsOf&) {
  throw OutputError(file + ": this program was built without parallel HDF5");
}

}  // namespace phyxel
