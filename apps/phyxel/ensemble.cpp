#include "ensemble.hpp"

#include <omp.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "mpi/build_share.hpp"
#include "partition/partition.hpp"
#include "partition/share.hpp"
#include "setup/survey.hpp"
#include "setup/tiling.hpp"

namespace phyxel::app {
namespace {

const Communicator* the_ranks = nullptr;

std::vector<Partitioner> candidates_of(const std::string& name) {
  if (name != "auto") return {partitioner_of(name)};
  return {Partitioner::bisection, Partitioner::curve, Partitioner::metis};
}

/// Of all bodies, as the whole model numbers their surfels.
std::vector<Triangle> triangles_of(const std::vector<Surface>& surfaces) {
  std::vector<Triangle> triangles;
  Index shift = 0;
  for (const Surface& surface : surfaces) {
    for (const Triangle& t : surface.triangle) {
      triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
    }
    shift += static_cast<Index>(surface.position.size());
  }
  return triangles;
}

}  // namespace

const Communicator& ranks() {
  static const Communicator alone;
  return the_ranks ? *the_ranks : alone;
}
void set_ranks(const Communicator& ranks) {
  the_ranks = &ranks;
  if (ranks.size() == 1 || std::getenv("OMP_NUM_THREADS")) return;
  const auto cores = static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
  omp_set_num_threads(std::clamp(omp_get_num_procs(), 1, std::max(1, cores / ranks.host_size())));
}

Traffic most_traffic(const Backend& backend) {
  const auto here = backend.exchanges();
  if (!here) return {};
  return {ranks().largest(here->traffic.bytes_sent), ranks().largest(here->traffic.seconds)};
}

std::vector<std::string> partitioner_choices() {
  std::vector<std::string> names = partitioner_names();
  names.push_back("auto");
  return names;
}

void require_alike(std::uint64_t value, const char* what) {
  const auto signed_value = static_cast<std::int64_t>(value);
  if (ranks().smallest(signed_value) == ranks().largest(signed_value)) return;
  throw AgreedError(ExitCode::bad_input,
                    std::string("the ranks have different ") + what +
                        ": allowed are the same files for all, on a file system that all see");
}

Ensemble::Ensemble(const Scene& scene, const ChosenDevice& device, const CutOptions& cut) {
  if (ranks().size() == 1) {
    here_ = make_model(scene, device);
    shares_ = {here_.size(), here_.size(), 0};
    digest_ = model_digest(here_);
    boundary_ = boundary_size(here_);
    return;
  }
  ShareOptions options{candidates_of(cut.partitioner), cut.rings};
  std::unique_ptr<ShareSurveyor> surveyor;
  if (device.gpu) {
    options.tile = cuda::tile_size;
    if (can_survey_on_cuda(scene)) surveyor = cuda_share_surveyor(device.gpu->index);
    options.surveyor = surveyor.get();
  }
  BuiltShare built = build_share(ranks(), scene, options);
  here_ = std::move(built.model);
  exchange_ = std::make_unique<const StretchExchange>(ranks(), here_);
  if (ranks().rank() == 0) triangles_ = triangles_of(built.surfaces);
  partitioner_ = partitioner_name(built.partitioner);
  digest_ = model_digest(here_);
  const BoundarySize boundary = boundary_size(here_);
  boundary_ = {ranks().sum(boundary.moved), ranks().sum(boundary.loaded)};
  std::int64_t own = 0;
  for (const Part& part : here_.parts) own += part.owned_end() - part.begin;
  const std::int64_t ghosts = here_.size() - own;
  shares_ = {ranks().smallest(own), ranks().largest(own), ranks().largest(ghosts)};
}

std::span<const Triangle> Ensemble::triangles() const {
  return here_.share ? triangles_ : here_.surfels.triangle;
}

State Ensemble::state_of(const CheckpointReader* checkpoint, Index length) const {
  if (!here_.share) return checkpoint->state(0, here_.size());
  return exchange_->scattered(
      length, [&](Index begin, Index end) { return checkpoint->state(begin, end); });
}

}  // namespace phyxel::app
