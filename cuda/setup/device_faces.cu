// Compiled without fused multiplications, so that places are those of the CPU.
#include "mesh/filling_rules.hpp"
#include "setup/device_faces.cuh"
#include "setup/device_table.cuh"

namespace phyxel::cuda {
namespace {

constexpr const char* name = "points on a surface";

/// The state of a candidate.
enum State : char { open, accepted, refused };

/// The places of candidates in the order of their ranks, after those of points accepted before.
DeviceArray<Vec3d> in_random_order(std::span<const Vec3d> candidates, std::span<const Vec3d> before,
                                   std::uint64_t seed) {
  const auto count = static_cast<std::int64_t>(candidates.size());
  DeviceArray<std::uint64_t> rank(candidates.size(), name);
  DeviceArray<Index> number(candidates.size(), name);
  for_each("rank_candidates", count,
           [seed, rank = rank.data(), number = number.data()] __device__(std::int64_t k) {
             rank[k] = rank_of(static_cast<std::uint64_t>(k), seed);
             number[k] = static_cast<Index>(k);
           });
  if (count > 0) sort_pairs(rank, number);
  const DeviceArray<Vec3d> place = sent(candidates, name);
  DeviceArray<Vec3d> all(before.size() + candidates.size(), name);
  if (!before.empty()) {
    PHYXEL_CUDA(cudaMemcpy(all.data(), before.data(), before.size_bytes(), cudaMemcpyHostToDevice));
  }
  for_each(
      "order_candidates", count,
      [place = place.data(), number = number.data(),
       all = all.data() + before.size()] __device__(std::int64_t k) { all[k] = place[number[k]]; });
  return all;
}

/// Decides on the candidates that are left, as far as is known which of those before them are
/// accepted. @param state of all points. @returns the candidates that are left then
DeviceArray<Index> decided(const DeviceArray<Index>& left, const TableView& table,
                           const DeviceArray<Vec3d>& point, double gap,
                           const DeviceArray<char>& state) {
  const auto count = static_cast<std::int64_t>(left.size());
  for_each("decide_candidates", count,
           [left = left.data(), table, point = point.data(), gap,
            state = static_cast<volatile char*>(state.data())] __device__(std::int64_t k) {
             const Index i = left[k];
             const Vec3d place = point[i];
             bool waits = false, is_near = false;
             table.visit_ball(place, gap, [&](const auto& entry) {
               if (is_near || entry.index >= i) return;
               const Vec3d d = entry.position - place;
               if (!(dot(d, d) < gap * gap)) return;
               const char other = state[entry.index];
               waits |= other == open;
               is_near |= other == accepted;
             });
             if (is_near) {
               state[i] = refused;
             } else if (!waits) {
               state[i] = accepted;
             }
           });
  DeviceArray<char> is_open(left.size(), name);
  for_each("find_open", count,
           [left = left.data(), state = state.data(), is_open = is_open.data()] __device__(
               std::int64_t k) { is_open[k] = state[left[k]] == open; });
  return flagged<const Index*, Index>(left.data(), is_open);
}

}  // namespace

std::vector<Vec3d> darts_on_device(std::span<const Vec3d> candidates, std::span<const Vec3d> before,
                                   double gap, std::uint64_t seed) {
  const DeviceArray<Vec3d> point = in_random_order(candidates, before, seed);
  const DeviceTable table(point, gap);
  const auto count = static_cast<std::int64_t>(candidates.size());
  const auto first = static_cast<Index>(before.size());
  const DeviceArray<char> state(point.size(), name);
  PHYXEL_CUDA(cudaMemset(state.data(), accepted, before.size()));
  PHYXEL_CUDA(cudaMemset(state.data() + first, open, candidates.size()));
  DeviceArray<Index> left(candidates.size(), name);
  for_each("list_candidates", count, [first, left = left.data()] __device__(std::int64_t k) {
    left[k] = first + static_cast<Index>(k);
  });
  while (left.size() > 0) left = decided(left, table.view(), point, gap, state);

  DeviceArray<char> is_accepted(candidates.size(), name);
  for_each("find_accepted", count,
           [state = state.data() + first, is_accepted = is_accepted.data()] __device__(
               std::int64_t k) { is_accepted[k] = state[k] == accepted; });
  return fetched(flagged<const Vec3d*, Vec3d>(point.data() + first, is_accepted));
}

namespace {

/// The triangles of a surface and the samples on it, as kernels see them.
struct FacesView {
  const Vec3d* position;
  const Triangle* triangle;
  const PointOn* samples;
  TableView table;  ///< Of the samples.

