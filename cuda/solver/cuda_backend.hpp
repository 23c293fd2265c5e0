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

/// A backend on a CUDA device: the same physics functions as `make_cpu_backend`, results equal to
/// rounding, and bitwise the same from run to run. The model must outlive it.
/// @throws DeviceError if there is no such device or too little memory on it; InputError for
///   neighbourhoods too large for a tile.
std::unique_ptr<Backend> make_cuda_backend(const Model& model, Precision precision, int device = 0,
                                           CudaPath path = CudaPath::automatic);

}  // namespace phyxel
