#include "label.hpp"

#include <algorithm>

namespace phyxel::app {
namespace {

constexpr int columns = 5, rows = 7, advance = 6;
constexpr int fine = 4;  // samples per pixel and axis

struct Glyph {
  char character;
  std::array<const char*, rows> dots;
};

constexpr Glyph font[] = {
    {'0', {" ### ", "#   #", "#   #", "#   #", "#   #", "#   #", " ### "}},
    {'1', {"  #  ", " ##  ", "# #  ", "  #  ", "  #  ", "  #  ", "#####"}},
    {'2', {" ### ", "#   #", "    #", "   # ", "  #  ", " #   ", "#####"}},
    {'3', {" ### ", "#   #", "    #", "  ## ", "    #", "#   #", " ### "}},
    {'4', {"   # ", "  ## ", " # # ", "#  # ", "#####", "   # ", "   # "}},
    {'5', {"#####", "#    ", "#### ", "    #", "    #", "#   #", " ### "}},
    {'6', {" ### ", "#    ", "#    ", "#### ", "#   #", "#   #", " ### "}},
    {'7', {"#####", "    #", "   # ", "   # ", "  #  ", "  #  ", "  #  "}},
    {'8', {" ### ", "#   #", "#   #", " ### ", "#   #", "#   #", " ### "}},
    {'9', {" ### ", "#   #", "#   #", " ####", "    #", "    #", " ### "}},
    {'.', {"     ", "     ", "     ", "     ", "     ", " ##  ", " ##  "}},
    {'=', {"     ", "     ", "#####", "     ", "#####", "     ", "     "}},
    {'s', {"     ", "     ", " ####", "#    ", " ### ", "    #", "#### "}},
    {'t', {" #   ", " #   ", "#### ", " #   ", " #   ", " #   ", "  ## "}},
    {'a', {"     ", "     ", " ### ", "    #", " ####", "#   #", " ####"}},
    {'b', {"#    ", "#    ", "#### ", "#   #", "#   #", "#   #", "#### "}},
    {'c', {"     ", "     ", " ### ", "#    ", "#    ", "#    ", " ### "}},
    {'d', {"    #", "    #", " ####", "#   #", "#   #", "#   #", " ####"}},
    {'e', {"     ", "     ", " ### ", "#   #", "#####", "#    ", " ### "}},
    {'f', {"  ## ", " #   ", "#### ", " #   ", " #   ", " #   ", " #   "}},
    {'g', {"     ", "     ", " ####", "#   #", " ####", "    #", " ### "}},
    {'h', {"#    ", "#    ", "#### ", "#   #", "#   #", "#   #", "#   #"}},
    {'i', {"  #  ", "     ", " ##  ", "  #  ", "  #  ", "  #  ", " ### "}},
    {'j', {"   # ", "     ", "  ## ", "   # ", "   # ", "#  # ", " ##  "}},
    {'k', {"#    ", "#    ", "#  # ", "# #  ", "##   ", "# #  ", "#  # "}},
    {'l', {" ##  ", "  #  ", "  #  ", "  #  ", "  #  ", "  #  ", " ### "}},
    {'m', {"     ", "     ", "#### ", "# # #", "# # #", "# # #", "# # #"}},
    {'n', {"     ", "     ", "#### ", "#   #", "#   #", "#   #", "#   #"}},
    {'o', {"     ", "     ", " ### ", "#   #", "#   #", "#   #", " ### "}},
    {'p', {"     ", "     ", "#### ", "#   #", "#### ", "#    ", "#    "}},
    {'q', {"     ", "     ", " ####", "#   #", " ####", "    #", "    #"}},
    {'r', {"     ", "     ", "# ## ", "##   ", "#    ", "#    ", "#    "}},
    {'u', {"     ", "     ", "#   #", "#   #", "#   #", "#   #", " ####"}},
    {'v', {"     ", "     ", "#   #", "#   #", "#   #", " # # ", "  #  "}},
    {'w', {"     ", "     ", "#   #", "# # #", "# # #", "# # #", " # # "}},
    {'x', {"     ", "     ", "#   #", " # # ", "  #  ", " # # ", "#   #"}},
    {'y', {"     ", "     ", "#   #", "#   #", " ####", "    #", " ### "}},
    {'z', {"     ", "     ", "#####", "   # ", "  #  ", " #   ", "#####"}},
    {'P', {"#### ", "#   #", "#   #", "#### ", "#    ", "#    ", "#    "}},
    {'-', {"     ", "     ", "     ", " ### ", "     ", "     ", "     "}},
    {'+', {"     ", "     ", "  #  ", " ### ", "  #  ", "     ", "     "}},
    {'_', {"     ", "     ", "     ", "     ", "     ", "     ", "#####"}},
    {'/', {"     ", "    #", "   # ", "  #  ", " #   ", "#    ", "     "}},
    {'^', {"  #  ", " # # ", "#   #", "     ", "     ", "     ", "     "}},
    {'[', {" ### ", " #   ", " #   ", " #   ", " #   ", " #   ", " ### "}},
    {']', {" ### ", "   # ", "   # ", "   # ", "   # ", "   # ", " ### "}},
};

const Glyph* find_glyph(char character) {
  const auto* glyph = std::find_if(std::begin(font), std::end(font),
                                   [&](const Glyph& g) { return g.character == character; });
  return glyph == std::end(font) ? nullptr : glyph;
}

/// Squared distance of (x, y) to the nearest stroke, in dots. A stroke joins the centres of two
/// adjacent dots, which gives the font round ends instead of steps.
double stroke_distance(const Glyph& glyph, double x, double y) {
  double nearest = 1e9;
  const auto on = [&](int c, int r) {
    return c >= 0 && c < columns && r >= 0 && r < rows &&
           glyph.dots[static_cast<std::size_t>(r)][c] == '#';
  };
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      if (!on(c, r)) continue;
      const double px = x - c - 0.5, py = y - r - 0.5;
      nearest = std::min(nearest, px * px + py * py);
      for (const auto& [dc, dr] : {std::pair{1, 0}, {0, 1}, {1, 1}, {-1, 1}}) {
        if (!on(c + dc, r + dr)) continue;
        if (dc != 0 && dr != 0 && (on(c + dc, r) || on(c, r + dr)))
          continue;  // the two dots belong to a corner, not to a slope
        const double along = std::clamp((px * dc + py * dr) / (dc * dc + dr * dr), 0.0, 1.0);
        const double ex = px - along * dc, ey = py - along * dr;
        nearest = std::min(nearest, ex * ex + ey * ey);
      }
    }
  }
  return nearest;
}

