#include "base64.hpp"

namespace phyxel::app {

std::string base64(std::span<const std::byte> bytes) {
  constexpr char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    const auto byte = [&](std::size_t at) {
      return at < bytes.size() ? std::to_integer<unsigned>(bytes[at]) : 0U;
    };
    const unsigned three = byte(k) << 16U | byte(k + 1) << 8U | byte(k + 2);
    text += letters[three >> 18U];
    text += letters[three >> 12U & 63U];
    text += k + 1 < bytes.size() ? letters[three >> 6U & 63U] : '=';
    text += k + 2 < bytes.size() ? letters[three & 63U] : '=';
  }
  return text;
}

}  // namespace phyxel::app
