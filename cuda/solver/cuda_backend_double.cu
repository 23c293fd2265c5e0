/// The production solver in double.
#include "solver/cuda_backend.cuh"

namespace phyxel::cuda {

std::unique_ptr<Backend> make_double_backend(const Model& model, int device, CudaPath path,
                                             Transport transport) {
  return std::make_unique<CudaBackend<double, double>>(model, device, path, transport);
}

}  // namespace phyxel::cuda
