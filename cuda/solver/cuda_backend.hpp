/// The production solver on one GPU.
#pragma once

#include <memory>

#include "phyxel/backend.hpp"

namespace phyxel {

/// How steps are launched; results are the same to the last bit.
enum class CudaPath {
  automatic,  ///< Bodies that fit stay in shared memory for many steps per launch.
  launches,   ///< Two launches per step.
};

/// How the GPUs of a share's ranks exchange ghosts' values; results are the same to the last bit.
enum class Transport {
  automatic,  ///< The first of the following that all ranks support.
  direct,     ///< Stores into the memory of other ranks' GPUs on one host, by CUDA IPC.
  nccl,       ///< NVIDIA's NCCL; every rank needs a GPU of its own.
  mpi,        ///< CUDA-aware MPI.
  host,       ///< MPI from host memory.
};

/// Makes a backend on a CUDA device. It uses the physics functions of `make_cpu_backend`; results
/// agree to rounding, and are bitwise the same from run to run. The model must outlive the backend.
/// On a share, its functions are collective, and no rank may destroy it before all ranks have
/// waited for it.
/// @throws DeviceError if there is no such device or too little memory on it, or if the transport
/// is not available; InputError for neighbourhoods too large for a tile.
std::unique_ptr<Backend> make_cuda_backend(const Model& model, Precision precision, int device = 0,
                                           CudaPath path = CudaPath::automatic,
                                           Transport transport = Transport::automatic);

}  // namespace phyxel
