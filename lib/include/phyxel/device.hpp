/// The device that steps a model: a GPU, or the cores of a rank. No CUDA header is needed to
/// include this, and a build without CUDA has it too: it then finds no GPU and says why.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

class Ranks;

/// A GPU.
struct Device {
  int index = 0;             ///< As CUDA counts those that this program sees.
  std::string name;          ///< e.g. "NVIDIA H200".
  int major = 0, minor = 0;  ///< Compute capability.
  int multiprocessors = 0;
  std::size_t memory = 0;        ///< Bytes in all.
  std::string describe() const;  ///< "NVIDIA H200 (compute capability 9.0, 132 SMs, 150.1 GB)".
};

/// What a rank steps on.
struct ChosenDevice {
  std::optional<Device> gpu;  ///< Nothing: the CPU.
  std::string why_no_gpu;     ///< Where there is none.
};

/// Whether it is "auto", "cpu", "cuda" or "cuda:<number>".
/// @throws InputError naming `where` it was said
void check_device_name(const std::string& name, const std::string& where);

/// The device of that name, where "auto" is the first GPU, or the CPU if there is none or it cannot
/// be used.
/// @throws InputError for another name; DeviceError if a GPU is asked for and cannot be used
ChosenDevice choose_device(const std::string& name, const std::string& where = "device");

/// The device of this rank: each rank of a host takes the next of its GPUs, unless one is named,
/// and "auto" is GPUs only if all ranks find one. Collective. @throws Error as above, on every rank
ChosenDevice choose_device(const Ranks& ranks, const std::string& name,
                           const std::string& where = "device");

/// The model of a scene, its neighbours sought on the device that will step it, so that lists of
/// neighbours may never exist on the host.
Model build_model(const Scene& scene, const ChosenDevice& device);
/// The same from clouds already in place, one for each body of the scene.
Model build_model(const Scene& scene, std::span<const Cloud> clouds, const ChosenDevice& device);

/// How the GPUs of ranks may exchange: "auto" (the first of the following that all can), "direct"
/// (stores into each other's memory, on one host), "nccl", "mpi" (one that is CUDA-aware) and
/// "host" (MPI through host memory).
const std::vector<std::string>& transport_names();
/// @throws InputError for another name
void check_transport_name(const std::string& name);

/// The backend of a model, or of a rank's share, on that device. The model must outlive it.
/// Of a share on a GPU: collective, and none is destroyed before all ranks have waited.
/// @param threads of the CPU; 0: OpenMP's choice
/// @param transport of ranks' GPUs
/// @throws DeviceError of this rank's GPU; InputError for another transport; AgreedError, on all
///   ranks, for one that cannot be had
std::unique_ptr<Backend> make_backend(const Model& model, Precision precision,
                                      const ChosenDevice& device, int threads = 0,
                                      const std::string& transport = "auto");

}  // namespace phyxel
