#include "scene/scene_probes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "phyxel/error.hpp"
#include "scene/scene_body.hpp"

namespace phyxel {
namespace {

/// The points of a probe: one, or some along a line.
std::vector<Vec3d> read_points(const SceneTable& table) {
  if (table.has("point")) {
    Vec3d point;
    table.read("point", point);
    return {point};
  }
  Vec3d from, to;
  int count = 11;
  table.read("from", from);
  table.read("to", to);
  table.read("points", count);
  std::vector<Vec3d> points;
  for (int k = 0; k < count; ++k) {
    const double share = static_cast<double>(k) / (count - 1);
    points.push_back((1 - share) * from + share * to);
  }
  return points;
}

ProbeRequest read_probe(const SceneTable& table, std::size_t number) {
  table.expect_one_of({"point", "from", "region", "indices", "box", "ball", "mesh", "all"});
  table.expect_together("from", "to");
  if (table.has("points") && !table.has("from")) {
    table.refuse("points",
                 "found without from and to; allowed: with both, for points along a line");
  }
  ProbeRequest probe{.name = fmt::format("probe {}", number), .where = table.where()};
  for (const char* key : {"point", "from"}) {
    if (table.has(key)) probe.where = table.where(key);
  }
  table.read("name", probe.name);
  if (table.has("point") || table.has("from")) {
    probe.points = read_points(table);
  } else {
    probe.select = read_selection(table);
  }
  return probe;
}

BodyRequest& body_of(const SceneTable& table, std::vector<BodyRequest>& bodies) {
  if (!table.has("body")) {
    if (bodies.size() == 1) return bodies.front();
    throw InputError(
        fmt::format("{}: key probe.body is missing; needed: the name of one of the {} bodies",
                    table.where(), bodies.size()));
  }
  std::string name;
  table.read("body", name);
  const auto found = std::find_if(bodies.begin(), bodies.end(),
                                  [&](const BodyRequest& body) { return body.name == name; });
  if (found != bodies.end()) return *found;
  table.refuse("body", fmt::format("{} found, which no body is called; allowed: {}",
                                   in_quotes(name), names_of(bodies)));
}

}  // namespace

void read_probes(const SceneTable& root, std::vector<BodyRequest>& bodies) {
  std::map<std::string, std::string> places;  // of each name
  std::size_t number = 0;
  for (const SceneTable& table : root.tables("probe")) {
    ProbeRequest probe = read_probe(table, ++number);
    const auto [earlier, is_new] = places.emplace(probe.name, probe.where);
    if (!is_new) {
      table.refuse("name",
                   fmt::format("{} found, the name of the probe at {} too; allowed: a name of its "
                               "own for each probe",
                               in_quotes(probe.name), earlier->second));
    }
    body_of(table, bodies).probes.push_back(std::move(probe));
  }
}

}  // namespace phyxel
