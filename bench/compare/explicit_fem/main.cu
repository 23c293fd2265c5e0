/// Explicit finite elements on one GPU, a peer to be measured beside phyxel: what an expert in
/// finite elements would write for the bar of `phyxel accuracy gravity` and `bending`.
///
/// Elements are total-Lagrangian: linear tetrahedra, five a cell, or eight-node bricks with one
/// point and hourglass stiffness, of a St Venant-Kirchhoff material. Time goes on by symplectic
/// Euler with lumped masses. All is float, and displacements, not positions, are kept. `Path` in
/// body.cuh lists the ways to advance a body.
///
///   cd bench/compare/explicit_fem
///   nvcc -O3 -std=c++17 -arch=sm_90 -Xcompiler -fopenmp -o explicit_fem main.cu
///
/// (sm_90 is the architecture of the GPU).
///
///   explicit_fem check         compares all paths; exit code 1 if one differs
///   explicit_fem speed [MOST]  measures the time of a step
///   explicit_fem beam [MOST]   measures the bar at rest, its first frequency and the time
///   explicit_fem all [MOST]    does all three (default)
///   explicit_fem cpu MOST      brings the bar to rest on the host, serially, without a GPU
///
/// MOST is the largest number of cells across the bar. Results are CSV, comments begin with #;
/// `all` prints three tables with an empty line between. Exit codes: 0 done; 1 a path differs or
/// the GPU failed; 2 wrong arguments or no GPU.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>

#include "beam.cuh"
#include "check.cuh"
#include "host.cuh"
#include "speed.cuh"

namespace {

constexpr int finest = 147;  // cells across the finest mesh

/// What the user has to put right.
struct UserError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Arguments {
  std::string mode = "all";
  int most = finest;
};

/// Returns the coarsest mesh of a mode, in cells across.
int coarsest(const std::string& mode) { return mode == "speed" ? 4 : 2; }

int parsed_most(const std::string& mode, const std::string& text) {
  char* end = nullptr;
  const long most = std::strtol(text.c_str(), &end, 10);
  const bool is_number = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
  if (!is_number || most < coarsest(mode) || most > finest) {
    throw UserError("MOST \"" + text + "\"; allowed with \"" + mode + "\": whole numbers from " +
                    std::to_string(coarsest(mode)) + " to " + std::to_string(finest));
  }
  return int(most);
}

/// @throws UserError
Arguments parsed(int count, char** values) {
  Arguments arguments;
  if (count > 1) arguments.mode = values[1];
  const std::string& mode = arguments.mode;
  if (mode != "check" && mode != "speed" && mode != "beam" && mode != "all" && mode != "cpu") {
    throw UserError("mode \"" + mode + "\"; allowed: check, speed, beam, all, cpu");
  }
  const int allowed = mode == "check" ? 2 : 3;
  if (count > allowed) {
    throw UserError("argument \"" + std::string(values[allowed]) + "\"; allowed with \"" + mode +
                    "\": " + (mode == "check" ? "none" : "one, MOST"));
  }
  if (count > 2) arguments.most = parsed_most(mode, values[2]);
  if (mode == "cpu" && count < 3) {
    throw UserError("MOST is missing; \"cpu\" needs a whole number from 2 to " +
                    std::to_string(finest));
  }
  return arguments;
}

/// Prints the name of the GPU as a comment. @throws UserError if there is none
void print_gpu(const std::string& mode) {
  int count = 0;
  const cudaError_t error = cudaGetDeviceCount(&count);
  if (error != cudaSuccess || count == 0) {
    throw UserError("no GPU, which \"" + mode + "\" needs (" +
                    (error != cudaSuccess ? cudaGetErrorString(error) : "CUDA finds none") +
                    "); \"cpu MOST\" runs without one");
  }
  cudaDeviceProp properties;
  FEM_CUDA(cudaGetDeviceProperties(&properties, 0));
  std::printf("# gpu: %s\n", properties.name);
}

/// Does what the arguments say, and returns the exit code.
int run(const Arguments& arguments) {
  const bool all = arguments.mode == "all";
  if (arguments.mode == "cpu") {
    fem::cpu(arguments.most);
    return 0;
  }
  print_gpu(arguments.mode);
  if ((all || arguments.mode == "check") && !fem::check_all()) {
    std::fprintf(stderr, "explicit_fem: a path differs from the first by more than %g\n",
                 fem::largest_difference);
    return 1;
  }
  if (all) std::printf("\n");
  if (all || arguments.mode == "speed") fem::speed(arguments.most);
  if (all) std::printf("\n");
  if (all || arguments.mode == "beam") fem::beam(arguments.most);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(parsed(argc, argv));
  } catch (const UserError& error) {
    std::fprintf(stderr, "explicit_fem: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "explicit_fem: %s\n", error.what());
    return 1;
  }
}
