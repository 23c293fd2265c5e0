/// The MPI communicator of an `MpiCommunicator`, for files that call MPI.
#pragma once

#include <mpi.h>

#include <list>
#include <memory>
#include <vector>

#include "mpi/communicator.hpp"

namespace phyxel {

struct MpiCommunicator::Native {
  MPI_Comm all = MPI_COMM_NULL;  ///< The duplicate; null once closed.
  bool started_here = false;     ///< True if the constructor started MPI.
  /// Active requests whose `Transfers` were destroyed, with the owner of their memory.
  struct Left {
    std::vector<MPI_Request> requests;
    std::shared_ptr<void> memory;
  };
  std::list<Left> left;
};

/// Checks MPI's return code. @throws Error naming the call
void check_mpi(int code, const char* call);
#define PHYXEL_MPI_CALL(call) check_mpi(call, #call)

}  // namespace phyxel
