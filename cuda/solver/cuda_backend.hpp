/// The production solver on one GPU.
#pragma once

#include <memory>

#include "phyxel/backend.hpp"

namespace phyxel {

/// How steps are launched; results are the same to the last bit.
enum class CudaPath {
  automatic,  ///< Bodies that fit stay in shared memory for many steps a launch.
  launches,   ///< Two launches a step.
};

/// How the GPUs of a share's ranks exchange ghosts' values; results are the same to the last bit.
enum class Transport {
  automatic,  ///< The first of the following that all ranks can.
  direct,     ///< Stores into the memory of other ranks' GPUs, on one host: CUDA IPC.
  nccl,       ///< NVIDIA's NCCL, where every rank has a GPU of its own.
  mpi,        ///< By an MPI that takes memory of GPUs.
  host,       ///< Through host memory, by MPI.
};

/// A backend on a CUDA device: the same physics functions as `make_cpu_backend`, results equal to
/// rounding, and bitwise the same from run to run. The model must outlive it.
/// Of a share, all ranks call its functions together, and none destroys it before all have waited.
/// @throws DeviceError if there is no such device or too little memory on it, or if the transport
///   cannot be had; InputError for neighbourhoods too large for a tile.
std::unique_ptr<Backend> make_cuda_backend(const Model& model, Precision precision, int device = 0,
                                           CudaPath path = CudaPath::automatic,
                                           Transport transport = Transport::automatic);

}  // namespace phyxel
