/// The pages of phyxel report, taken apart.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/folder.hpp"

namespace phyxel::test {

/// The text between two texts.
inline std::string between(const std::string& text, const std::string& begin,
                           const std::string& end) {
  const std::size_t from = text.find(begin);
  EXPECT_NE(from, std::string::npos) << begin;
  if (from == std::string::npos) return "";
  const std::size_t start = from + begin.size();
  return text.substr(start, text.find(end, start) - start);
}

/// Decodes base64.
inline std::string decoded(const std::string& text) {
  const std::string letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned held = 0;
  int bits = 0;
  for (const char c : text) {
    if (c == '=') break;
    held = held << 6U | static_cast<unsigned>(letters.find(c));
    bits += 6;
    if (bits >= 8) bytes += static_cast<char>(held >> static_cast<unsigned>(bits -= 8) & 255U);
  }
  return bytes;
}

/// The numbers in an element of a page.
template <class T>
std::vector<T> embedded(const std::string& page, const std::string& name) {
  const std::string bytes = decoded(between(page, "id=\"" + name + "\">", "</script>"));
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

/// The data of a page's script.
inline nlohmann::json data_of(const std::string& page) {
  return nlohmann::json::parse(
      between(page, "<script type=\"application/json\" id=\"data\">", "</script>"));
}

/// The element `<body ...>` of a page in a folder after Chromium has run its scripts; the whole
/// page is in dom.html then. @param page its name, and what follows it: "page.html#t=1"
inline std::string seen_by_browser(const std::filesystem::path& folder, const std::string& page) {
  const std::string command =
      "HOME=" + folder.string() +
      " timeout 60 chromium --headless=new --no-sandbox --use-angle=swiftshader "
      "--enable-unsafe-swiftshader --window-size=1000,800 --virtual-time-budget=4000 --dump-dom "
      "'file://" +
      (folder / page).string() + "' >" + (folder / "dom.html").string() + " 2>/dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  return between(text_of(folder / "dom.html"), "<body", ">");
}

}  // namespace phyxel::test
