/// Communication volume of ranks that step a body, by three ways to exchange forces, and their
/// effect on the bits of forces.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "paper.hpp"
#include "paper/paper_backend.hpp"
#include "paper/paper_model.hpp"
#include "partition/exchange_size.hpp"
#include "partition/partition.hpp"

namespace phyxel::app {
namespace {

using Vec3f = Vec3<float>;

/// Size of a compact block, which has fewer ghosts for its size than the paper's bodies.
constexpr Index block_phyxels = 30'000;

Vec3f to_float(Vec3d v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

float length_of(Vec3f v) { return std::sqrt(dot(v, v)); }

/// Forces on the phyxels of a partitioned body, from equal pair forces in float.
class SummedForces {
 public:
  SummedForces(const Model& model, const std::vector<Vec3d>& pair_forces)
      : neighbours_(model.neighbourhood.neighbours), pushes_(model.size()) {
    own_.resize(pushes_.size());
    for (Index i = 0; i < neighbours_.rows(); ++i) {
      Offset entry = neighbours_.offsets[i];
      for (const Index j : neighbours_.row(i)) {
        const Vec3f force = to_float(pair_forces[static_cast<std::size_t>(entry++)]);
        own_[i] -= force;
        pushes_[j].push_back({i, force});  // i ascending, the order of sums in calcStrainStressB
      }
    }
  }
  /// The force on phyxel j if each part sums the forces of its phyxels, and the owner adds these
  /// sums in the order of parts.
  Vec3f summed_by_part(Index j, const std::vector<int>& part_of, int parts) const {
    Vec3f total = own_[j];
    for (const Push& push : pushes_[j]) {
      if (part_of[push.by] == part_of[j]) total += push.force;
    }
    for (int part = 0; part < parts; ++part) {
      if (part == part_of[j]) continue;
      Vec3f sum;
      for (const Push& push : pushes_[j]) {
        if (part_of[push.by] == part) sum += push.force;
      }
      total += sum;
    }
    return total;
  }
  /// The force on phyxel j summed in the order of phyxels, whatever the partition.
  Vec3f summed_by_phyxel(Index j) const {
    Vec3f total = own_[j];
    for (const Push& push : pushes_[j]) total += push.force;
    return total;
  }

 private:
  struct Push {
    Index by;
    Vec3f force;
  };
  const Csr& neighbours_;
  std::vector<Vec3f> own_;
  std::vector<std::vector<Push>> pushes_;
};

void add_cuts(const std::string& name, const Model& model, CsvTable& table) {
  const auto backend = paper::make_sequential_backend<float>(model);
  backend->upload(bent_and_twisted(model));
  backend->stress();
  const SummedForces forces(model, backend->pair_forces());
  const Graph graph = phyxel_graph(model);
  for (const int parts : {2, 4, 8}) {
    for (const std::string& by : partitioner_names()) {
      const std::vector<int> part_of = make_partition(graph, parts, partitioner_of(by));
      const PartitionQuality quality = quality_of(graph, part_of, parts);
      const ExchangeSize sent = exchange_size(model, part_of);
      Index other_bits = 0;
      float apart = 0, largest = 0;
      for (Index j = 0; j < model.size(); ++j) {
        const Vec3f whole = forces.summed_by_phyxel(j);
        const Vec3f by_part = forces.summed_by_part(j, part_of, parts);
        other_bits += by_part != whole;
        apart = std::max(apart, length_of(by_part - whole));
        largest = std::max(largest, length_of(whole));
      }
      const auto bytes = [](std::int64_t numbers) {
        return std::to_string(numbers * static_cast<std::int64_t>(sizeof(float)));
      };
      table.rows.push_back({name, std::to_string(model.size()), std::to_string(parts), by,
                            std::to_string(quality.cut), std::to_string(quality.ghosts),
                            fmt::format("{:.3f}", quality.slowest), bytes(sent.pair_stresses),
                            bytes(sent.pair_forces), bytes(sent.summed_forces),
                            std::to_string(other_bits), fmt::format("{:.1e}", apart / largest)});
      say(
          fmt::format("{:10} {} parts by {:10}: pair stresses {:.1f} kB, pair forces {:.1f} kB, "
                      "summed forces {:.1f} kB a step, the latter with other bits in {} phyxels",
                      name, parts, by, 4e-3 * static_cast<double>(sent.pair_stresses),
                      4e-3 * static_cast<double>(sent.pair_forces),
                      4e-3 * static_cast<double>(sent.summed_forces), other_bits));
    }
  }
}

}  // namespace

CsvTable measure_exchange(const PaperRequest& request) {
  CsvTable table;
  table.facts = paper_facts(request);
  table.columns = {"body",
                   "phyxels",
                   "parts",
                   "partitioner",
                   "cut_pairs",
                   "ghosts",
                   "slowest",
                   "pair_stress_bytes",
                   "pair_force_bytes",
                   "summed_force_bytes",
                   "summed_other_bits",
                   "summed_difference"};
  for (const std::string& name : request.bodies) {
    add_cuts(name, paper::paper_model(paper::body_scene(name)), table);
  }
  add_cuts("block", paper_block(block_phyxels), table);
  return table;
}

}  // namespace phyxel::app
