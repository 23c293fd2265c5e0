/// The production solver with forces in float and state in double.
#include "solver/cuda_backend.cuh"

namespace phyxel::cuda {

std::unique_ptr<Backend> make_mixed_backend(const Model& model, int device, CudaPath path,
                                            Transport transport) {
  return std::make_unique<CudaBackend<float, double>>(model, device, path, transport);
}

}  // namespace phyxel::cuda
