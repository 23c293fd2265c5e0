#include "scene/scene_parameters.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <xxhash.h>

#include <algorithm>
#include <map>

#include "scene/scene_schema.hpp"

namespace phyxel {
namespace {

constexpr std::size_t most_named_bodies = 64;
constexpr std::size_t most_named_indices = 16;
constexpr std::size_t most_differences = 8;

struct FreeKey {
  const char *section, *key, *why;
};
/// What a resumed run may change, and why that is no other run. Every other key is compared.
constexpr FreeKey free_keys[] = {
    {"", "title", "shown only"},
    {"time", "end", "a run may go on for longer, or end earlier"},
    {"time", "step", "the step that follows from it is compared itself"},
    {"time", "safety", "the step that follows from it is compared itself"},
    {"solver", "device", "a run may go on on another device, with its rounding"},
    {"solver", "threads", "the bits are equal on any number"},
    {"output", "directory", "only where frames go"},
    {"output", "checkpoint_every", "only how much work a kill may lose"},
    {"render", "pictures", "pictures are made of frames, afterwards"},
    {"render", "count", "pictures are made of frames, afterwards"},
    {"render", "width", "pictures are made of frames, afterwards"},
    {"render", "height", "pictures are made of frames, afterwards"},
    {"render", "view", "pictures are made of frames, afterwards"},
    {"render", "up", "pictures are made of frames, afterwards"},
    {"render.camera", "position", "pictures are made of frames, afterwards"},
    {"render.camera", "target", "pictures are made of frames, afterwards"},
    {"render.camera", "field_of_view", "pictures are made of frames, afterwards"},
    {"render.camera", "orbit", "pictures are made of frames, afterwards"},
    {"render.camera", "follow", "pictures are made of frames, afterwards"},
    {"body", "mesh", "a path: what the file holds is in the model's digest"},
    {"body", "file", "a path: what the file holds is in the model's digest"},
    {"body", "cloud", "a name: what the cloud holds is in the model's digest"},
};

std::uint64_t hash_of(std::string_view text) { return XXH3_64bits(text.data(), text.size()); }

/// One line: what a file keeps one of.
std::string on_one_line(std::string_view text) {
  std::string line = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') line += '\\';
    if (byte < 0x20 || byte == 0x7f) {
      line += fmt::format("\\x{:02x}", byte);
    } else {
      line += c;
    }
  }
  return line + '"';
}

const SceneKey* find_key(const std::string& section, const std::string& name) {
  for (const SceneKey& key : scene_keys()) {
    if (key.section == section && key.name == name) return &key;
  }
  return nullptr;
}

std::string in_words(const char*, const char*, double v) { return fmt::format("{}", v); }
std::string in_words(const char*, const char*, int v) { return fmt::format("{}", v); }
std::string in_words(const char*, const char*, std::uint64_t v) { return fmt::format("{}", v); }
std::string in_words(const char*, const char*, bool v) { return v ? "true" : "false"; }
std::string in_words(const char*, const char*, Vec3d v) {
  return fmt::format("[{}, {}, {}]", v.x, v.y, v.z);
}
std::string in_words(const char*, const char*, const std::string& v) { return on_one_line(v); }
std::string in_words(const char*, const char*, const std::vector<std::string>& v) {
  std::vector<std::string> words;
  for (const std::string& word : v) words.push_back(on_one_line(word));
  return fmt::format("[{}]", fmt::join(words, ", "));
}
std::string in_words(const char*, const char*, const std::vector<Index>& v) {
  if (v.size() <= most_named_indices) return fmt::format("[{}]", fmt::join(v, ", "));
  return fmt::format("{} indices, hash {:016x}", v.size(),
                     XXH3_64bits(v.data(), v.size() * sizeof(Index)));
}
std::string in_words(const char*, const char*, const std::vector<LoadCurve::Point>& v) {
  if (v.size() > most_named_indices) {
    return fmt::format("{} points, hash {:016x}", v.size(),
                       XXH3_64bits(v.data(), v.size() * sizeof(v[0])));
  }
  std::vector<std::string> points;
  for (const auto [time, factor] : v) points.push_back(fmt::format("[{}, {}]", time, factor));
  return fmt::format("[{}]", fmt::join(points, ", "));
}
std::string in_words(const char*, const char*, const ParameterValue::Curve& v) {
  std::vector<std::string> points;
  for (const auto& [x, y] : v) points.push_back(fmt::format("[{}, {}]", x, y));
  return fmt::format("[{}]", fmt::join(points, ", "));
}
std::string in_words(const char* section, const char* name, Word word) {
  const SceneKey* key = find_key(section, name);
  return key && word.index < key->words.size() ? on_one_line(key->words[word.index])
                                               : fmt::format("{}", word.index);
}

std::string name_of(const ParameterOwner& owner, const std::string& section,
                    const std::string& key) {
  std::string name = section.empty() ? key : section + "." + key;
  if (!owner.body && owner.entry > 0) name += fmt::format(" of {} {}", owner.list, owner.entry);
  if (!owner.body) return name;
  if (section.starts_with("selection")) name = fmt::format("body.{}.{}", owner.list, name);
  name += fmt::format(" of body {} ({})", owner.number, on_one_line(owner.body->name));
  if (owner.entry > 0) name += fmt::format(", {} {}", owner.list, owner.entry);
  return name;
}

}  // namespace

