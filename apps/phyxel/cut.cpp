#include "cut.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>

#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

/// The numbers of a list with commas; unset if one of them is none, or not finite.
std::optional<std::vector<double>> numbers_in(std::string_view text) {
  std::vector<double> numbers;
  while (true) {
    const std::size_t comma = std::min(text.find(','), text.size());
    double number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + comma, number);
    if (error != std::errc() || end != text.data() + comma || !std::isfinite(number)) {
      return std::nullopt;
    }
    numbers.push_back(number);
    if (comma == text.size()) return numbers;
    text.remove_prefix(comma + 1);
  }
}

/// The points at which edges of a surface cross a plane, each made once.
class Crossings {
 public:
  Crossings(DrawnSurface& surface, const std::vector<double>& height)
      : surface_(surface), height_(height) {}

  /// The number of the point between vertices on different sides.
  Index between(Index a, Index b) {
    if (a > b) std::swap(a, b);  // the two triangles at an edge get the same point
    const auto [at, is_new] = made_.try_emplace({a, b}, static_cast<Index>(surface_.point.size()));
    if (is_new) add(a, b);
    return at->second;
  }

 private:
  void add(Index a, Index b) {
    const double share = height_[a] / (height_[a] - height_[b]);
    const auto mixed = [&](auto& values, auto t) {
      values.push_back((1 - t) * values[a] + t * values[b]);
    };
    mixed(surface_.point, share);
    mixed(surface_.normal, share);
    mixed(surface_.colour, static_cast<float>(share));
    if (!surface_.body.empty()) surface_.body.push_back(surface_.body[a]);
  }

  DrawnSurface& surface_;
  const std::vector<double>& height_;
  std::map<std::pair<Index, Index>, Index> made_;
};

/// A point on the image [samples].
struct Spot {
  double x, y;
};

/// The projection of a plane, in samples. Of what is nearly beside the eye or behind it, the
/// nearest place of the plane is projected that is not: it lies far beyond the image.
class Projection {
 public:
  Projection(const Rasteriser& rasteriser, const CutPlane& plane)
      : camera_(rasteriser.camera()), samples_(rasteriser.samples()) {
    nearest_ = 0.01 * plane.height(camera_.eye);
    deeper_ = camera_.forward - dot(camera_.forward, plane.normal) * plane.normal;
  }

  /// The images of an edge: one piece, or two if it passes the eye.
  std::vector<std::array<Spot, 2>> of(std::array<Vec3d, 2> edge) const {
    const double a = depth(edge[0]), b = depth(edge[1]);
    if ((a < nearest_) == (b < nearest_)) return {{spot(edge[0]), spot(edge[1])}};
    const Spot between = spot(edge[0] + ((nearest_ - a) / (b - a)) * (edge[1] - edge[0]));
    return {{spot(edge[0]), between}, {between, spot(edge[1])}};
  }

 private:
  double depth(Vec3d p) const { return dot(p - camera_.eye, camera_.forward); }
  Spot spot(Vec3d p) const {
    const double lacking = nearest_ - depth(p), square = dot(deeper_, deeper_);
    if (lacking > 0 && square > 0) p += (lacking / square) * deeper_;
    const Camera::Place place = camera_.project(p);
    return {samples_ * place.x, samples_ * place.y};
  }

  const Camera& camera_;
  int samples_;
  double nearest_;  // least depth [m]
  Vec3d deeper_;    // direction in the plane along which depth grows
};

/// Where the outline crosses the middle of a row of samples.
struct Turn {
  double x;
  int direction;
};

/// The turns of the outline, by rows of samples.
std::vector<std::vector<Turn>> turns_of(const CutOutline& outline, const Projection& projection,
                                        int rows) {
  std::vector<std::vector<Turn>> turns(static_cast<std::size_t>(rows));
  const auto first_row = [&](double y) {  // first row whose middle is at or below y
    return static_cast<int>(std::clamp(std::ceil(y - 0.5), 0.0, static_cast<double>(rows)));
  };
  for (const auto& edge : outline.edges) {
    for (auto [a, b] : projection.of(edge)) {
      const int direction = a.y < b.y ? 1 : -1;
      if (direction < 0) std::swap(a, b);
      for (int row = first_row(a.y); row < first_row(b.y); ++row) {
        const double share = (row + 0.5 - a.y) / (b.y - a.y);
        turns[static_cast<std::size_t>(row)].push_back({a.x + share * (b.x - a.x), direction});
      }
    }
  }
  return turns;
}

/// Calls visit(x) for the samples of a row that the outline goes around.
template <class Visit>
void for_each_inside(std::vector<Turn>& turns, int width, Visit&& visit) {
  std::sort(turns.begin(), turns.end(), [](const Turn& a, const Turn& b) { return a.x < b.x; });
  int around = 0;
  for (const Turn& turn : turns) around += turn.direction;
  if (around != 0) return;  // the outline is open
  const auto first = [&](double x) {
    return static_cast<int>(std::clamp(std::ceil(x - 0.5), 0.0, static_cast<double>(width)));
  };
  for (std::size_t k = 0; k + 1 < turns.size(); ++k) {
    around += turns[k].direction;
    if (around == 0) continue;
    for (int x = first(turns[k].x); x < first(turns[k + 1].x); ++x) visit(x);
  }
}

}  // namespace

