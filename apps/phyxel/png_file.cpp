#include "png_file.hpp"

#include <fmt/format.h>
#include <png.h>

#include "files/atomic_file.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {

void write_png(const std::filesystem::path& file, const Image& image) {
  png_image png = {};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&png, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr) == 0) {
    throw OutputError(fmt::format("{}: cannot be written: {}", file.string(), png.message));
  }
  write_whole_file(file, std::string_view(bytes).substr(0, size), Durable::no);
}

}  // namespace phyxel::app
