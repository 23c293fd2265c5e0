#include "info_partition.hpp"

#include <fmt/format.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "kind.hpp"
#include "partition/exchange_size.hpp"
#include "partition/part_halo.hpp"
#include "partition/partition.hpp"
#include "phyxel/error.hpp"
#include "phyxel/scene.hpp"
#include "progress.hpp"
#include "setup/tiling.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

using Facts = nlohmann::ordered_json;

Facts quality_facts(const Graph& phyxels, const char* cut, Partitioner partitioner,
                    const std::vector<int>& part_of, int parts, double seconds) {
  const PartitionQuality q = quality_of(phyxels, part_of, parts);
  return {{"cut", cut},
          {"partitioner", partitioner_name(partitioner)},
          {"imbalance", q.imbalance},
          {"cut pairs", q.cut},
          {"ghosts", q.ghosts},
          {"most ghosts", q.most_ghosts},
          {"most peers", q.most_peers},
          {"empty parts", q.empty},
          {"slowest", q.slowest},
          {"seconds", seconds}};
}

Facts plan_facts(const PartHalo& plan) {
  Facts peers = Facts::array();
  for (const PartHalo::Peer& peer : plan.peers) {
    peers.push_back(
        {{"part", peer.part}, {"send", peer.send.size()}, {"receive", peer.receive.size()}});
  }
  return {{"part", plan.part},
          {"phyxels", plan.owned.size()},
          {"boundary", plan.boundary.size()},
          {"ghosts", plan.ghosts.size()},
          {"peers", peers}};
}

}  // namespace

Facts partition_facts(const std::filesystem::path& file, int parts, const std::string& partitioner,
                      std::FILE* progress) {
  const bool best = partitioner == "auto";
  Partitioner chosen = best ? Partitioner::metis : partitioner_of(partitioner);
  expect_kind(file, {Kind::scene});
  const Model model = [&] {
    const SetupProgress shown(progress);
    return build_model(read_scene(file));
  }();
  const Graph phyxels = phyxel_graph(model);
  const Groups tiles = curve_groups(model, cuda::tile_size);
  const Graph coarse = grouped_graph(phyxels, tiles);
  Facts cuts = Facts::array(), notes = Facts::array();
  std::vector<int> chosen_parts;
  double least = std::numeric_limits<double>::infinity();
  for (const std::string& name : partitioner_names()) {
    const Partitioner by = partitioner_of(name);
    auto start = Clock::now();
    try {
      const std::vector<int> part_of = make_partition(phyxels, parts, by);
      cuts.push_back(quality_facts(phyxels, "phyxels", by, part_of, parts, seconds_since(start)));
    } catch (const InputError& error) {  // METIS cannot take so many phyxels; there are fewer tiles
      notes.push_back(error.what());
    }
    start = Clock::now();
    std::vector<int> part_of = ungrouped(make_partition(coarse, parts, by), tiles);
    cuts.push_back(quality_facts(phyxels, "tiles", by, part_of, parts, seconds_since(start)));
    const double load = cuts.back()["slowest"].get<double>();
    if (best ? load < least : by == chosen) {
      least = load;
      chosen = by;
      chosen_parts = std::move(part_of);
    }
  }
  Facts plans = Facts::array();
  for (const PartHalo& plan : make_part_halos(phyxels, chosen_parts, parts)) {
    plans.push_back(plan_facts(plan));
  }
  const ExchangeSize sent = exchange_size(model, chosen_parts);
  return {{"file", file.string()},
          {"phyxels", model.size()},
          {"tiles", tiles.count},
          {"parts", parts},
          {"cuts", cuts},
          {"notes", notes},
          {"partitioner", partitioner_name(chosen)},
          {"plans", plans},
          {"numbers sent a step",
           {{"pair stresses", sent.pair_stresses},
            {"pair forces", sent.pair_forces},
            {"summed forces", sent.summed_forces}}}};
}

std::string partition_tables(const Facts& facts) {
  const double n = facts["phyxels"].get<double>();
  std::string text = fmt::format(
      "{}: {} phyxels, {} tiles, {} parts\n\n"
      "  cut      by         imbalance    cut pairs       ghosts            most   peers  "
      "slowest  seconds\n",
      facts["file"].get<std::string>(), facts["phyxels"].get<Index>(), facts["tiles"].get<Index>(),
      facts["parts"].get<int>());
  for (const Facts& cut : facts["cuts"]) {
    const auto ghosts = cut["ghosts"].get<std::int64_t>();
    const int empty = cut["empty parts"].get<int>();
    text += fmt::format(
        "  {:<8} {:<10} {:>8.2f}% {:>12} {:>12} {:>6.1f}% {:>9} {:>7} {:>8.3f} {:>8.3f}{}\n",
        cut["cut"].get<std::string>(), cut["partitioner"].get<std::string>(),
        100 * cut["imbalance"].get<double>(), cut["cut pairs"].get<std::int64_t>(), ghosts,
        n > 0 ? 100 * static_cast<double>(ghosts) / n : 0, cut["most ghosts"].get<Index>(),
        cut["most peers"].get<int>(), cut["slowest"].get<double>(), cut["seconds"].get<double>(),
        empty > 0 ? fmt::format("  ({} parts empty)", empty) : "");
  }
  for (const Facts& note : facts["notes"]) text += "  " + note.get<std::string>() + "\n";
  text += fmt::format(
      "\n  slowest: largest cost of a part, including ghosts, over the mean\n"
      "\n  Tiles by {}:\n"
      "  part      phyxels     boundary       ghosts  peers (ghosts of each)\n",
      facts["partitioner"].get<std::string>());
  for (const Facts& plan : facts["plans"]) {
    std::string peers;
    for (const Facts& peer : plan["peers"]) {
      peers += fmt::format("{}{} ({})", peers.empty() ? "" : ", ", peer["part"].get<int>(),
                           peer["receive"].get<std::size_t>());
    }
    text += fmt::format("  {:>4} {:>12} {:>12} {:>12}  {}\n", plan["part"].get<int>(),
                        plan["phyxels"].get<std::size_t>(), plan["boundary"].get<std::size_t>(),
                        plan["ghosts"].get<std::size_t>(), peers);
  }
  const auto kilobytes = [&](const char* way) {
    return 1e-3 * sizeof(float) * facts["numbers sent a step"][way].get<double>();
  };
  return text +
         fmt::format(
             "\n  Sent in a step by all parts in float: displacements of ghosts and\n"
             "    their pair stresses (phyxel's way)  {:>12.1f} kB\n"
             "    the force of each pair              {:>12.1f} kB, with the same bits\n"
             "    forces summed over each part        {:>12.1f} kB, with bits that depend on "
             "the partition\n",
             kilobytes("pair stresses"), kilobytes("pair forces"), kilobytes("summed forces"));
}

}  // namespace phyxel::app