  __device__ Corners corners_of(std::size_t t) const {
    const Triangle& corner = triangle[t];
    return {position[corner[0]], position[corner[1]], position[corner[2]]};
  }
  __device__ std::size_t nearest_piece(Vec3d place) const {
    return samples[table.nearest(place).index].piece;
  }
};

/// The places of points on the device.
DeviceArray<Vec3d> places_of(const DeviceArray<PointOn>& samples) {
  DeviceArray<Vec3d> place(samples.size(), name);
  for_each("copy_places", static_cast<std::int64_t>(samples.size()),
           [samples = samples.data(), place = place.data()] __device__(std::int64_t k) {
             place[k] = samples[k].point;
           });
  return place;
}

/// Moves points on faces by one sweep. @param pieces their triangles
void sweep_on_faces(const DeviceArray<Vec3d>& point, const DeviceArray<Vec3d>& moved,
                    const DeviceArray<std::size_t>& pieces, const FacesView& view,
                    const PointsOnFaces& faces) {
  const DeviceTable table(point, 0.5 * repulsion_reach * faces.spacing);
  for_each("repel_on_faces", static_cast<std::int64_t>(moved.size()),
           [table = table.view(), point = point.data() + faces.fixed, moved = moved.data(),
            pieces = pieces.data(), view, fixed = static_cast<Index>(faces.fixed),
            spacing = faces.spacing] __device__(std::int64_t k) {
             const Vec3d before = point[k];
             const Vec3d step = step_of_repulsion(table, before, fixed + static_cast<Index>(k),
                                                  spacing, [](Index) { return 1.0; });
             moved[k] = moved_on_face(
                 before, step, pieces[k], [&](std::size_t t) { return view.corners_of(t); },
                 [&](Vec3d place) { return view.nearest_piece(place); });
           });
  PHYXEL_CUDA(cudaMemcpy(point.data() + faces.fixed, moved.data(), moved.bytes(),
                         cudaMemcpyDeviceToDevice));
}

}  // namespace

std::vector<Vec3d> evened_out(std::span<const Vec3d> point, const PointsOnFaces& faces) {
  const std::size_t count = point.size() - faces.fixed;
  const DeviceArray<Vec3d> here = sent(point, name);
  const DeviceArray<Vec3d> position = sent(faces.surface.position, name);
  const DeviceArray<Triangle> triangle = sent(faces.surface.triangle, name);
  const DeviceArray<PointOn> samples = sent(faces.samples, name);
  const DeviceTable table(places_of(samples), face_sample_cell * faces.spacing);
  const FacesView view{position.data(), triangle.data(), samples.data(), table.view()};
  const DeviceArray<std::size_t> pieces(count, name);
  for_each("find_pieces", static_cast<std::int64_t>(count),
           [view, point = here.data() + faces.fixed, pieces = pieces.data()] __device__(
               std::int64_t k) { pieces[k] = view.nearest_piece(point[k]); });
  const DeviceArray<Vec3d> moved(count, name);
  for (int k = 0; k < faces.sweeps; ++k) sweep_on_faces(here, moved, pieces, view, faces);
  return fetched(here, faces.fixed, count);
}

}  // namespace phyxel::cuda
