/// The production solver in float. The other precisions have files of their own, since compiling
/// the kernels of one takes a minute.
#include "solver/cuda_backend.cuh"

namespace phyxel::cuda {

std::unique_ptr<Backend> make_float_backend(const Model& model, int device, CudaPath path,
                                            Transport transport) {
  return std::make_unique<CudaBackend<float, float>>(model, device, path, transport);
}

}  // namespace phyxel::cuda