const char* free_on_resume(std::string_view section, std::string_view key) {
  for (const FreeKey& free : free_keys) {
    if (section == free.section && key == free.key) return free.why;
  }
  return nullptr;
}

std::string axes_in_words(const Axes& axes) {
  return std::string(axes.x ? "x" : "") + (axes.y ? "y" : "") + (axes.z ? "z" : "");
}

std::vector<Parameter> scene_parameters(const Scene& scene) {
  std::vector<Parameter> list;
  list.push_back({"bodies", fmt::format("{}", scene.bodies.size())});
  std::uint64_t others = 0;
  const auto add = [&](const ParameterOwner& owner, Parameter parameter) {
    if (owner.number <= most_named_bodies) {
      if (!list.empty() && list.back().name == parameter.name) {
        list.back().value += ", " + parameter.value;  // a box has two corners
      } else {
        list.push_back(std::move(parameter));
      }
    } else {
      others = hash_of(fmt::format("{:016x} {} {}", others, parameter.name, parameter.value));
    }
  };
  for_each_parameter(scene, [&](const ParameterOwner& owner, const char* section, const char* key,
                                const auto& value) {
    if (free_on_resume(section, key)) return;
    add(owner, {name_of(owner, section, key), in_words(section, key, value)});
  });
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyRequest& body = scene.bodies[b];
    const ParameterOwner owner{.body = &body, .number = b + 1};
    const auto add_law = [&](const Material& material, const std::string& whose) {
      if (!material.custom_law) return;
      add(owner, {name_of(owner, "body.material", "custom_law") + whose,
                  on_one_line(material.custom_law->name())});
    };
    add_law(body.material, "");
    for (std::size_t k = 0; k < body.inclusions.size(); ++k) {
      add_law(body.inclusions[k].material, fmt::format(", inclusion {}", k + 1));
    }
  }
  if (scene.bodies.size() > most_named_bodies) {
    list.push_back({fmt::format("bodies {} to {}", most_named_bodies + 1, scene.bodies.size()),
                    fmt::format("hash {:016x}", others)});
  }
  return list;
}

std::string parameter_differences(const std::vector<Parameter>& then,
                                  const std::vector<Parameter>& now) {
  std::map<std::string, std::pair<std::string, std::string>> both;
  std::vector<std::string> order;
  const auto note = [&](const std::vector<Parameter>& list, auto member) {
    for (const Parameter& p : list) {
      const auto [at, is_new] = both.try_emplace(p.name, "nothing", "nothing");
      if (is_new) order.push_back(p.name);
      at->second.*member = p.value;
    }
  };
  note(then, &std::pair<std::string, std::string>::first);
  note(now, &std::pair<std::string, std::string>::second);
  std::vector<std::string> lines;
  std::size_t left_out = 0;
  for (const std::string& name : order) {
    const auto& [before, after] = both.at(name);
    if (before == after) continue;
    if (lines.size() == most_differences) {
      ++left_out;
    } else {
      lines.push_back(fmt::format("{}: {} then, {} now", name, before, after));
    }
  }
  if (left_out > 0) lines.push_back(fmt::format("and {} more", left_out));
  return fmt::format("{}", fmt::join(lines, "\n"));
}

}  // namespace phyxel
