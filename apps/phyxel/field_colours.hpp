/// The colouring of a trajectory by one of its fields.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "colouring.hpp"
#include "trajectory.hpp"

namespace phyxel::app {

/// A request for colours that show a field.
struct ColourRequest {
  std::string field;  ///< A name in `colour_fields`.
  /// Range of the colours; unset: that of most values of the chosen frames.
  std::optional<std::pair<double, double>> range = {};
  Scale scale = Scale::automatic;  ///< Linear if it is automatic and `range` is set.
  /// The option --cut, on whose faces colours show phyxels inside surfaces; "": none.
  std::string cut = {};
};

/// The colouring that a request asks for.
/// @param chosen numbers of the shots whose values give the range
/// @param spacing typical distance between phyxels [m]; 0 if unknown
/// @throws InputError if the frames lack the field, or phyxels do that are inside
Colouring field_colours(const std::vector<Shot>& shots, const std::vector<std::size_t>& chosen,
                        const ColourRequest& request, double spacing);

}  // namespace phyxel::app
