#include "run/fragment_summary.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace phyxel::app {

nlohmann::ordered_json json_of(const std::vector<FragmentReading>& fragments) {
  if (fragments.empty()) return nullptr;
  const FragmentTotals totals = totals_of(fragments);
  return {{"count", totals.fragments},
          {"largest_share_of_mass", totals.largest_share},
          {"dust_phyxels", totals.dust},
          {"dust_share_of_mass", totals.dust_share}};
}

void say_fragments(const std::vector<FragmentReading>& fragments) {
  if (fragments.empty()) return;
  const FragmentTotals totals = totals_of(fragments);
  fmt::print("  fragments   {}, the heaviest with {:.3g}% of the mass; {}\n", totals.fragments,
             100 * totals.largest_share,
             totals.dust == 0 ? "no dust"
                              : fmt::format("dust of {} phyxel{}, {:.3g}% of the mass", totals.dust,
                                            totals.dust == 1 ? "" : "s", 100 * totals.dust_share));
}

}  // namespace phyxel::app
