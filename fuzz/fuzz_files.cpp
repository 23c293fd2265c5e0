/// Bodies, checkpoints, frames and series from arbitrary bytes: an InputError or a result, nothing
/// else.
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "phyxel/body_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  static const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("phyxel_fuzz_" + std::to_string(getpid()));
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(data + 1), static_cast<std::streamsize>(size - 1));
  try {
    switch (data[0] % 4) {
      case 0:
        phyxel::read_body(file);
        break;
      case 1:
        phyxel::read_checkpoint(file);
        break;
      case 2:
        phyxel::read_frame(file);
        break;
      default:
        phyxel::read_series(file);
    }
  } catch (const phyxel::InputError&) {
  }
  return 0;
}
