/// Substitutes of a program built without CUDA.
#include "device.hpp"
#include "paper/paper_backend.hpp"
#include "paper/paper_model.hpp"
#include "phyxel/error.hpp"
#include "setup/closing.hpp"
#include "setup/filling.hpp"
#include "setup/survey.hpp"
#include "solver/cuda_backend.hpp"

namespace phyxel {
namespace {

const std::string without = "this program was built without CUDA";

}  // namespace

std::vector<Device> cuda_devices(std::string* why) {
  if (why) *why = without;
  return {};
}

Device use_cuda_device(int) {
  throw DeviceError(without +
                    "; allowed: the CPU, or a build with -DPHYXEL_CUDA=ON where nvcc is installed");
}

bool cuda_peers(int, int) { return false; }

std::size_t cuda_free_memory() { return 0; }

std::size_t cuda_measured_allocation(std::size_t, const std::string&) { return 0; }

double cuda_copy_bandwidth() { return 0; }

std::string cuda_version() { return "no CUDA"; }

Surveyor cuda_surveyor(int device) {
  use_cuda_device(device);
  return {};
}

ClosingSearch cuda_closing_search(int device) {
  use_cuda_device(device);
  return {};
}

std::shared_ptr<const FillingDevice> cuda_filling_device(int device, Index) {
  use_cuda_device(device);
  return nullptr;
}

std::unique_ptr<ShareSurveyor> cuda_share_surveyor(int device) {
  use_cuda_device(device);
  return nullptr;
}

bool can_survey_on_cuda(const Scene&) { return false; }

std::unique_ptr<Backend> make_cuda_backend(const Model&, Precision, int device, CudaPath,
                                           Transport) {
  use_cuda_device(device);
  return nullptr;
}

namespace paper {

std::unique_ptr<PaperBackend> make_gpu_backend(const Model& model, const GpuOptions& options) {
  check_paper_model(model);
  use_cuda_device(options.device);
  return nullptr;
}

}  // namespace paper
}  // namespace phyxel