CutPlane cut_plane(const std::string& text, Vec3d eye) {
  const Vec3d axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  if (text.size() > 2 && text[1] == '=' && text[0] >= 'x' && text[0] <= 'z') {
    const auto position = numbers_in(std::string_view(text).substr(2));
    if (position && position->size() == 1) {
      const Vec3d axis = axes[text[0] - 'x'], point = position->front() * axis;
      return {point, dot(eye - point, axis) < 0 ? -1.0 * axis : axis};
    }
  }
  const auto six = numbers_in(text);
  if (six && six->size() == 6) {
    const Vec3d normal{(*six)[3], (*six)[4], (*six)[5]};
    if (norm(normal) > 0 && std::isfinite(norm(normal))) {
      return {{(*six)[0], (*six)[1], (*six)[2]}, normalised(normal)};
    }
  }
  throw InputError(
      fmt::format("--cut {}: allowed: a position [m] along an axis, as in --cut y=0.1, or a point "
                  "[m] and a normal that is not zero, as in --cut 0,0,0.1,0,1,1",
                  text));
}

std::vector<CutOutline> cut_away(DrawnSurface& surface, const CutPlane& plane) {
  std::vector<double> height;
  for (const Vec3d& p : surface.point) height.push_back(plane.height(p));
  Crossings crossings(surface, height);
  std::map<Index, CutOutline> outlines;
  std::vector<Triangle> kept;
  for (const Triangle& t : surface.triangle) {
    const auto is_kept = [&](std::size_t c) { return !(height[t[c % 3]] > 0); };
    const int count = is_kept(0) + is_kept(1) + is_kept(2);
    if (count == 3) kept.push_back(t);
    if (count == 0 || count == 3) continue;
    // The corner that is alone on its side, and the two after it.
    std::size_t alone = 0;
    while (is_kept(alone) != (count == 1)) ++alone;
    const Index a = t[alone], b = t[(alone + 1) % 3], c = t[(alone + 2) % 3];
    const Index ab = crossings.between(a, b), ca = crossings.between(a, c);
    if (count == 1) {
      kept.push_back({a, ab, ca});
    } else {
      kept.push_back({ab, b, c});
      kept.push_back({ab, c, ca});
    }
    const Index body = surface.body.empty() ? 0 : surface.body[a];
    CutOutline& outline = outlines[body];
    outline.body = body;
    const Vec3d from = surface.point[count == 1 ? ab : ca],
                to = surface.point[count == 1 ? ca : ab];
    outline.edges.push_back({from, to});
  }
  surface.triangle = std::move(kept);
  std::vector<CutOutline> list;
  for (auto& [body, outline] : outlines) list.push_back(std::move(outline));
  return list;
}

void draw_face(Rasteriser& rasteriser, const CutOutline& outline, const CutPlane& plane,
               const FaceColours& colours) {
  const Camera& camera = rasteriser.camera();
  const double above = plane.height(camera.eye);
  if (!(above > 0)) return;  // the camera sees the body from behind the cut
  const int samples = rasteriser.samples();
  const int width = camera.width * samples, rows = camera.height * samples;
  auto turns = turns_of(outline, Projection(rasteriser, plane), rows);
  // Colours are found for each pixel, at the middle of it.
  std::vector<int> number(static_cast<std::size_t>(camera.width) * camera.height, -1);
  std::vector<Vec3d> places;
  struct Sample {
    int x, y, place;
    float nearness;
  };
  std::vector<Sample> inside;
  const auto depth_at = [&](double x, double y) {
    return -above / dot(camera.ray(x, y), plane.normal);
  };
  for (int y = 0; y < rows; ++y) {
    for_each_inside(turns[static_cast<std::size_t>(y)], width, [&](int x) {
      const double depth = depth_at((x + 0.5) / samples, (y + 0.5) / samples);
      if (!(depth > 0) || !std::isfinite(depth)) return;
      int& place = number[static_cast<std::size_t>(y / samples) * camera.width + x / samples];
      if (place < 0) {
        place = static_cast<int>(places.size());
        const double px = x / samples + 0.5, py = y / samples + 0.5, there = depth_at(px, py);
        const bool fits = there > 0 && std::isfinite(there);
        places.push_back(camera.eye + (fits ? there : depth) * camera.ray(px, py));
      }
      inside.push_back({x, y, place, static_cast<float>(1 / depth)});
    });
  }
  if (inside.empty()) return;
  const std::vector<Colour> colour = colours(places);
  const auto along = [&](Vec3d axis) { return static_cast<float>(dot(plane.normal, axis)); };
  const Vec3<float> normal{along(camera.right), along(camera.up), -along(camera.forward)};
  for (const Sample& s : inside) {
    rasteriser.blend(s.x, s.y,
                     {s.nearness, rasteriser.lit(colour[s.place], normal, 1), 1, outline.body});
  }
}

}  // namespace phyxel::app
