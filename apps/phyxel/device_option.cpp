#include "device_option.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "ensemble.hpp"
#include "phyxel/error.hpp"
#include "setup/survey.hpp"
#include "solver/cuda_backend.hpp"

namespace phyxel::app {
namespace {

/// n of "cuda:n".
std::optional<int> device_number(const std::string& name) {
  if (name == "cuda") return 0;
  if (name.rfind("cuda:", 0) != 0 || name.size() < 6 || name.size() > 8) return std::nullopt;
  if (!std::all_of(name.begin() + 5, name.end(), [](char c) { return c >= '0' && c <= '9'; })) {
    return std::nullopt;
  }
  return std::stoi(name.substr(5));
}

}  // namespace

void check_device_name(const std::string& name, const std::string& where) {
  if (name == "auto" || name == "cpu" || device_number(name)) return;
  throw InputError(fmt::format("{} {}: unknown device{}; allowed: auto, cpu, cuda, cuda:0, ...",
                               where, name, did_you_mean(name, {"auto", "cpu", "cuda"})));
}

ChosenDevice choose_device(const std::string& name, const std::string& where) {
  check_device_name(name, where);
  ChosenDevice chosen;
  if (name == "cpu") {
    chosen.why_no_gpu = where + " cpu";
  } else if (const auto number = device_number(name)) {
    chosen.gpu = use_cuda_device(*number);
  } else if (!cuda_devices(&chosen.why_no_gpu).empty()) {
    try {
      chosen.gpu = use_cuda_device(0);
    } catch (const DeviceError& error) {
      chosen.why_no_gpu = error.what();
      fmt::print(stderr, "phyxel: warning: the GPU is not used: {}\n", error.what());
    }
  }
  return chosen;
}

ChosenDevice choose_device_of_rank(const std::string& name, const std::string& where) {
  const Communicator& all = ranks();
  if (all.size() == 1) return choose_device(name, where);
  if (name == "cuda") {
    return all.agreed([&] {
      const auto found = static_cast<int>(cuda_devices().size());
      // None is an error that names the reason.
      return choose_device(fmt::format("cuda:{}", all.host_rank() % std::max(1, found)), where);
    });
  }
  if (name != "auto") return all.agreed([&] { return choose_device(name, where); });
  ChosenDevice chosen;
  const auto found = static_cast<int>(cuda_devices(&chosen.why_no_gpu).size());
  if (found > 0) {
    try {
      chosen.gpu = use_cuda_device(all.host_rank() % found);
    } catch (const DeviceError& error) {
      chosen.why_no_gpu = error.what();
    }
  }
  if (all.smallest(std::int64_t{chosen.gpu.has_value()}) == 1) return chosen;
  if (chosen.gpu) chosen.why_no_gpu = "another rank has none";
  chosen.gpu.reset();
  return chosen;
}

const std::vector<std::string>& transport_names() {
  static const std::vector<std::string> names{"auto", "direct", "nccl", "mpi", "host"};
  return names;
}

Facts device_facts(const ChosenDevice& device) {
  return device.gpu ? Facts{{"gpu", device.gpu->describe()}, {"cuda", cuda_version()}} : Facts{};
}

Model make_model(const Scene& scene, const ChosenDevice& device) {
  return device.gpu && can_survey_on_cuda(scene)
             ? build_model(scene, cuda_surveyor(device.gpu->index))
             : build_model(scene);
}

Model make_model(const Scene& scene, std::span<const Cloud> clouds, const ChosenDevice& device) {
  return device.gpu && can_survey_on_cuda(scene)
             ? build_model(scene, clouds, cuda_surveyor(device.gpu->index))
             : build_model(scene, clouds);
}

std::unique_ptr<Backend> make_backend(const Model& model, Precision precision,
                                      const ChosenDevice& device, int threads,
                                      const std::string& transport) {
  if (!device.gpu) return make_cpu_backend(model, precision, threads);
  const auto& names = transport_names();
  const auto which = std::find(names.begin(), names.end(), transport) - names.begin();
  return make_cuda_backend(model, precision, device.gpu->index, CudaPath::automatic,
                           static_cast<Transport>(which));
}

}  // namespace phyxel::app
