// Compiled without fused multiplications, so that neighbours are those of the CPU.
#include <algorithm>

#include "setup/device_neighbours.cuh"

namespace phyxel::cuda {
namespace {

DeviceRows send(const Csr& lists, const Model& model) {
  const std::string what = "neighbour lists of " + std::to_string(model.size()) + " phyxels";
  return {sent(lists.offsets, what), sent(lists.indices, what)};
}

}  // namespace

Neighbours neighbours_of(const Model& model) {
  Neighbours all;
  all.position = sent(model.position, "rest positions");
  all.support = sent(model.neighbourhood.support, "supports");
  if (model.has_lists()) {
    all.lists = send(model.neighbourhood.neighbours, model);
    if (!model.neighbourhood.symmetric) {
      all.inverse_lists = send(model.neighbourhood.inverse(), model);
    }
    return all;
  }
  std::vector<DeviceHash::Body> bodies;
  std::vector<double> largest_support;
  for (const Part& part : model.parts) {
    const auto begin = model.neighbourhood.support.begin() + part.begin,
               end = model.neighbourhood.support.begin() + part.end;
    double sum = 0, largest = 0;
    for (auto h = begin; h != end; ++h) {
      sum += *h;
      largest = std::max(largest, *h);
    }
    const double mean = sum / std::max(1, part.end - part.begin);
    bodies.push_back({part.begin, part.end, model.neighbourhood.symmetric ? largest : mean});
    largest_support.push_back(largest);
  }
  all.table.emplace(all.position, bodies);
  all.largest_support = sent(largest_support, "supports");
  return all;
}

DeviceRows rows_of(const NeighbourSource& near, Index phyxels, const char* owned,
                   const Index* global_id, const std::string& what) {
  const auto n = static_cast<std::size_t>(phyxels);
  DeviceArray<Offset> length(n, what);
  for_each("count_neighbours", phyxels,
           [near, owned, length = length.data()] __device__(std::int64_t k) {
             const Index i = near.in_order(k);
             Offset found = 0;
             if (!owned || owned[i]) near.visit(i, [&](Index) { ++found; });
             length[i] = found;
           });
  DeviceRows rows{running_sums(length), {}};
  rows.indices = {static_cast<std::size_t>(last_of(rows.offsets)), what};
  for_each("list_neighbours", phyxels,
           [near, owned, global_id, offsets = rows.offsets.data(),
            indices = rows.indices.data()] __device__(std::int64_t k) {
             const Index i = near.in_order(k);
             if (owned && !owned[i]) return;
             Offset at = offsets[i];
             const auto each = [&](auto&& offer) { near.visit(i, offer); };
             in_ascending_order(global_id, each, [&](Index j) { indices[at++] = j; });
           });
  return rows;
}

}  // namespace phyxel::cuda
