#include "export/paraview.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

#include "compose.hpp"
#include "embedded_files.hpp"
#include "frame_scene.hpp"
#include "outside_text.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Three numbers, of which none is -0.
Json json_of(Vec3d v) { return Json::array({v.x + 0.0, v.y + 0.0, v.z + 0.0}); }

/// The field that colours show unless one is requested: the first of these that a frame has.
std::string usual_field(const FrameData& frame) {
  const std::vector<std::string> fields = colour_fields(frame);
  for (const char* wanted : {"von_mises", "displacement"}) {
    if (std::find(fields.begin(), fields.end(), wanted) != fields.end()) return wanted;
  }
  return fields.empty() ? "" : fields.front();
}

/// The colours of a field, and the family that shows them.
void add_colours(Json& settings, const std::vector<Shot>& shots, const ColourRequest& request,
                 const FrameData* surface, const FrameData* phyxels, double spacing) {
  std::vector<std::size_t> all(shots.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const Colouring colouring = field_colours(shots, all, request, spacing);
  const bool on_surface = surface != nullptr && field_values(*surface, request.field);
  const FrameData& frame = on_surface ? *surface : *phyxels;
  const std::string stored = stored_name(request.field);
  settings["coloured"] = on_surface ? "surface" : "phyxels";
  settings["colours"] = {{"field", stored},
                         {"vector", frame.field.at(stored).size() > frame.point.size()},
                         {"title", field_title(request.field)},
                         {"low", colouring.range.low},
                         {"high", colouring.range.high},
                         {"logarithmic", colouring.range.logarithmic}};
}

}  // namespace

std::string paraview_state(const fs::path& folder, ColourRequest colours) {
  const std::vector<Shot> shots = find_trajectory(folder, {}).shots;
  const auto surface = read_if_any(shots.front().surface, true),
             phyxels = read_if_any(shots.front().phyxels, true);
  const FrameData& first = surface ? *surface : *phyxels;
  Json settings{{"folder", fs::absolute(folder).lexically_normal().string()}};
  for (const char* family : {"surface", "phyxels"}) {
    const std::string file = std::string(family) + ".hdf.series";
    if (fs::exists(folder / file)) settings["files"][family] = file;
  }
  const double spacing = phyxels ? typical_spacing(phyxels->point) : 0;
  settings["radius"] = 0.5 * spacing;
  if (colours.field.empty() && surface) colours.field = usual_field(*surface);
  if (colours.field.empty() && phyxels) colours.field = usual_field(*phyxels);
  settings["coloured"] = nullptr;
  if (!colours.field.empty()) {
    add_colours(settings, shots, colours, surface ? &*surface : nullptr,
                phyxels ? &*phyxels : nullptr, spacing);
  }
  for (const Shot& shot : shots) settings["times"].push_back(shot.time);
  const RenderRequest wishes =
      render_request_of(first.scene, surface ? shots.front().surface : shots.front().phyxels);
  settings["view"] = json_of(wishes.view);
  settings["up"] = json_of(wishes.up);

  std::string script(export_files().front().content);
  // A JSON text as a string of JSON, which is one of Python, too.
  const std::string token = "@settings@";
  return script.replace(script.find(token), token.size(), json_text(json_text(settings, -1), -1));
}

}  // namespace phyxel::app
