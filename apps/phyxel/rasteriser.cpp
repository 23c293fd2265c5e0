#include "rasteriser.hpp"

#include <algorithm>

namespace phyxel::app {
namespace {

using Vec3f = Vec3<float>;

// Directions in the camera's axes: x right, y up, z towards the viewer.
constexpr Vec3f key_light{-0.44f, 0.66f, 0.61f}, fill_light{0.80f, 0.05f, 0.60f};
constexpr Vec3f key_halfway{-0.245f, 0.368f, 0.897f};  // halfway between key light and viewer
constexpr Colour key_colour{0.80f, 0.77f, 0.72f}, fill_colour{0.13f, 0.15f, 0.19f};
constexpr Colour sky_colour{0.40f, 0.42f, 0.45f}, ground_colour{0.17f, 0.15f, 0.14f};

// Vertices are rounded to 1/256 of a sample, so that edge functions are exact integers and
// neighbouring triangles leave no gap.
constexpr std::int64_t subsample = 256;
constexpr double farthest_sample = 1 << 20;  // limit against overflow of edge functions

Colour times(Colour a, Colour b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

Vec3f unit(Vec3f v) {
  const float length = std::sqrt(dot(v, v));
  // A zero or non-finite vector is replaced by the direction towards the viewer.
  return length > 0 && std::isfinite(length) ? v / length : Vec3f{0, 0, 1};
}

/// Number of samples per pixel and axis: 3, or fewer to keep the buffers within about a gigabyte.
int choose_samples(const Camera& camera) {
  const double pixels = static_cast<double>(camera.width) * camera.height;
  return pixels * 9 <= 5e7 ? 3 : pixels * 4 <= 8e7 ? 2 : 1;
}

}  // namespace

struct Rasteriser::Vertex {
  std::int64_t x, y;  // [samples / 256]
  float nearness;     // 1 / depth; 0 if not drawable
  Vec3f normal;       // in the camera's axes, times nearness
  Colour colour;      // times nearness
};

struct Rasteriser::Disc {
  float x, y, radius;  // [samples]
  float depth, bulge;  // depth of the centre, and how much nearer the front of the sphere is [m]
};

Rasteriser::Rasteriser(const Camera& camera, Vec3d up, Colour top, Colour bottom, int samples)
    : camera_(camera),
      samples_(samples > 0 ? samples : choose_samples(camera)),
      width_(camera.width * samples_),
      height_(camera.height * samples_),
      centre_x_(0.5f * static_cast<float>(width_)),
      centre_y_(0.5f * static_cast<float>(height_)),
      per_focal_(static_cast<float>(1 / (camera.focal * samples_))) {
  const Vec3d sky = normalised(up);
  sky_ = {static_cast<float>(dot(sky, camera.right)), static_cast<float>(dot(sky, camera.up)),
          static_cast<float>(-dot(sky, camera.forward))};
  const std::size_t count = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  nearness_.assign(count, 0.0f);
  body_.assign(count, -1);
  colour_.resize(count);
  for (int y = 0; y < height_; ++y) {
    const float t = (static_cast<float>(y) + 0.5f) / static_cast<float>(height_);
    std::fill_n(&colour_[at(0, y)], width_, (1 - t) * top + t * bottom);
  }
}

Rasteriser::Vertex Rasteriser::vertex(Vec3d point, Vec3d normal, Colour colour) const {
  Vertex v{};
  const Camera::Place place = camera_.project(point);
  const double x = place.x * samples_, y = place.y * samples_;
  // The negated comparison also rejects NaN.
  if (!(place.depth > 0 && std::abs(x) < farthest_sample && std::abs(y) < farthest_sample))
    return v;
  v.x = std::llround(x * subsample);
  v.y = std::llround(y * subsample);
  v.nearness = static_cast<float>(1 / place.depth);
  v.normal = v.nearness * Vec3f{static_cast<float>(dot(normal, camera_.right)),
                                static_cast<float>(dot(normal, camera_.up)),
                                static_cast<float>(-dot(normal, camera_.forward))};
  v.colour = v.nearness * colour;
  return v;
}

Colour Rasteriser::lit(Colour colour, Vec3f n, float key) const {
  const float up = 0.5f + 0.5f * dot(n, sky_);
  Colour light = (1 - up) * ground_colour + up * sky_colour;
  // Lambert shading wrapped by a tenth, for the soft shadow edge of soft material.
  const auto lambert = [&](Vec3f direction) {
    return std::max(0.0f, (dot(n, direction) + 0.1f) / 1.1f);
  };
  light += (key * lambert(key_light)) * key_colour;
  light += lambert(fill_light) * fill_colour;
  float gloss = std::max(0.0f, dot(n, key_halfway));
  for (int k = 0; k < 5; ++k) gloss *= gloss;  // Blinn-Phong, exponent 32
  return times(colour, light) + (0.10f * key * gloss) * Colour{1, 1, 1};
}

Colour Rasteriser::shade(Colour colour, Vec3f n, float x, float y) const {
  const Vec3f viewer = unit({(centre_x_ - x) * per_focal_, (y - centre_y_) * per_focal_, 1.0f});
  const float facing = std::clamp(dot(n, viewer), 0.0f, 1.0f);
  // Contours are darkened.
  const float rim = 1 - facing;
  const float contour = 1 - 0.55f * rim * rim * rim * rim;
  return contour * lit(colour, n, 1);
}

void Rasteriser::blend(int x, int y, const Fragment& fragment) {
  const std::size_t s = at(x, y);
  if (!(fragment.nearness > nearness_[s])) return;
  colour_[s] = (1 - fragment.opacity) * colour_[s] + fragment.opacity * fragment.colour;
  if (fragment.opacity <= 0.5f) return;
  nearness_[s] = fragment.nearness;
  body_[s] = fragment.body;
}

void Rasteriser::draw_triangle(const Vertex& a, const Vertex& b, const Vertex& c, Index body) {
  if (a.nearness == 0 || b.nearness == 0 || c.nearness == 0) return;
  const std::int64_t area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
  if (area == 0) return;
  // y points down, so a triangle that is counter-clockwise for the viewer has a negative area.
  const float side = area < 0 ? 1.0f : -1.0f;
  const Vertex& p = a;
  const Vertex& q = area < 0 ? c : b;
  const Vertex& r = area < 0 ? b : c;

  const auto first = [](std::int64_t v) {  // first sample whose centre is at or after v
    return static_cast<int>((v - subsample / 2 + subsample - 1) >> 8);
  };
  const auto last = [](std::int64_t v) { return static_cast<int>((v - subsample / 2) >> 8); };
  const int x0 = std::max(0, first(std::min({p.x, q.x, r.x})));
  const int x1 = std::min(width_ - 1, last(std::max({p.x, q.x, r.x})));
  const int y0 = std::max(0, first(std::min({p.y, q.y, r.y})));
  const int y1 = std::min(height_ - 1, last(std::max({p.y, q.y, r.y})));
  if (x0 > x1 || y0 > y1) return;

  const std::int64_t cx = x0 * subsample + subsample / 2, cy = y0 * subsample + subsample / 2;
  // Edge functions: twice the area of the triangle of the sample and the opposite edge.
  std::int64_t row_p = (r.x - q.x) * (cy - q.y) - (r.y - q.y) * (cx - q.x);
  std::int64_t row_q = (p.x - r.x) * (cy - r.y) - (p.y - r.y) * (cx - r.x);
  std::int64_t row_r = (q.x - p.x) * (cy - p.y) - (q.y - p.y) * (cx - p.x);
  const float per_area = 1.0f / static_cast<float>(std::abs(area));
  for (int y = y0; y <= y1; ++y) {
    std::int64_t edge_p = row_p, edge_q = row_q, edge_r = row_r;
    for (int x = x0; x <= x1; ++x) {
      if ((edge_p | edge_q | edge_r) >= 0) {
        const float wp = static_cast<float>(edge_p) * per_area;
        const float wq = static_cast<float>(edge_q) * per_area;
        const float wr = static_cast<float>(edge_r) * per_area;
        // Values divided by depth are linear on the image.
        const float nearness = wp * p.nearness + wq * q.nearness + wr * r.nearness;
        const std::size_t s = at(x, y);
        if (nearness > nearness_[s]) {
          const Vec3f n = side * unit(wp * p.normal + wq * q.normal + wr * r.normal);
          const Colour colour = (wp * p.colour + wq * q.colour + wr * r.colour) / nearness;
          nearness_[s] = nearness;
          colour_[s] = shade(colour, n, static_cast<float>(x), static_cast<float>(y));
          body_[s] = body;
        }
      }
      edge_p -= (r.y - q.y) * subsample;
      edge_q -= (p.y - r.y) * subsample;
      edge_r -= (q.y - p.y) * subsample;
    }
    row_p += (r.x - q.x) * subsample;
    row_q += (p.x - r.x) * subsample;
    row_r += (q.x - p.x) * subsample;
  }
}

void Rasteriser::draw_surface(std::span<const Vec3d> point, std::span<const Vec3d> normal,
                              std::span<const Triangle> triangle, std::span<const Colour> colour,
                              std::span<const Index> body) {
  std::vector<Vertex> vertices(point.size());
  for (std::size_t s = 0; s < point.size(); ++s) {
    vertices[s] = vertex(point[s], normal[s], colour[s]);
  }
  for (const Triangle& t : triangle) {
    draw_triangle(vertices[t[0]], vertices[t[1]], vertices[t[2]], body.empty() ? 0 : body[t[0]]);
  }
}

// 1 / depth is linear over the image of a plane, so the mean of two opposite samples minus the one
// between them is positive in a hollow, zero on a plane and negative on a bulge; normals are not
// needed. Source of the idea: Luft et al. 2006, "Image enhancement by unsharp masking the depth
// buffer".
void Rasteriser::shade_hollows(double reach) {
  constexpr int directions = 6, rings = 4;
  constexpr float strength = 0.62f;
  if (!(reach > 0)) return;
  struct Direction {
    float x, y;
  };
  std::array<Direction, directions * rings> around;
  for (int ring = 0; ring < rings; ++ring) {
    for (int k = 0; k < directions; ++k) {
      const float angle =
          3.14159265f * (static_cast<float>(k) + 0.25f * static_cast<float>(ring)) / directions;
      around[ring * directions + k] = {std::cos(angle), std::sin(angle)};
    }
  }
  std::vector<float> darker(static_cast<std::size_t>(camera_.width) *
                            static_cast<std::size_t>(camera_.height));
  const float reach_in_samples = static_cast<float>(reach * camera_.focal * samples_);
  const auto farthest = static_cast<float>(width_ + height_);
  const auto size = static_cast<float>(reach);
  std::size_t p = 0;
  for (int y = samples_ / 2; y < height_; y += samples_) {
    for (int x = samples_ / 2; x < width_; x += samples_, ++p) {
      const float here = nearness_[at(x, y)];
      if (here == 0) continue;
      const float per_size = 1 / (here * here * size);  // d(depth) = d(nearness) / nearness^2
      // Height of a neighbour above this sample in units of the reach; one far in front belongs to
      // another object.
      const auto height = [&](int u, int v) {
        const int nx = std::clamp(u, 0, width_ - 1), ny = std::clamp(v, 0, height_ - 1);
        return (nearness_[at(nx, ny)] - here) * per_size;
      };
      const auto rise = [](float step) {
        return step > 1 ? std::max(0.0f, 2 - step) : std::max(-1.0f, step);
      };
      const bool is_obstacle = body_[at(x, y)] < -1;
      float sum = 0;
      for (int ring = 0; ring < rings; ++ring) {
        // The order of the arguments also bounds NaN.
        const float wanted = reach_in_samples * here * static_cast<float>(ring + 1) / rings;
        const float radius = wanted < farthest ? wanted : farthest;
        for (int k = 0; k < directions; ++k) {
          const Direction& way = around[ring * directions + k];
          const int u = static_cast<int>(std::lround(radius * way.x));
          const int v = static_cast<int>(std::lround(radius * way.y));
          const float one = height(x + u, y + v), other = height(x - u, y - v);
          const float hollow = rise(one) + rise(other);
          float dark = std::clamp(hollow * rings / static_cast<float>(ring + 1), 0.0f, 1.0f);
          if (is_obstacle && dark > 0) {
            // Far away, planes rise steeply: without its opposite a sample says nothing of them.
            const int most = std::max(std::abs(u), std::abs(v));
            if (x < most || y < most || x + most >= width_ || y + most >= height_) continue;
            dark *= std::clamp(2 - std::max(one, other), 0.0f, 1.0f);
          }
          sum += dark;
        }
      }
      darker[p] = strength * sum / (directions * rings);
    }
  }
  p = 0;
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width; ++x, ++p) {
      if (darker[p] == 0) continue;
      for (int v = 0; v < samples_; ++v) {
        for (int u = 0; u < samples_; ++u) {
          const std::size_t s = at(x * samples_ + u, y * samples_ + v);
          if (nearness_[s] > 0) colour_[s] = (1 - darker[p]) * colour_[s];
        }
      }
    }
  }
}

