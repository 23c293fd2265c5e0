#include "model/closing_gathers.hpp"

namespace phyxel::closing {
namespace {

typedef double Lanes __attribute__((vector_size(32)));  // NOLINT: GCC ignores it on `using`

}  // namespace

Vec3d terms_on_host(const Gathers& gathers, Index j, Row neighbours, const RowWeights& weights,
                    Vec3d start) {
  return gathers.terms<Lanes>(j, neighbours, weights, start);
}

Differences differences_on_host(const Gathers& gathers, Index j, Row neighbours,
                                const RowWeights& weights) {
  return gathers.differences<Lanes>(j, neighbours, weights);
}

}  // namespace phyxel::closing
