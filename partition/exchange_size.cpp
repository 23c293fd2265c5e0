#include "partition/exchange_size.hpp"

#include <algorithm>
#include <span>

namespace phyxel {
namespace {

constexpr int displacement = 3, pair_stress = 9, force = 3;

/// Adds the parts of some phyxels to `parts`, except `own`.
void add_parts(std::vector<int>& parts, std::span<const Index> phyxels,
               const std::vector<int>& part_of, int own) {
  for (const Index i : phyxels) {
    if (part_of[i] != own) parts.push_back(part_of[i]);
  }
}

std::int64_t count_distinct(std::vector<int>& parts) {
  std::sort(parts.begin(), parts.end());
  return std::unique(parts.begin(), parts.end()) - parts.begin();
}

}  // namespace

ExchangeSize exchange_size(const Model& model, const std::vector<int>& part_of) {
  const Neighbourhood& hood = model.with_lists().neighbourhood;
  std::int64_t ghosts = 0, pushed_ghosts = 0, pairs = 0;
  std::vector<int> parts;
  for (Index j = 0; j < model.size(); ++j) {
    const int own = part_of[j];
    parts.clear();
    add_parts(parts, hood.inverse().row(j), part_of, own);  // parts whose phyxels exert forces on j
    pairs += static_cast<std::int64_t>(parts.size());
    pushed_ghosts += count_distinct(parts);
    add_parts(parts, hood.neighbours.row(j), part_of, own);
    ghosts += count_distinct(parts);
  }
  return {ghosts * (displacement + pair_stress), ghosts * displacement + pairs * force,
          ghosts * displacement + pushed_ghosts * force};
}

}  // namespace phyxel
