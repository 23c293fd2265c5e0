#include "shapes/surface_remesh.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <stdexcept>
#include <tuple>

namespace phyxel {
namespace {

/// A closed manifold triangle mesh with edge collapse and edge flip, which keep it so.
class Remesher {
 public:
  Remesher(const ImplicitBody& body, Surface surface) : body_(body), s_(std::move(surface)) {
    around_.resize(s_.position.size());
    for (std::size_t t = 0; t < s_.triangle.size(); ++t) {
      for (const Index v : s_.triangle[t]) around_[v].push_back(static_cast<Index>(t));
    }
    const auto n = static_cast<std::ptrdiff_t>(s_.position.size());
#pragma omp parallel for schedule(static)
    for (std::ptrdiff_t v = 0; v < n; ++v)
      move(static_cast<Index>(v), body_.project(s_.position[v]));
  }

  /// Collapses the shortest edges until `vertices` are left.
  void thin_to(Index vertices) {
    Index left = static_cast<Index>(s_.position.size());
    for (Index v = 0; v < left; ++v) push_edges(v, [v](Index w) { return w > v; });
    while (left > vertices) {
      if (queue_.empty()) throw std::logic_error("no edge of the surface can be collapsed");
      const auto [length2, a, b] = queue_.top();
      queue_.pop();
      // An entry is stale if its edge was moved or removed.
      if (around_[a].empty() || around_[b].empty() || length2 != squared_length(a, b)) continue;
      if (!collapse(a, b)) continue;
      --left;
      push_edges(a, [](Index) { return true; });
    }
    queue_ = {};
  }

  void smooth(int passes) {
    for (int pass = 0; pass < passes; ++pass) {
      flip_edges();
      for (std::size_t v = 0; v < around_.size(); ++v) {
        if (!around_[v].empty()) centre_among_neighbours(static_cast<Index>(v));
      }
    }
    flip_edges();
  }

  Surface result() const {
    Surface out;
    std::vector<Index> number(s_.position.size(), -1);
    for (std::size_t v = 0; v < number.size(); ++v) {
      if (around_[v].empty()) continue;
      number[v] = static_cast<Index>(out.position.size());
      out.position.push_back(s_.position[v]);
    }
    for (const Triangle& t : s_.triangle) {
      if (t[0] >= 0) out.triangle.push_back({number[t[0]], number[t[1]], number[t[2]]});
    }
    out.normal = vertex_normals(out.position, out.triangle);
    return out;
  }

 private:
  using Edge = std::tuple<double, Index, Index>;

  double squared_length(Index a, Index b) const {
    const Vec3d d = s_.position[a] - s_.position[b];
    return dot(d, d);
  }
  void move(Index v, const SurfacePoint& p) {
    s_.position[v] = p.position;
    s_.normal[v] = p.normal;
  }
  static bool has(const Triangle& t, Index v) { return t[0] == v || t[1] == v || t[2] == v; }

  std::vector<Index> neighbours(Index v) const {
    std::vector<Index> ring;
    for (const Index t : around_[v]) {
      const Triangle& c = s_.triangle[t];
      const int k = c[0] == v ? 0 : c[1] == v ? 1 : 2;
      ring.push_back(c[(k + 1) % 3]);  // each neighbour follows v once, as the mesh is manifold
    }
    return ring;
  }

  template <class Which>
  void push_edges(Index v, Which which) {
    for (const Index w : neighbours(v)) {
      if (which(w)) queue_.emplace(squared_length(v, w), std::min(v, w), std::max(v, w));
    }
  }

  /// Quality of a triangle seen against the outward direction: 0.87 if it is equilateral, 0 if
  /// degenerate, negative if inverted.
  static double quality(Vec3d a, Vec3d b, Vec3d c, Vec3d outward) {
    const Vec3d ab = b - a, bc = c - b, ca = a - c;
    return dot(cross(ab, -ca), outward) / std::max({dot(ab, ab), dot(bc, bc), dot(ca, ca)});
  }
  /// Quality of a triangle with one corner moved to `p`.
  double quality(const Triangle& t, Index corner, const SurfacePoint& p) const {
    std::array<Vec3d, 3> x;
    for (int k = 0; k < 3; ++k) x[k] = t[k] == corner ? p.position : s_.position[t[k]];
    return quality(x[0], x[1], x[2], p.normal);
  }
  SurfacePoint point(Index v) const { return {s_.position[v], s_.normal[v]}; }

