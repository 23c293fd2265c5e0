/// Fuzzer of the readers of bodies, checkpoints, frames and series: the only outcomes are a result
/// and an InputError. The input is put behind a seal with its digest; inputs are also read as whole
/// files with their own seal, and as series.
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>

#include "files/frame_file.hpp"
#include "files/hdf5_file.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"

namespace {

namespace fs = std::filesystem;
using namespace phyxel;

// Kinds of files, chosen by the first byte of the input.
enum Choice : std::uint8_t {
  body,
  checkpoint,
  points,
  surface,
  trajectory,
  whole,
  series,
  choices
};
constexpr const char* kinds[] = {"body", "checkpoint", "point frame", "surface frame",
                                 "trajectory"};

fs::path folder() {
  static const fs::path made = [] {
    const fs::path memory = "/dev/shm";
    const fs::path path = (fs::exists(memory) ? memory : fs::temp_directory_path()) /
                          ("phyxel_fuzz_" + std::to_string(getpid()));
    fs::create_directory(path);
    return path;
  }();
  return made;
}

void write_bytes(const fs::path& file, const std::string& before, const std::uint8_t* data,
                 std::size_t size) {
  std::ofstream stream(file, std::ios::binary);
  stream << before;
  stream.write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
}

/// Reads everything that a file may contain.
void read_all(const fs::path& file) {
  const std::string kind = check_seal(file);
  if (kind == "body") {
    read_body(file);
  } else if (kind == "checkpoint") {
    read_checkpoint(file);
    latest_checkpoint(file.parent_path());
  } else if (kind == phyxel_frame_kind || kind == surface_frame_kind) {
    read_frame(file, true);
  } else {
    const Hdf5Reader in(file);
    for (const std::string& name : in.names("/VTKHDF")) {
      if (in.has("/VTKHDF/" + name)) in.shape("/VTKHDF/" + name);
    }
    in.array<double>("/VTKHDF/Steps/Values");
    in.text_attribute("/phyxel", "title");
  }
}

/// The content of a small valid file, without its seal.
std::string example(Choice choice) {
  Hdf5Writer out;
  out.group("/phyxel");
  const auto sides = std::vector<Vec3d>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<Index> corners{0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
  out.attribute("/phyxel", "version", std::int64_t{choice == checkpoint ? 2 : 1});
  for (const char* name : {"program", "title"}) out.attribute("/phyxel", name, std::string("x"));
  out.text("/phyxel/scene", "title = \"x\"\n");
  switch (choice) {
    case body:
      out.vectors("/position", sides, false);
      out.array<double>("/volume", std::vector<double>{1, 2, 3, 4});
      out.vectors("/surface/position", sides, false);
      out.vectors("/surface/normal", sides, false);
      out.array<Index>("/surface/triangle", corners, 3);
      out.array<Index>("/regions/mouth", std::vector<Index>{0, 2});
      break;
    case checkpoint:
      for (const auto& [name, value] :
           {std::pair{"precision", "double"}, {"method", "verlet"}, {"model_digest", "abc"}}) {
        out.attribute("/phyxel", name, std::string(value));
      }
      for (const char* name : {"total_energy", "initial_energy"})
        out.attribute("/phyxel", name, 1.0);
      out.attribute("/phyxel", "frames_written", std::int64_t{3});
      out.group("/state");
      out.attribute("/state", "step", std::int64_t{7});
      for (const char* name : {"time", "dt"}) out.attribute("/state", name, 0.5);
      for (const char* name : {"/state/displacement", "/state/velocity"})
        out.vectors(name, sides, true);
      break;
    default:
      out.attribute("/phyxel", "time", 0.5);
      out.vectors("/VTKHDF/Points", sides, true);
      out.array<std::int64_t>("/VTKHDF/Connectivity",
                              std::vector<std::int64_t>(corners.begin(), corners.end()));
      out.vectors("/VTKHDF/PointData/Normals", sides, true);
      out.vectors("/VTKHDF/PointData/velocity", sides, true);
      out.array<Index>("/VTKHDF/PointData/body", std::vector<Index>(4));
      out.array<double>("/VTKHDF/Steps/Values", std::vector<double>{0, 1});
  }
  const fs::path file = folder() / "example.h5";
  write_sealed(file, kinds[choice], out.content(), Durable::no);
  std::ifstream stream(file, std::ios::binary);
  std::string bytes(std::istreambuf_iterator<char>(stream), {});
  return bytes.substr(seal_size);
}

}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

/// Mutator that starts from valid files, and also changes the fields that hold HDF5's numbers.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most, unsigned int seed) {
  std::minstd_rand random(seed);
  if (size < 600 || random() % 200 == 0) {
    const auto choice = static_cast<Choice>(random() % whole);
    static std::string examples[whole];
    if (examples[choice].empty()) examples[choice] = example(choice);
    const std::string& bytes = examples[choice];
    if (bytes.size() + 1 <= most) {
      data[0] = choice;
      std::memcpy(data + 1, bytes.data(), bytes.size());
      return bytes.size() + 1;
    }
  }
  if (random() % 3 == 0 || size < 64) return LLVMFuzzerMutate(data, size, most);
  for (unsigned changes = 1 + random() % 3; changes > 0; --changes) {
    // Most fields of 8 bytes are at multiples of 8 after the first byte.
    const std::size_t at = 1 + 8 * (random() % ((size - 1) / 8));
    const std::uint64_t values[] = {0,
                                    1,
                                    ~0ull,
                                    size,
                                    size - 512,
                                    0xffff,
                                    1u << 31,
                                    1ull << 62,
                                    8 * (random() % (size / 8)),
                                    random() % 64};
    std::uint64_t value = values[random() % std::size(values)];
    const std::size_t width = std::size_t{1} << random() % 4;
    std::memcpy(data + at + (width < 8 ? width * (random() % (8 / width)) : 0), &value, width);
  }
  return size;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto choice = static_cast<Choice>(data[0] % choices);
  const fs::path file = folder() / (choice == series ? "f.series" : "checkpoint_1.h5");
  const bool sealed = choice < whole;
  write_bytes(file, sealed ? std::string(seal_size, '\n') : "", data + 1, size - 1);
  if (sealed) seal_in_place(file, kinds[choice]);
  try {
    if (choice == series) {
      read_series(file);
    } else {
      read_all(file);
    }
  } catch (const InputError&) {
  }
  return 0;
}
