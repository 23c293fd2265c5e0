// Compiled without fused multiplications, so that neighbours are those of the CPU.
#include <bit>

#include "device.hpp"
#include "model/assembly.hpp"
#include "model/nearest_distances.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"
#include "setup/device_hash.cuh"
#include "setup/survey.hpp"

namespace phyxel {
namespace {

using namespace cuda;

constexpr int most_nearest = 256;

/// `mean_spacing` of the CPU. Threads follow the entries of the hash, so that those of a warp
/// search the same cells.
/// @param farthest receives the distance to the farthest of the nearest phyxels [m]; may be null
template <int capacity>
void find_spacing(const DeviceHash& table, int nearest, DeviceArray<double>& spacing,
                  double* farthest) {
  const HashView hash = table.view();
  for_each("mean_spacing", hash.points,
           [hash, nearest, farthest, spacing = spacing.data()] __device__(std::int64_t at) {
             const auto self = static_cast<std::uint32_t>(at);
             const Vec3d here = hash.entries[self].position;
             const HashView::Body& body = hash.bodies[0];
             double room[capacity];
             NearestDistances found(room, nearest < hash.points - 1 ? nearest : hash.points - 1);
             const auto offer = [&](std::uint32_t k, Vec3d p) {
               if (k != self) found.offer(dot(p - here, p - here));
             };
             const CellGrid::Cell c = body.grid.cell_of(here);
             const auto offer_ring = [&](int ring) {
               for (int dz = -ring; dz <= ring; ++dz) {
                 for (int dy = -ring; dy <= ring; ++dy) {
                   const bool face = abs(dz) == ring || abs(dy) == ring;
                   const int stride = face || ring == 0 ? 1 : 2 * ring;
                   for (int dx = -ring; dx <= ring; dx += stride) {
                     hash.visit_cell(0, {c.x + dx, c.y + dy, c.z + dz}, offer);
                   }
                 }
               }
             };
             search_nearest(found, body.grid.farthest_ring(here, body.high), body.cell_size,
                            offer_ring, [&] { hash.visit_all(0, offer); });
             spacing[hash.index[self]] = found.mean_distance();
             if (farthest) farthest[hash.index[self]] = sqrt(found.largest());
           });
}

DeviceArray<double> mean_spacing_of(const DeviceArray<Vec3d>& position, int nearest,
                                    double* farthest = nullptr) {
  const auto n = static_cast<Index>(position.size());
  DeviceArray<double> spacing(position.size(), "mean spacings");
  spacing.clear();
  if (n < 2) return spacing;
  const Box box = box_around(position, 0, n);
  double cell = roomy_cell_size(box.low, box.high, position.size());
  for (int attempt = 0;; ++attempt) {
    const DeviceHash hash(position, {{0, n, cell}});
    const double occupancy = hash.mean_occupancy();
    if (occupancy <= 8 || attempt == 4) {
      if (nearest <= 16) {
        find_spacing<16>(hash, nearest, spacing, farthest);
      } else {
        find_spacing<most_nearest>(hash, nearest, spacing, farthest);
      }
      return spacing;
    }
    cell *= std::cbrt(3 / occupancy);
  }
}

/// The support of each phyxel [m]. @param middle receives the median [m]
DeviceArray<double> supports(const DeviceArray<double>& spacing, std::size_t n,
                             const NeighbourhoodRule& rule, double* middle) {
  const auto median = [](const DeviceArray<double>& values) {
    DeviceArray<double> sorted(values.size(), "set-up");
    PHYXEL_CUDA(cudaMemcpy(sorted.data(), values.data(), values.bytes(), cudaMemcpyDeviceToDevice));
    sort_values(sorted);
    double value;
    PHYXEL_CUDA(cudaMemcpy(&value, sorted.data() + sorted.size() / 2, sizeof value,
                           cudaMemcpyDeviceToHost));
    return value;
  };
  DeviceArray<double> support(n, "supports");
  const bool adaptive = !rule.radius && rule.support == NeighbourhoodRule::Support::adaptive;
  *middle = rule.radius ? *rule.radius : rule.factor * median(spacing);
  for_each("support", static_cast<std::int64_t>(n),
           [support = support.data(), spacing = spacing.data(), adaptive, all = *middle,
            factor = rule.factor] __device__(std::int64_t i) {
             support[i] = adaptive ? factor * spacing[i] : all;
           });
  return support;
}

/// Summary of one phyxel's neighbours. This struct and the next have no padding, which copies would
/// read uninitialised.
struct NeighbourSummary {
  Index length;
  std::int16_t rank, coincident;
};
struct ListTotals {
  Offset pairs;
  Index fewest, most;
  Offset degenerate;
};
static_assert(std::has_unique_object_representations_v<NeighbourSummary> &&
              std::has_unique_object_representations_v<ListTotals>);
struct AsTotals {
  __device__ ListTotals operator()(const NeighbourSummary& f) const {
    return {f.length, f.length, f.length, f.rank < 3 || f.coincident};
  }
};
struct AddTotals {
  __device__ ListTotals operator()(const ListTotals& a, const ListTotals& b) const {
    return {a.pairs + b.pairs, a.fewest < b.fewest ? a.fewest : b.fewest,
            a.most > b.most ? a.most : b.most, a.degenerate + b.degenerate};
  }
};

/// Input of a neighbour summary: the points of one body.
struct SummaryInput {
  const Vec3d* position;  ///< [m], shape [n].
  const double* support;  ///< [m], shape [n].
  const double* spacing;  ///< [m], shape [n]; null if no kernel sums are wanted.
  const char* own;        ///< Nonzero for points to be summarised; null for all.
  double inverse_reach;   ///< Largest support [m] if lists are one-sided; else 0.
};

/// Summarises the neighbours of each own point.
/// @param kernel_sum receives the kernel sum of each point; may be null
/// @param needed receives 1 for each point in the list of an own point, or with an own point in its
///   list; may be null
void summarise_neighbours(const DeviceHash& table, const SummaryInput& q,
                          NeighbourSummary* summaries, double* kernel_sum, char* needed) {
  const HashView hash = table.view();
  for_each("summarise_neighbours", hash.points,
           [hash, q, summaries, kernel_sum, needed] __device__(std::int64_t at) {
             const auto self = static_cast<std::uint32_t>(at);
             const Index i = hash.index[self];
             if (q.own && !q.own[i]) {
               summaries[i] = {0, 3, 0};
               return;
             }
             const Vec3d here = hash.entries[self].position;
             const double h = q.support[i], inverse_h_squared = 1 / (h * h);
             const auto cube = [&](Index j) { return q.spacing[j] * q.spacing[j] * q.spacing[j]; };
             Sym3d moment;
             NeighbourSummary f{};
             hash.visit_near(0, here, h, [&](std::uint32_t k, Vec3d p) {
               const Vec3d x = p - here;
               const double d2 = dot(x, x);
               if (k == self || !(d2 < h * h)) return;
               ++f.length;
               moment += moment_term(x, weight_shape(d2, inverse_h_squared));
               if (d2 <= 1e-20 * h * h) f.coincident = 1;
               if (needed) needed[hash.index[k]] = 1;
             });
             if (needed && q.inverse_reach > 0) {
               hash.visit_near(0, here, q.inverse_reach, [&](std::uint32_t k, Vec3d p) {
                 const Index j = hash.index[k];
                 const Vec3d x = p - here;
                 if (k != self && dot(x, x) < q.support[j] * q.support[j]) needed[j] = 1;
               });
             }
             f.rank = static_cast<std::int16_t>(pseudo_inverse(moment).rank);
             summaries[i] = f;
             if (!kernel_sum) return;
             double sum = h > 0 ? cube(i) * weight(0, h) : 0;
             const auto each = [&](auto&& offer) {
               hash.visit_near(0, here, h, [&](std::uint32_t k, Vec3d p) {
                 if (k != self && dot(p - here, p - here) < h * h) offer(hash.index[k]);
               });
             };
             in_ascending_order(nullptr, each, [&](Index j) {
               const Vec3d x = q.position[j] - here;
               sum += cube(j) * weight(sqrt(dot(x, x)), h);
             });
             kernel_sum[i] = sum;
           });
}

Degenerate degenerate_of(const std::vector<NeighbourSummary>& summaries) {
  Degenerate d;
  for (std::size_t k = 0; k < summaries.size(); ++k) {
    const NeighbourSummary& f = summaries[k];
    const auto i = static_cast<Index>(k);
    if (f.coincident) d.coincident.push_back(i);
    if (f.rank == 0) d.isolated.push_back(i);
    if (f.rank == 1) d.collinear.push_back(i);
    if (f.rank == 2) d.coplanar.push_back(i);
  }
  return d;
}

Survey survey_on_device(std::span<const Vec3d> host_position, const NeighbourhoodRule& rule,
                        bool kernel_volumes) {
  Survey survey;
  const std::size_t n = host_position.size();
  if (n == 0) return survey;
  const std::string of = " of " + std::to_string(n) + " phyxels";
  DeviceArray<Vec3d> position(n, "rest positions" + of);
  position.upload(host_position.data());
  DeviceArray<double> spacing, kernel_sum;
  if (!rule.radius || kernel_volumes) spacing = mean_spacing_of(position, rule.nearest);
  double middle = 0;
  const DeviceArray<double> support = supports(spacing, n, rule, &middle);
  if (kernel_volumes) kernel_sum = {n, "kernel sums" + of};
  DeviceArray<NeighbourSummary> summaries(n, "neighbour summaries" + of);
  summarise_neighbours(DeviceHash(position, {{0, static_cast<Index>(n), middle}}),
                       {position.data(), support.data(), spacing.data(), nullptr, 0},
                       summaries.data(), kernel_sum.data(), nullptr);
  const thrust::transform_iterator lengths(summaries.data(), AsTotals{});
  const ListTotals all = reduce(lengths, static_cast<std::int64_t>(n),
                                ListTotals{0, static_cast<Index>(n), 0, 0}, AddTotals{});
  survey.lists = {all.pairs, all.fewest, all.most};
  survey.support = fetched(support);
  if (kernel_volumes) {
    survey.spacing = fetched(spacing);
    survey.kernel_sum = fetched(kernel_sum);
  }
  if (all.degenerate > 0) survey.degenerate = degenerate_of(fetched(summaries));
  return survey;
}

class CudaShareSurveyor final : public ShareSurveyor {
 public:
  explicit CudaShareSurveyor(int device) : device_(device) {}