Rasteriser::Disc Rasteriser::disc(Vec3d centre, const DotStyle& style) const {
  const Camera::Place place = camera_.project(centre);
  Disc d{};
  if (!(place.depth > 0 && std::abs(place.x) < farthest_sample &&
        std::abs(place.y) < farthest_sample && std::isfinite(style.radius))) {
    return d;
  }
  d.x = static_cast<float>(place.x * samples_);
  d.y = static_cast<float>(place.y * samples_);
  d.radius = static_cast<float>(samples_ * std::clamp(style.radius * camera_.focal / place.depth,
                                                      style.smallest, style.largest));
  d.depth = static_cast<float>(place.depth);
  d.bulge = static_cast<float>(std::min(style.radius, 0.5 * place.depth));
  return d;
}

/// Calls plot(sample, unit normal of the sphere) for each sample of the sphere's disc.
template <class Plot>
void Rasteriser::for_each_sample(const Disc& d, const Plot& plot) const {
  if (d.depth == 0) return;
  const auto clamped = [](float v, int limit) {
    return static_cast<int>(std::clamp(v, 0.0f, static_cast<float>(limit)));
  };
  const int x0 = clamped(std::ceil(d.x - d.radius - 0.5f), width_);
  const int x1 = clamped(std::floor(d.x + d.radius - 0.5f) + 1, width_);
  const int y0 = clamped(std::ceil(d.y - d.radius - 0.5f), height_);
  const int y1 = clamped(std::floor(d.y + d.radius - 0.5f) + 1, height_);
  const float per_radius = 1 / d.radius;
  for (int y = y0; y < y1; ++y) {
    const float v = (d.y - static_cast<float>(y) - 0.5f) * per_radius;
    for (int x = x0; x < x1; ++x) {
      const float u = (static_cast<float>(x) + 0.5f - d.x) * per_radius;
      const float square = u * u + v * v;
      if (square < 1) plot(at(x, y), Vec3f{u, v, std::sqrt(1 - square)});
    }
  }
}

