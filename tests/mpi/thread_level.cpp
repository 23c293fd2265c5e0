/// A program that starts MPI for one thread and then constructs ranks. Its exit code is 0 if they
/// are refused with a message that names the thread level.
#include <mpi.h>

#include <cstdio>
#include <string>

#include "phyxel/error.hpp"
#include "phyxel/ranks.hpp"

int main(int argc, char** argv) {
  int level = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_SINGLE, &level);
  if (level > MPI_THREAD_SINGLE) {
    std::puts("SKIPPED: this MPI starts with a higher thread level than asked for");
    MPI_Finalize();
    return 0;
  }
  std::string said;
  try {
    const phyxel::Ranks ranks({MPI_Comm_c2f(MPI_COMM_WORLD)});
  } catch (const phyxel::Error& error) {
    said = error.what();
  }
  MPI_Finalize();
  std::puts(said.c_str());
  const bool named = said.find("MPI_THREAD_SINGLE") != std::string::npos &&
                     said.find("MPI_THREAD_FUNNELED") != std::string::npos;
  return named ? 0 : 1;
}
