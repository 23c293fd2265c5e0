#include "ensemble.hpp"

#include "mpi/halo.hpp"
#include "partition/partition.hpp"
#include "partition/share.hpp"
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
void set_ranks(const Communicator& ranks) { the_ranks = &ranks; }

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

Ensemble::Ensemble(const std::function<Model()>& make, const CutOptions& cut) {
  const int parts = ranks().size(), rank = ranks().rank();
  if (parts == 1) {
    whole_ = std::make_unique<Model>(make());
    digest_ = model_digest(*whole_);
    shares_ = {whole_->size(), whole_->size(), 0};
    return;
  }
  Graph graph;
  std::vector<int> part_of;
  ranks().together([&] {
    const std::vector<Partitioner> candidates = candidates_of(cut.partitioner);
    whole_ = std::make_unique<Model>(make());
    digest_ = model_digest(*whole_);
    graph = phyxel_graph(*whole_);
    // METIS takes random numbers from the C library: one rank's answer serves all.
    if (rank > 0) return;
    const Groups tiles = cut.between_tiles ? curve_groups(*whole_, cuda::tile_size) : Groups{};
    ChosenPartition chosen =
        choose_partition(graph, cut.between_tiles ? &tiles : nullptr, parts, candidates);
    partitioner_ = partitioner_name(chosen.partitioner);
    part_of = std::move(chosen.part_of);
  });
  require_alike(digest_, "bodies");
  part_of = ranks().broadcast(part_of);
  ModelShare share =
      phyxel::share_of(*whole_, make_halo_plans(graph, part_of, parts, cut.rings)[rank], part_of);
  if (cut.between_tiles) share.share.place = values_of(share.share, cuda::whole_places(*whole_));
  here_ = std::make_unique<Model>(connected(ranks(), std::move(share)));
  if (rank > 0) whole_.reset();

  std::vector<std::vector<Index>> numbers(static_cast<std::size_t>(parts)),
      surfel_numbers(numbers.size());
  for (Index i = 0; i < here_->size(); ++i) {
    if (!here_->owns(i)) continue;
    owned_.push_back(i);
    numbers[0].push_back(here_->number(i));
  }
  surfel_numbers[0] = here_->share->surfel_number;
  numbers_ = ranks().exchanged(numbers);
  surfel_numbers_ = ranks().exchanged(surfel_numbers);

  const auto own = static_cast<std::int64_t>(owned_.size());
  const std::int64_t ghosts = here_->size() - own;
  shares_ = {ranks().smallest(own), ranks().largest(own), ranks().largest(ghosts)};
}

State Ensemble::whole_state(const State& local) const {
  State state = local;
  state.displacement = phyxels(local.displacement);
  state.velocity = phyxels(local.velocity);
  return state;
}

State Ensemble::share_of(State whole) const {
  if (!here_) return whole;
  whole.displacement = values_of(*here_->share, whole.displacement);
  whole.velocity = values_of(*here_->share, whole.velocity);
  return whole;
}

}  // namespace phyxel::app
