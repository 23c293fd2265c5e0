#include <bit>

#include "setup/device_hash.cuh"

namespace phyxel::cuda {

Box box_around(const DeviceArray<Vec3d>& position, Index begin, Index end) {
  constexpr double far = HUGE_VAL;
  const Box nowhere{{far, far, far}, {-far, -far, -far}};
  if (begin == end) return {};
  const thrust::transform_iterator points(position.data() + begin, AroundPoint{});
  return reduce(points, end - begin, nowhere, AroundBoth{});
}

void DeviceHash::set_mask(std::size_t points) {
  mask_ = std::bit_ceil(std::max<std::size_t>(points, 8)) - 1;
}

HashView::Body DeviceHash::body_in(const Box& box, const Body& body) const {
  const double size = cell_size_for(box.low, box.high, body.cell_size);
  return {{box.low, 1 / size, mask_}, size, box.high, body.begin, body.end};
}

void DeviceHash::fill(const DeviceArray<Vec3d>& position, const std::vector<Body>& bodies) {
  set_mask(position.size());
  std::vector<HashView::Body> all;
  for (const Body& body : bodies) {
    all.push_back(body_in(box_around(position, body.begin, body.end), body));
  }
  bodies_ = sent(all, "the spatial hash");
  sort_into_cells(position);
}

void DeviceHash::fill(const DeviceArray<Vec3d>& position, const Box& box, double cell_size) {
  set_mask(position.size());
  const HashView::Body one = body_in(box, {0, static_cast<Index>(position.size()), cell_size});
  bodies_ = {1, "the spatial hash"};
  for_each("set_body", 1, [one, bodies = bodies_.data()] __device__(std::int64_t) {
    bodies[0] = one;  // a copy from the host would wait
  });
  sort_into_cells(position);
}

void DeviceHash::sort_into_cells(const DeviceArray<Vec3d>& position) {
  const std::size_t n = position.size();
  const std::string what = "the spatial hash of " + std::to_string(n) + " phyxels";
  DeviceArray<std::uint32_t> bucket(n, what);
  index_ = {n, what};
  HashView hash = view();
  for_each("bucket_points", static_cast<std::int64_t>(n),
           [hash, bucket = bucket.data(), index = index_.data(),
            position = position.data()] __device__(std::int64_t i) {
             const int body = hash.body_of(static_cast<Index>(i));
             const auto cell = CellGrid::name(hash.bodies[body].grid.cell_of(position[i]));
             bucket[i] = hash.bucket_of(body, cell);
             index[i] = static_cast<Index>(i);
           });
  sort_pairs(bucket, index_, bits_below(mask_ + 1));
  start_ = starts_of<std::uint32_t>(bucket, mask_ + 1, what);
  entries_ = {n, what};
  hash = view();
  for_each(
      "fill_buckets", static_cast<std::int64_t>(n),
      [hash, entries = entries_.data(), position = position.data()] __device__(std::int64_t k) {
        const Index i = hash.index[k];
        const CellGrid& grid = hash.bodies[hash.body_of(i)].grid;
        entries[k] = {position[i], CellGrid::name(grid.cell_of(position[i]))};
      });
}

namespace {

struct BeginsCell {
  const HashView::Entry* entries;
  __device__ std::int64_t operator()(std::int64_t k) const {
    return k == 0 || entries[k].cell != entries[k - 1].cell;
  }
};

}  // namespace

double DeviceHash::mean_occupancy() const {
  const auto n = static_cast<std::int64_t>(index_.size());
  if (n == 0) return 0;
  const thrust::transform_iterator flags(thrust::counting_iterator<std::int64_t>(0),
                                         BeginsCell{entries_.data()});
  const std::int64_t cells = reduce(flags, n, std::int64_t{0}, Plus{});
  return static_cast<double>(n) / static_cast<double>(cells);
}

}  // namespace phyxel::cuda