void Rasteriser::draw_spheres(std::span<const Vec3d> centre, std::span<const Colour> colour,
                              std::span<const Index> body, const DotStyle& style) {
  for (std::size_t i = 0; i < centre.size(); ++i) {
    const Disc d = disc(centre[i], style);
    for_each_sample(d, [&](std::size_t s, Vec3f n) {
      const float nearness = 1 / (d.depth - d.bulge * n.z);
      if (nearness <= nearness_[s]) return;
      nearness_[s] = nearness;
      colour_[s] = shade(colour[i], n, d.x, d.y);
      body_[s] = body.empty() ? 0 : body[i];
    });
  }
}

void Rasteriser::draw_dots(std::span<const Vec3d> centre, std::span<const Colour> colour,
                           std::span<const Index> body, const DotStyle& style) {
  // Farthest first; equal depths in the order of the points.
  std::vector<std::pair<float, Index>> order(centre.size());
  for (std::size_t i = 0; i < centre.size(); ++i) {
    const double depth = dot(centre[i] - camera_.eye, camera_.forward);
    order[i] = {std::isfinite(depth) ? static_cast<float>(-depth) : 0.0f, static_cast<Index>(i)};
  }
  std::sort(order.begin(), order.end());
  const float faintest = static_cast<float>(style.faintest);
  const float per_fade = style.fade > 0 ? static_cast<float>(1 / style.fade) : 0.0f;
  for (const auto& entry : order) {
    const Index i = entry.second;
    const Disc d = disc(centre[i], style);
    const Index own = body.empty() ? 0 : body[i];
    for_each_sample(d, [&](std::size_t s, Vec3f n) {
      float opacity = 1;
      if (nearness_[s] > 0) {
        const float below = d.depth - 1 / nearness_[s];
        if (below > 0) {
          if (body_[s] != own) return;
          opacity = faintest + (0.95f - faintest) * std::exp(-below * per_fade);
        }
      }
      const Colour shaded = shade(colour[i], n, d.x, d.y);
      colour_[s] = (1 - opacity) * colour_[s] + opacity * shaded;
    });
  }
}

Image Rasteriser::resolve() const {
  Image image{camera_.width, camera_.height, {}};
  image.rgb.resize(3 * static_cast<std::size_t>(image.width) *
                   static_cast<std::size_t>(image.height));
  const float share = 1.0f / static_cast<float>(samples_ * samples_);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      Colour sum{};
      for (int v = 0; v < samples_; ++v) {
        const Colour* row = &colour_[at(x * samples_, y * samples_ + v)];
        for (int u = 0; u < samples_; ++u) sum += row[u];
      }
      std::uint8_t* pixel = image.pixel(x, y);
      pixel[0] = encode(share * sum.x);
      pixel[1] = encode(share * sum.y);
      pixel[2] = encode(share * sum.z);
    }
  }
  return image;
}

}  // namespace phyxel::app
