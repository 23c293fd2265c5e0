#include "model/share_surveyor.hpp"

namespace phyxel {

Around around_by_lists(const Neighbourhood& hood, Index begin, std::span<const char> own) {
  Around around;
  around.needed.resize(own.size(), 0);
  around.length.resize(own.size(), 0);
  for (std::size_t k = 0; k < own.size(); ++k) {
    if (!own[k]) continue;
    const Index i = begin + static_cast<Index>(k);
    around.length[k] = hood.neighbours.length(i);
    for (const Index j : hood.neighbours.row(i)) around.needed[j - begin] = 1;
    for (const Index j : hood.inverse().row(i)) around.needed[j - begin] = 1;
  }
  return around;
}

}  // namespace phyxel
