/// phyxel doctor: the machine as the program sees it, and the choices of a run.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <omp.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "csv.hpp"
#include "device_option.hpp"
#include "files/hdf5_file.hpp"
#include "model/host_memory.hpp"
#include "mpi/parallel_file.hpp"
#include "outside_text.hpp"
#include "program_ranks.hpp"
#include "solver/nccl.hpp"
#include "thread_policy.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

using Findings = nlohmann::ordered_json;

std::string host_name() {
  char name[256] = "";
  gethostname(name, sizeof name - 1);
  return name;
}

/// The strings of all ranks, on each rank.
std::vector<std::string> of_all_ranks(const std::string& own) {
  std::vector<std::vector<char>> send(static_cast<std::size_t>(ranks().size()),
                                      std::vector<char>(own.begin(), own.end()));
  std::vector<std::string> all;
  for (const std::vector<char>& text : ranks().alltoallv(send)) {
    all.emplace_back(text.begin(), text.end());
  }
  return all;
}

Findings gpu_facts(const std::vector<Device>& devices) {
  Findings gpus = Findings::array();
  for (const Device& device : devices) {
    Findings peers = Findings::array();
    for (const Device& other : devices) {
      if (other.index != device.index && cuda_peers(device.index, other.index)) {
        peers.push_back(other.index);
      }
    }
    std::string usable = "yes";
    double free_bytes = 0;
    try {
      use_cuda_device(device.index);
      free_bytes = static_cast<double>(cuda_free_memory());
    } catch (const DeviceError& error) {
      usable = error.what();
    }
    gpus.push_back({{"index", device.index},
                    {"name", device.describe()},
                    {"free_bytes", free_bytes},
                    {"peers", peers},
                    {"usable", usable}});
  }
  return gpus;
}

/// The transport between the ranks' GPUs, in words. Collective.
std::string transport_of_ranks(const ChosenDevice& device) {
  bool direct = true;
  const int own = device.gpu ? device.gpu->index : -1;
  const std::vector<int> indices = ranks().gathered(std::span<const int>(&own, 1));
  for (int r = 0; r < ranks().size(); ++r) {
    direct = direct && ranks().host_of(r) == ranks().host_of(ranks().rank()) &&
             (indices[r] == own || own < 0 || cuda_peers(own, indices[r]));
  }
  const bool all_direct = ranks().smallest(std::int64_t{direct}) == 1;
  if (ranks().size() == 1) return "none: one rank";
  if (!device.gpu) return "MPI";
  if (all_direct) return "direct: stores into other GPUs' memory (CUDA IPC)";
  const bool nccl = ranks().smallest(std::int64_t{cuda::has_nccl()}) == 1;
  const std::string by_mpi =
      mpi_takes_device_memory() ? "mpi: CUDA-aware MPI" : "host: host memory and MPI";
  return nccl ? "nccl, if each rank has its own GPU; else " + by_mpi : by_mpi;
}

Findings facts() {
  std::string why;
  const std::vector<Device> devices = cuda_devices(&why);
  const ChosenDevice device = choose_device("auto");
  const std::string chosen =
      device.gpu ? fmt::format("cuda:{}", device.gpu->index) : std::string("cpu");
  const std::string transport = transport_of_ranks(device);
  Findings places = Findings::array();
  for (const std::string& place : of_all_ranks(fmt::format("{} {}", host_name(), chosen))) {
    places.push_back(place);
  }
  const HostLoad host = host_load().value_or(HostLoad{});
  return {{"program", program_version()},
          {"compiler", compiler_name()},
          {"processor", processor_name()},
          {"cores", sysconf(_SC_NPROCESSORS_ONLN)},
          {"cores_of_this_rank", omp_get_num_procs()},
          {"load", host.load},
          {"shared_cores", host.exceeds()},
          {"thread_policy", thread_policy()},
          {"memory_bytes", usable_memory()},
          {"cuda", cuda_version()},
          {"gpus", gpu_facts(devices)},
          {"no_gpu_because", why},
          {"nccl", cuda::nccl_version()},
          {"mpi", mpi_description()},
          {"ranks", places},
          {"hdf5", hdf5_version() + (can_write_collectively() ? ", parallel: all ranks write"
                                                              : ", serial: the first rank writes")},
          {"device", chosen},
          {"transport", transport}};
}

std::string table(const Findings& f) {
  const auto text = [&](const char* key) { return f[key].get<std::string>(); };
  std::string out = fmt::format("{}\n", text("program"));
  const auto line = [&](const char* name, const std::string& value) {
    out += fmt::format("  {:<11} {}\n", name, value);
  };
  line("compiler", text("compiler"));
  line("processor",
       fmt::format("{}, {} cores ({} for this rank), {:.3g} GiB of memory", text("processor"),
                   f["cores"].get<long>(), f["cores_of_this_rank"].get<int>(),
                   f["memory_bytes"].get<double>() / 0x1p30));
  const std::string policy = text("thread_policy");
  line("threads",
       "waiting: " + (policy.empty() ? "as the OpenMP runtime does by default" : policy));
  if (f["shared_cores"].get<bool>()) {
    line("warning", fmt::format("load {:.1f} on {} cores: other programs share them; steps will be "
                                "slower, and fewer --threads may be faster",
                                f["load"].get<double>(), f["cores"].get<long>()));
  }
  line("CUDA", text("cuda"));
  if (f["gpus"].empty()) line("GPUs", "none: " + text("no_gpu_because"));
  for (const Findings& gpu : f["gpus"]) {
    const auto peers = gpu["peers"].get<std::vector<int>>();
    std::string about = fmt::format("{}, {:.3g} GB free", gpu["name"].get<std::string>(),
                                    gpu["free_bytes"].get<double>() * 1e-9);
    if (!peers.empty()) about += fmt::format(", reaches {}", fmt::join(peers, ", "));
    if (gpu["usable"] != "yes") about += "; not usable: " + gpu["usable"].get<std::string>();
    line(fmt::format("cuda:{}", gpu["index"].get<int>()).c_str(), about);
  }
  line("NCCL", text("nccl"));
  line("MPI", text("mpi"));
  line("HDF5", text("hdf5"));
  line("ranks", fmt::format("{}", f["ranks"].size()));
  int rank = 0;
  for (const Findings& place : f["ranks"]) {
    line("", fmt::format("{:>5}: {}", rank++, place.get<std::string>()));
  }
  line("device", text("device") + ", if a scene says auto");
  line("exchange", text("transport"));
  return out;
}

}  // namespace

void add_doctor(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "doctor", "Show GPUs, MPI, HDF5 and memory of this machine, and the choices of a run");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "Print the result as JSON");
  command->footer(
      "Examples:\n"
      "  phyxel doctor\n"
      "  mpirun -n 8 phyxel doctor");
  command->callback([json] {
    const Findings found = facts();
    if (ranks().rank() == 0) fmt::print("{}", *json ? json_text(found) + "\n" : table(found));
  });
}

}  // namespace phyxel::app