void darken(std::uint8_t* pixel, double cover) {
  constexpr double ink = 70;  // sRGB grey
  for (int k = 0; k < 3; ++k) {
    pixel[k] = static_cast<std::uint8_t>(std::lround(pixel[k] + cover * (ink - pixel[k])));
  }
}

}  // namespace

double text_scale(const Image& image) {
  return std::max(1.0, 0.0034 * std::min(image.width, image.height));
}

void draw_text(Image& image, int x, int y, double scale, std::string_view text) {
  for (std::size_t k = 0; k < text.size(); ++k) {
    const Glyph* glyph = find_glyph(text[k]);
    if (glyph == nullptr) continue;
    const double left = x + scale * advance * static_cast<double>(k);
    for (int py = std::max(0, y); py < std::min<double>(image.height, y + scale * rows + 1); ++py) {
      for (int px = std::max(0, static_cast<int>(left));
           px < std::min<double>(image.width, left + scale * columns + 1); ++px) {
        int inside = 0;
        for (int v = 0; v < fine; ++v) {
          for (int u = 0; u < fine; ++u) {
            const double dx = (px + (u + 0.5) / fine - left) / scale;
            const double dy = (py + (v + 0.5) / fine - y) / scale;
            inside += stroke_distance(*glyph, dx, dy) < 0.38 * 0.38;
          }
        }
        darken(image.pixel(px, py), static_cast<double>(inside) / (fine * fine));
      }
    }
  }
}

}  // namespace phyxel::app
