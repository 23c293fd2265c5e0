#include "phyxel/shared_model.hpp"

#include <fmt/format.h>

#include "mesh/filling_device.hpp"
#include "mpi/build_share.hpp"
#include "mpi/communicator.hpp"
#include "mpi/row_redistribution.hpp"
#include "partition/partition.hpp"
#include "phyxel/error.hpp"
#include "phyxel/ranks.hpp"
#include "setup/closing.hpp"
#include "setup/filling.hpp"
#include "setup/survey.hpp"
#include "setup/tiling.hpp"

namespace phyxel {
namespace {

std::vector<Partitioner> candidates_of(const std::string& name) {
  if (name != "auto") return {partitioner_of(name)};
  return {Partitioner::bisection, Partitioner::curve, Partitioner::metis};
}

/// The triangles of all bodies, with global ids of surfels.
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

/// Checks the arguments of `SharedModel::gathered`. @throws InputError
void check_gathered(const Model& here, Quantity quantity, std::size_t values, Index begin,
                    Index end) {
  const bool surfels = is_of_surfels(quantity);
  const Index all = surfels ? here.global_surfel_count() : here.global_count();
  if (begin < 0 || end < begin || end > all) {
    throw InputError(fmt::format("{} {} to {} cannot be gathered; allowed: a range within 0 to {}",
                                 surfels ? "surfels" : "phyxels", begin, end, all));
  }
  const std::size_t rows =
      surfels ? here.surfels.position.size() : static_cast<std::size_t>(here.size());
  if (values != rows * width_of(quantity)) {
    throw InputError(fmt::format("{} values to gather from {} {} of this rank; allowed: {} of each",
                                 values, rows, surfels ? "surfels" : "phyxels",
                                 width_of(quantity)));
  }
}

}  // namespace

std::vector<std::string> partitioner_choices() {
  std::vector<std::string> names = partitioner_names();
  names.push_back("auto");
  return names;
}

SharedModel::SharedModel(const Ranks& ranks, const Scene& scene, const ChosenDevice& device,
                         const CutOptions& cut)
    : ranks_(ranks), device_(device) {
  build(scene, nullptr, cut);
}
SharedModel::SharedModel(const Ranks& ranks, const Scene& scene, const std::vector<Cloud>& clouds,
                         const ChosenDevice& device, const CutOptions& cut)
    : ranks_(ranks), device_(device) {
  build(scene, &clouds, cut);
}
SharedModel::~SharedModel() = default;

void SharedModel::build(const Scene& scene, const std::vector<Cloud>* clouds,
                        const CutOptions& cut) {
  ShareOptions options;
  ranks_.collectively([&] { options.candidates = candidates_of(cut.partitioner); });
  if (ranks_.size() == 1) {
    here_ = clouds ? build_model(scene, *clouds, device_) : build_model(scene, device_);
    shares_ = {here_.size(), here_.size(), 0};
    digest_ = model_digest(here_);
    digest_before_4_ = model_digest_before_4(here_);
    return;
  }
  std::unique_ptr<ShareSurveyor> surveyor;
  if (device_.gpu) {
    options.tile = cuda::tile_size;
    if (can_survey_on_cuda(scene)) surveyor = cuda_share_surveyor(device_.gpu->index);
    options.surveyor = surveyor.get();
    options.close = cuda_closing_search(device_.gpu->index);
  }
  const FillingScope filling(device_.gpu ? cuda_filling_device(device_.gpu->index) : nullptr);
  const MpiCommunicator& all = ranks_.communicator();
  BuiltShare built =
      clouds ? build_share(all, scene, *clouds, options) : build_share(all, scene, options);
  here_ = std::move(built.model);
  exchange_ = std::make_unique<const RowRedistribution>(all, here_);
  if (ranks_.leads()) triangles_ = triangles_of(built.surfaces);
  partitioner_ = partitioner_name(built.partitioner);
  digest_ = built.digest;
  digest_before_4_ = built.digest_before_4;
  std::int64_t own = 0;
  for (const Part& part : here_.parts) own += part.owned_end() - part.begin;
  const std::int64_t ghosts = here_.size() - own;
  shares_ = {ranks_.smallest(own), ranks_.largest(own), ranks_.largest(ghosts)};
}

std::unique_ptr<Backend> SharedModel::make_backend(Precision precision, int threads,
                                                   const std::string& transport) const {
  const auto make = [&] {
    return phyxel::make_backend(here_, precision, device_, threads, transport);
  };
  ranks_.collectively([&] { check_transport_name(transport); });
  // Construction of GPU backends is collective, and an error there ends one rank.
  return device_.gpu ? make() : ranks_.agreed(make);
}

std::vector<double> SharedModel::gathered(Quantity quantity, std::span<const double> here,
                                          Index begin, Index end) const {
  ranks_.collectively([&] { check_gathered(here_, quantity, here.size(), begin, end); });
  if (here_.share) return exchange_->gathered(quantity, here, {begin, end});
  const std::size_t width = width_of(quantity);
  const auto of_range = here.subspan(begin * width, (end - begin) * width);
  return {of_range.begin(), of_range.end()};
}

State SharedModel::state_of(const CheckpointReader* checkpoint, Index length) const {
  struct Header {
    std::int64_t step;
    double time, dt, history_interval;
    Looks looks;
  };
  Header now{};
  std::vector<std::int64_t> step_sums;
  std::vector<RigidState> rigid;
  std::vector<PhyxelPair> broken;
  std::vector<WornPhyxel> worn;
  ranks_.collectively([&] {
    if (length < 1)
      throw InputError(fmt::format("{} phyxels at a time; allowed: 1 or more", length));
    if (!ranks_.leads()) return;
    if (!wrote(checkpoint->info()) || checkpoint->phyxels() != here_.global_count()) {
      throw InputError("the checkpoint belongs to another model; allowed: the model that wrote it");
    }
    const State header = checkpoint->state(0, 0);
    now = {header.step, header.time, header.dt, header.history_interval, header.looks};
    step_sums = header.step_sums;
    rigid = header.rigid;
    broken = header.broken;
    worn = header.worn;
  });
  if (!here_.share) return checkpoint->state(0, here_.size());
  State state = exchange_->scattered(
      length, [&](Index begin, Index end) { return checkpoint->state(begin, end); });
  now = ranks_.communicator().broadcast(std::vector{now}).front();
  state.step = now.step;
  state.time = now.time;
  state.dt = now.dt;
  state.history_interval = now.history_interval;
  state.looks = now.looks;
  state.step_sums = ranks_.communicator().broadcast(step_sums);
  state.rigid = ranks_.communicator().broadcast(rigid);
  state.broken = ranks_.communicator().broadcast(broken);
  state.worn = ranks_.communicator().broadcast(worn);
  return state;
}

std::span<const Triangle> SharedModel::triangles() const {
  return here_.share ? triangles_ : here_.surfels.triangle;
}

}  // namespace phyxel
