#include "device.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "mesh/filling_device.hpp"
#include "model/assembly.hpp"
#include "model/device_setup.hpp"
#include "mpi/communicator.hpp"
#include "phyxel/device.hpp"
#include "phyxel/error.hpp"
#include "phyxel/ranks.hpp"
#include "setup/closing.hpp"
#include "setup/filling.hpp"
#include "setup/survey.hpp"
#include "solver/cuda_backend.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// The number n of "cuda:n", 0 for "cuda"; unset for other names.
std::optional<int> device_number(const std::string& name) {
  if (name == "cuda") return 0;
  if (name.rfind("cuda:", 0) != 0 || name.size() < 6 || name.size() > 8) return std::nullopt;
  if (!std::all_of(name.begin() + 5, name.end(), [](char c) { return c >= '0' && c <= '9'; })) {
    return std::nullopt;
  }
  return std::stoi(name.substr(5));
}

/// The GPU of that number, or the reason why it cannot be used.
ChosenDevice device_if_usable(int number) {
  ChosenDevice chosen;
  try {
    chosen.gpu = use_cuda_device(number);
  } catch (const DeviceError& error) {
    chosen.why_no_gpu = error.what();
  }
  return chosen;
}

bool surveys(const ChosenDevice& device, const Scene& scene) {
  return device.gpu && can_survey_on_cuda(scene);
}

/// @param surveys true if the device searches for neighbours
DeviceSetup setup_by(const ChosenDevice& device, bool surveys) {
  DeviceSetup setup;
  if (surveys) setup.survey = cuda_surveyor(device.gpu->index);
  if (device.gpu) setup.close = cuda_closing_search(device.gpu->index);
  return setup;
}

/// The device that fills surfaces with the host; null for the CPU.
std::shared_ptr<const FillingDevice> filling_device(const ChosenDevice& device) {
  return device.gpu ? cuda_filling_device(device.gpu->index) : nullptr;
}

}  // namespace

void check_device_name(const std::string& name, const std::string& where) {
  if (name == "auto" || name == "cpu" || device_number(name)) return;
  throw InputError(fmt::format("{} {}: unknown device{}; allowed: auto, cpu, cuda, cuda:0, ...",
                               where, name, did_you_mean(name, {"auto", "cpu", "cuda"})));
}

ChosenDevice choose_device(const std::string& name, const std::string& where) {
  check_device_name(name, where);
  if (name == "cpu") return {std::nullopt, where + " cpu"};
  if (const auto number = device_number(name)) return {use_cuda_device(*number), ""};
  std::string why;
  if (cuda_devices(&why).empty()) return {std::nullopt, why};
  return device_if_usable(0);
}

ChosenDevice choose_device(const Ranks& ranks, const std::string& name, const std::string& where) {
  if (ranks.size() == 1) return choose_device(name, where);
  if (name != "auto" && name != "cuda") {
    return ranks.agreed([&] { return choose_device(name, where); });
  }
  std::string why;
  const auto found = static_cast<int>(cuda_devices(&why).size());
  const int next = ranks.host_rank() % std::max(1, found);
  // A missing GPU is an error that names the reason.
  if (name == "cuda") return ranks.agreed([&] { return ChosenDevice{use_cuda_device(next), ""}; });
  ChosenDevice chosen = found > 0 ? device_if_usable(next) : ChosenDevice{std::nullopt, why};
  if (ranks.smallest(std::int64_t{chosen.gpu.has_value()}) == 1) return chosen;
  if (chosen.gpu) chosen.why_no_gpu = "another rank has no GPU";
  chosen.gpu.reset();
  return chosen;
}

Cloud sample_surface(const Surface& surface, const SampleRequest& request,
                     const ChosenDevice& device, SampleReport* report) {
  const FillingScope filling(filling_device(device));
  return sample_surface(surface, request, report);
}

std::vector<Cloud> make_clouds(const Scene& scene, const std::map<std::string, Cloud>& named,
                               const ChosenDevice& device) {
  const FillingScope filling(filling_device(device));
  return make_clouds(scene, named);
}

Model build_model(const Scene& scene, const ChosenDevice& device) {
  const FillingScope filling(filling_device(device));
  return build_model(scene, setup_by(device, surveys(device, scene)));
}

Model build_model(const Scene& scene, std::span<const Cloud> clouds, const ChosenDevice& device) {
  bool on_host = !surveys(device, scene);
  for (std::size_t b = 0; b < std::min(clouds.size(), scene.bodies.size()); ++b) {
    on_host = on_host || needs_lists_on_host(scene.bodies[b], clouds[b]);
  }
  return build_model(scene, clouds, setup_by(device, !on_host));
}

const std::vector<std::string>& transport_names() {
  static const std::vector<std::string> names{"auto", "direct", "nccl", "mpi",
                                              "host"};  // as `Transport`
  return names;
}

void check_transport_name(const std::string& name) {
  const auto& names = transport_names();
  if (std::find(names.begin(), names.end(), name) != names.end()) return;
  throw InputError(fmt::format("transport {}: unknown{}; allowed: {}", name,
                               did_you_mean(name, names), fmt::join(names, ", ")));
}

std::unique_ptr<Backend> make_backend(const Model& model, Precision precision,
                                      const ChosenDevice& device, int threads,
                                      const std::string& transport) {
  check_transport_name(transport);
  const auto& names = transport_names();
  const auto which = std::find(names.begin(), names.end(), transport);
  return in_stage("solver arrays", [&] {
    if (!device.gpu) return make_cpu_backend(model, precision, threads);
    return make_cuda_backend(model, precision, device.gpu->index, CudaPath::automatic,
                             static_cast<Transport>(which - names.begin()));
  });
}

}  // namespace phyxel
