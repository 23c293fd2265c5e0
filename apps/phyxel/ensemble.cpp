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
  surfaces_ = std::move(built.surfaces);
  partitioner_ = partitioner_name(built.partitioner);
  digest_ = model_digest(here_);
  for (Index i = 0; i < here_.size(); ++i) {
    if (here_.owns(i)) owned_.push_back(i);
  }
  const auto own = static_cast<std::int64_t>(owned_.size());
  const std::int64_t ghosts = here_.size() - own;
  shares_ = {ranks().smallest(own), ranks().largest(own), ranks().largest(ghosts)};
}

void Ensemble::bring_together() {
  if (!here_.share) return;
  const bool leads = ranks().rank() == 0;
  const auto parts = static_cast<std::size_t>(ranks().size());
  std::vector<std::vector<Index>> numbers(parts), surfel_numbers(parts);
  for (const Index i : owned_) numbers[0].push_back(here_.number(i));
  surfel_numbers[0] = here_.share->surfel_number;
  numbers_ = ranks().exchanged(numbers);
  surfel_numbers_ = ranks().exchanged(surfel_numbers);

  // The others take part, and keep nothing.
  Model model;
  model.position = phyxels(here_.position);
  model.mass = phyxels(here_.mass);
  model.volume = phyxels(here_.volume);
  model.neighbourhood.support = phyxels(here_.neighbourhood.support);
  model.neighbourhood.symmetric = here_.neighbourhood.symmetric;
  model.gravity = here_.gravity;
  model.degenerate = here_.degenerate;
  model.warnings = here_.warnings;
  Surfels& surfels = model.surfels;
  surfels.unreached = here_.surfels.unreached;
  Index begin = 0;
  for (std::size_t b = 0; b < here_.parts.size() && leads; ++b) {
    const Surface& surface = surfaces_[b];
    const auto shift = static_cast<Index>(surfels.position.size());
    surfels.position.insert(surfels.position.end(), surface.position.begin(),
                            surface.position.end());
    surfels.normal.insert(surfels.normal.end(), surface.normal.begin(), surface.normal.end());
    for (const Triangle& t : surface.triangle) {
      surfels.triangle.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
    }
    Part& part = model.parts.emplace_back(here_.parts[b]);
    part.begin = begin;
    part.end = begin += part.size;
    part.ghosts = part.far_ghosts = 0;
    part.surfel_begin = shift;
    part.surfel_end = static_cast<Index>(surfels.position.size());
  }
  const auto whole_list = [&](const std::vector<Index>& phyxels) {
    std::vector<std::vector<Index>> send(parts);
    for (const Index i : phyxels) {
      if (here_.owns(i)) send[0].push_back(here_.number(i));
    }
    std::vector<Index> all;
    for (const std::vector<Index>& from : ranks().exchanged(send)) {
      all.insert(all.end(), from.begin(), from.end());
    }
    std::sort(all.begin(), all.end());
    return all;
  };
  for (const Motion& motion : here_.motions) {
    model.motions.push_back(motion);
    model.motions.back().phyxels = whole_list(motion.phyxels);
  }
  for (const Load& load : here_.loads) {
    model.loads.push_back(load);
    model.loads.back().phyxels = whole_list(load.phyxels);
    model.loads.back().force.clear();  // wanted where phyxels are stepped
  }
  if (leads) whole_ = std::make_unique<Model>(std::move(model));
  surfaces_.clear();
}

State Ensemble::whole_state(const State& local) const {
  State state = local;
  state.displacement = phyxels(local.displacement);
  state.velocity = phyxels(local.velocity);
  return state;
}

State Ensemble::shared_out(State whole) const {
  if (!here_.share) return whole;
  const auto each = static_cast<std::size_t>(ranks().size());
  std::vector<std::vector<Index>> wanted(each);
  wanted[0] = here_.share->number;
  wanted = ranks().exchanged(wanted);
  const auto shared_out = [&](std::vector<Vec3d>& values) {
    std::vector<std::vector<Vec3d>> send(each);
    if (!values.empty()) {
      for (std::size_t r = 0; r < each; ++r) {
        for (const Index i : wanted[r]) send[r].push_back(values[i]);
      }
    }
    values = std::move(ranks().exchanged(send)[0]);
  };
  shared_out(whole.displacement);
  shared_out(whole.velocity);
  return whole;
}

}  // namespace phyxel::app
