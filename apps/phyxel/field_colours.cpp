#include "field_colours.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "phyxel/error.hpp"
#include "sort_unique.hpp"

namespace phyxel::app {

Colouring field_colours(const std::vector<Shot>& shots, const std::vector<std::size_t>& chosen,
                        const ColourRequest& request, double spacing) {
  Colouring colouring{.field = request.field};
  const auto surface = read_if_any(shots.front().surface, true),
             phyxels = read_if_any(shots.front().phyxels, true);
  if (surface && phyxels && !surface->point.empty() && !phyxels->point.empty()) {
    colouring.carriers = carriers_of(surface->point, phyxels->point, carrier_reach(spacing));
  }
  const auto shown = [&](const std::optional<FrameData>& a, const std::optional<FrameData>& b) {
    return shown_values(a ? &*a : nullptr, b ? &*b : nullptr, colouring);
  };
  if (shown(surface, phyxels).empty()) {
    std::vector<std::string> names;
    for (const auto& frame : {surface, phyxels}) {
      if (!frame) continue;
      for (const std::string& name : colour_fields(*frame)) names.push_back(name);
    }
    sort_unique(names);
    throw InputError(fmt::format(
        "--colour {}: the frames have no such number or vector; allowed: {}; "
        "output.fields of the scene adds others",
        request.field, names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  }
  const bool cuts = surface && !request.cut.empty();
  if (cuts && !(phyxels && field_values(*phyxels, request.field))) {
    throw InputError(fmt::format(
        "--cut {} --colour {}: the phyxels of the frames lack the field, which the faces of a cut "
        "take from them; allowed: --cut without --colour, or a field of output.fields",
        request.cut, request.field));
  }
  if (request.range) {
    const auto [low, high] = *request.range;
    colouring.range = {low, high, request.scale == Scale::logarithmic};
    return colouring;
  }
  constexpr std::size_t most = 1'000'000;  // values of a sample
  std::vector<double> sample;
  for (const std::size_t k : chosen) {
    const auto inside = read_if_any(shots[k].phyxels, true);
    std::vector<double> values = shown(read_if_any(shots[k].surface, true), inside);
    if (cuts && inside) {
      const auto more = field_values(*inside, request.field);
      if (more) values.insert(values.end(), more->begin(), more->end());
    }
    const std::size_t every = 1 + values.size() * chosen.size() / most;
    for (std::size_t i = 0; i < values.size(); i += every) {
      if (std::isfinite(values[i])) sample.push_back(values[i]);
    }
  }
  colouring.range = colour_range(std::move(sample), request.scale);
  return colouring;
}

}  // namespace phyxel::app
