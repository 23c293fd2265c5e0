/// The device that steps a model: a GPU, or the cores of a rank. This header does not include
/// CUDA's, and also exists in builds without CUDA, which find no GPU and give the reason.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

class Ranks;

/// A GPU.
struct Device {
  int index = 0;             ///< CUDA's index of the device in this process.
  std::string name;          ///< e.g. "NVIDIA H200".
  int major = 0, minor = 0;  ///< Compute capability.
  int multiprocessors = 0;
  std::size_t memory = 0;  ///< Total memory [bytes].
  /// Description, e.g. "NVIDIA H200 (compute capability 9.0, 132 SMs, 150.1 GB)".
  std::string describe() const;
};

/// The device of a rank.
struct ChosenDevice {
  std::optional<Device> gpu;  ///< The GPU; unset for the CPU.
  std::string why_no_gpu;     ///< The reason if there is no GPU.
};

/// Checks that a name is "auto", "cpu", "cuda" or "cuda:<number>".
/// @throws InputError naming the option or key `where`
void check_device_name(const std::string& name, const std::string& where);

/// The device of a name; "auto" is the first GPU, or the CPU if there is no usable one.
/// @throws InputError for another name; DeviceError if the requested GPU cannot be used
ChosenDevice choose_device(const std::string& name, const std::string& where = "device");

/// The device of this rank. Each rank of a host takes the next of its GPUs, unless one is named;
/// "auto" chooses GPUs only if all ranks find one. Collective. @throws Error as above, on each rank
ChosenDevice choose_device(const Ranks& ranks, const std::string& name,
                           const std::string& where = "device");

/// Fills a surface with the help of a device. The cloud is that of `sample_surface` without one, to
/// the last bit. @throws InputError as `sample_surface` does, and DeviceError
Cloud sample_surface(const Surface& surface, const SampleRequest& request,
                     const ChosenDevice& device, SampleReport* report = nullptr);

/// Makes the clouds of a scene with the help of a device. They are those of `make_clouds` without
/// one, to the last bit. @throws Error as `make_clouds` does, and DeviceError
std::vector<Cloud> make_clouds(const Scene& scene, const std::map<std::string, Cloud>& named,
                               const ChosenDevice& device);

/// Builds the model of a scene, with a neighbour search on the device that will step it; the host
/// may then have no neighbour lists.
Model build_model(const Scene& scene, const ChosenDevice& device);
/// Builds the model from positioned clouds, one for each body of the scene.
Model build_model(const Scene& scene, std::span<const Cloud> clouds, const ChosenDevice& device);

/// The transports between the ranks' GPUs: "auto" (the first of the following that all ranks
/// support), "direct" (stores into each other's memory, on one host), "nccl", "mpi" (CUDA-aware)
/// and "host" (MPI through host memory).
const std::vector<std::string>& transport_names();
/// Checks the name of a transport. @throws InputError
void check_transport_name(const std::string& name);

/// Makes the backend of a model, or of a rank's share, on a device. The model must outlive it. For
/// a share on a GPU the call is collective, and all ranks must wait before one destroys its
/// backend.
/// @param threads number of CPU threads; 0 for OpenMP's choice
/// @param transport transport between the ranks' GPUs
/// @throws DeviceError of this rank's GPU; InputError for an unknown transport; AgreedError, on all
///   ranks, for an unavailable one
std::unique_ptr<Backend> make_backend(const Model& model, Precision precision,
                                      const ChosenDevice& device, int threads = 0,
                                      const std::string& transport = "auto");

}  // namespace phyxel
