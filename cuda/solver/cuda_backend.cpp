/// The choice of a backend by precision.
#include "solver/cuda_backend.hpp"

#include "phyxel/custom_law.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace cuda {

// Each precision is compiled in a file of its own.
std::unique_ptr<Backend> make_float_backend(const Model& model, int device, CudaPath path,
                                            Transport transport);
std::unique_ptr<Backend> make_mixed_backend(const Model& model, int device, CudaPath path,
                                            Transport transport);
std::unique_ptr<Backend> make_double_backend(const Model& model, int device, CudaPath path,
                                             Transport transport);

}  // namespace cuda

std::unique_ptr<Backend> make_cuda_backend(const Model& model, Precision precision, int device,
                                           CudaPath path, Transport transport) {
  check_model(model);
  if (model.share && model.share->place.size() != static_cast<std::size_t>(model.size())) {
    throw InputError("the GPU backend needs shares that are cut between tiles");
  }
  for (const Part& part : model.parts) {
    if (!part.material.custom_law) continue;
    throw InputError("body \"" + part.name + "\": custom_law = \"" +
                     part.material.custom_law->name() +
                     "\", a law of the caller's own, cannot run on a GPU: allowed is the CPU");
  }
  switch (precision) {
    case Precision::single:
      return cuda::make_float_backend(model, device, path, transport);
    case Precision::mixed:
      return cuda::make_mixed_backend(model, device, path, transport);
    case Precision::double_:
      break;
  }
  return cuda::make_double_backend(model, device, path, transport);
}

}  // namespace phyxel