  /// Merges b into a. @returns false, with the mesh unchanged, if the mesh would not be manifold
  /// (link condition: a and b share exactly the two vertices opposite their edge) or a triangle
  /// would be inverted.
  bool collapse(Index a, Index b) {
    std::vector<Index> ring_a = neighbours(a), ring_b = neighbours(b);
    if (std::find(ring_a.begin(), ring_a.end(), b) == ring_a.end()) return false;
    std::sort(ring_a.begin(), ring_a.end());
    std::sort(ring_b.begin(), ring_b.end());
    std::vector<Index> shared;
    std::set_intersection(ring_a.begin(), ring_a.end(), ring_b.begin(), ring_b.end(),
                          std::back_inserter(shared));
    if (shared.size() != 2 || ring_a.size() + ring_b.size() > 4 + 9) return false;
    if (around_[shared[0]].size() < 4 || around_[shared[1]].size() < 4) return false;

    const SurfacePoint p = body_.project(0.5 * (s_.position[a] + s_.position[b]));
    for (const auto& [v, w] : {std::pair{a, b}, std::pair{b, a}}) {
      for (const Index t : around_[v]) {
        const Triangle& corners = s_.triangle[t];
        if (has(corners, w)) continue;
        if (quality(corners, v, p) < std::min(0.05, quality(corners, v, point(v)))) return false;
      }
    }
    for (const Index t : around_[b]) {
      Triangle& corners = s_.triangle[t];
      if (has(corners, a)) {
        for (const Index v : corners) {
          if (v != b) std::erase(around_[v], t);
        }
        corners = {-1, -1, -1};
      } else {
        std::replace(corners.begin(), corners.end(), b, a);
        around_[a].push_back(t);
      }
    }
    around_[b].clear();
    move(a, p);
    return true;
  }

  void flip_edges() {
    for (std::size_t t = 0; t < s_.triangle.size(); ++t) {
      for (int k = 0; k < 3 && s_.triangle[t][0] >= 0; ++k) flip(static_cast<Index>(t), k);
    }
  }

  /// Flips the edge from corner k of triangle t if that increases the smallest angle (Delaunay
  /// criterion: the angles opposite the edge sum to more than 180 degrees).
  void flip(Index t, int k) {
    const Triangle one = s_.triangle[t];
    const Index a = one[k], b = one[(k + 1) % 3], c = one[(k + 2) % 3];
    Index other = -1, d = -1;
    for (const Index u : around_[a]) {
      if (u == t || !has(s_.triangle[u], b)) continue;
      other = u;
      for (const Index v : s_.triangle[u]) d = v != a && v != b ? v : d;
    }
    const auto& x = s_.position;
    const auto cotangent = [&](Index at) {
      const Vec3d p = x[a] - x[at], q = x[b] - x[at];
      return dot(p, q) / norm(cross(p, q));
    };
    if (!(cotangent(c) + cotangent(d) < -1e-6)) return;
    if (around_[a].size() < 5 || around_[b].size() < 5) return;
    if (around_[c].size() > 9 || around_[d].size() > 9) return;
    const std::vector<Index> ring = neighbours(c);
    if (std::find(ring.begin(), ring.end(), d) != ring.end()) return;
    const Vec3d outward = normalised(s_.normal[a] + s_.normal[b] + s_.normal[c] + s_.normal[d]);
    const double before =
        std::min(quality(x[a], x[b], x[c], outward), quality(x[b], x[a], x[d], outward));
    if (quality(x[c], x[d], x[b], outward) < before) return;
    if (quality(x[d], x[c], x[a], outward) < before) return;
    s_.triangle[t] = {c, d, b};
    s_.triangle[other] = {d, c, a};
    std::erase(around_[a], t);
    std::erase(around_[b], other);
    around_[c].push_back(other);
    around_[d].push_back(t);
  }

  void centre_among_neighbours(Index v) {
    Vec3d mean;
    const std::vector<Index> ring = neighbours(v);
    for (const Index w : ring) mean += s_.position[w];
    const Vec3d step = mean / static_cast<double>(ring.size()) - s_.position[v];
    const Vec3d n = s_.normal[v];
    const SurfacePoint p = body_.project(s_.position[v] + 0.7 * (step - dot(step, n) * n));
    double before = 0.3, after = 1;  // a triangle may lose quality to its neighbours down to 0.3
    for (const Index t : around_[v]) {
      before = std::min(before, quality(s_.triangle[t], v, point(v)));
      after = std::min(after, quality(s_.triangle[t], v, p));
    }
    if (after >= before) move(v, p);
  }

  const ImplicitBody& body_;
  Surface s_;
  std::vector<std::vector<Index>> around_;  ///< Triangles at each vertex; none if it was removed.
  std::priority_queue<Edge, std::vector<Edge>, std::greater<>> queue_;
};

}  // namespace

Surface mesh_body(const ImplicitBody& body, Index vertices) {
  const Vec3d extent = body.high() - body.low();
  double cell = std::max({extent.x, extent.y, extent.z}) / 24;
  Surface fine = polygonise(body, cell);
  // The fine surface has 1.6 to 2.4 times the requested number of vertices.
  for (int attempt = 0; attempt < 20; ++attempt) {
    const double ratio = static_cast<double>(fine.position.size()) / vertices;
    if (ratio > 1.6 && ratio < 2.4) break;
    cell *= std::sqrt(ratio / 2);
    fine = polygonise(body, cell);
  }
  Remesher mesh(body, std::move(fine));
  mesh.thin_to(vertices);
  mesh.smooth(6);
  return mesh.result();
}

}  // namespace phyxel
