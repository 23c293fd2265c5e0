/// The keys of bodies that break.
#include "scene/key_parts.hpp"

namespace phyxel {

// clang-format off

std::vector<SceneKey> fracture_keys() {
  using namespace ranges;
  return {
      {.section = "body.fracture", .name = "energy_release_rate", .unit = "J/m^2", .required = true, .range = {0, stiffest, true},
       .meaning = "Energy that a crack takes by its area, G_c: glass 5, ceramics 50, steel 2e4. Cracks run where the deformation "
           "offers more."},
      {.section = "body.fracture", .name = "strength", .unit = "Pa", .otherwise = "that of `energy_release_rate` and the distance between phyxels", .range = {0, stiffest, true},
       .meaning = "Stress at which pairs break where there is no crack, at least. Without it pairs bear about "
           "sqrt(E energy_release_rate / spacing). A lower strength is refused with the spacing that would have it; a higher one makes "
           "cracks take more energy, which the run says."},
      {.section = "body.fracture", .name = "scatter", .otherwise = "none", .range = between(1, 1000),
       .meaning = "Weibull's modulus of the critical stretches of pairs: 10 for glass and ceramics. Their distribution is "
           "exp(-(s/s_c)^modulus), where s_c is the critical stretch of all without it."},
      {.section = "body.fracture", .name = "seed", .type = KeyType::integer, .fallback = "1", .range = at_least(0),
       .meaning = "Seed of the scatter: the same seed gives the same critical stretches on any device and any number of ranks."},
      {.section = "body.fracture", .name = "unbreakable", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Regions whose phyxels never break from their neighbours."},
      {.section = "body.notch", .name = "centre", .type = KeyType::vector, .unit = "m", .otherwise = "required without `mesh`", .range = within(10 * longest),
       .meaning = "Centre of the disc, once the body is in place."},
      {.section = "body.notch", .name = "normal", .type = KeyType::vector, .otherwise = "required with `centre`", .range = within(longest),
       .meaning = "Direction across the disc; not zero."},
      {.section = "body.notch", .name = "radius", .unit = "m", .otherwise = "required with `centre`", .range = between(shortest, 10 * longest),
       .meaning = "Radius of the disc."},
      {.section = "body.notch", .name = "mesh", .type = KeyType::path, .otherwise = "required without `centre`",
       .meaning = "A file with a surface (OBJ, PLY or STL), open or closed, in place of a disc: it is placed as the body is, scaled, turned and "
           "moved."},
  };
}

// clang-format on

}  // namespace phyxel