  std::vector<double> mean_spacing(std::span<const Vec3d> host_position, int nearest,
                                   double* farthest) const override {
    use_cuda_device(device_);
    const std::size_t n = host_position.size();
    if (n < 2) return std::vector<double>(n, 0);
    DeviceArray<Vec3d> position(n, "rest positions");
    position.upload(host_position.data());
    DeviceArray<double> farthest_here;
    if (farthest) farthest_here = {n, "mean spacings"};
    const std::vector<double> spacing =
        fetched(mean_spacing_of(position, nearest, farthest_here.data()));
    if (farthest) std::ranges::copy(fetched(farthest_here), farthest);
    return spacing;
  }

  Around around(std::span<const Vec3d> host_position, std::span<const double> host_support,
                std::span<const double> host_spacing, std::span<const char> host_own,
                bool one_sided) const override {
    use_cuda_device(device_);
    Around around;
    const std::size_t n = host_position.size();
    if (n == 0) return around;
    const std::string what = "neighbour summaries of " + std::to_string(n) + " phyxels";
    const auto sent_span = [&](auto values) {
      DeviceArray<std::remove_const_t<typename decltype(values)::element_type>> array(values.size(),
                                                                                      what);
      if (!values.empty()) array.upload(values.data());
      return array;
    };
    const DeviceArray<Vec3d> position = sent_span(host_position);
    const DeviceArray<double> support = sent_span(host_support), spacing = sent_span(host_spacing);
    const DeviceArray<char> own = sent_span(host_own);
    DeviceArray<double> kernel_sum;
    if (!host_spacing.empty()) {
      kernel_sum = {n, what};
      kernel_sum.clear();
    }
    DeviceArray<NeighbourSummary> summaries(n, what);
    DeviceArray<char> needed(n, what);
    needed.clear();
    double sum = 0, largest = 0;
    for (const double h : host_support) {
      sum += h;
      largest = std::max(largest, h);
    }
    summarise_neighbours(
        DeviceHash(position, {{0, static_cast<Index>(n), sum / static_cast<double>(n)}}),
        {position.data(), support.data(), spacing.data(), own.data(), one_sided ? largest : 0},
        summaries.data(), kernel_sum.data(), needed.data());
    around.needed = fetched(needed);
    const thrust::transform_iterator lengths(summaries.data(), AsTotals{});
    const ListTotals all = reduce(lengths, static_cast<std::int64_t>(n),
                                  ListTotals{0, static_cast<Index>(n), 0, 0}, AddTotals{});
    if (all.degenerate > 0) around.degenerate = degenerate_of(fetched(summaries));
    const DeviceArray<Index> length(n, what);
    for_each("list_lengths", static_cast<std::int64_t>(n),
             [summaries = summaries.data(), length = length.data()] __device__(std::int64_t i) {
               length[i] = summaries[i].length;
             });
    around.length = fetched(length);
    if (!host_spacing.empty()) around.kernel_sum = fetched(kernel_sum);
    return around;
  }

 private:
  int device_;
};

}  // namespace

std::unique_ptr<ShareSurveyor> cuda_share_surveyor(int device) {
  use_cuda_device(device);
  return std::make_unique<CudaShareSurveyor>(device);
}

Surveyor cuda_surveyor(int device) {
  return [device](std::span<const Vec3d> position, const NeighbourhoodRule& rule,
                  bool kernel_volumes) {
    use_cuda_device(device);
    return survey_on_device(position, rule, kernel_volumes);
  };
}

bool can_survey_on_cuda(const Scene& scene) {
  return std::none_of(scene.bodies.begin(), scene.bodies.end(), [](const BodyRequest& body) {
    return needs_lists_on_host(body) || body.neighbourhood.max_neighbours ||
           body.neighbourhood.nearest > most_nearest;
  });
}

}  // namespace phyxel
