#include "view/recording.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "outside_text.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* format_name = "phyxel session 1";

[[noreturn]] void refuse(const std::filesystem::path& file, int line, const std::string& fault) {
  throw InputError(fmt::format("{}:{}: {}", file.string(), line, fault));
}

/// A text member of an object; empty if it has none.
std::string member(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

}  // namespace

std::string text_of(const Recording& recording) {
  Json head;
  head["format"] = format_name;
  head["program"] = recording.program;
  head["model"] = fmt::format("{:016x}", recording.model);
  head["precision"] = recording.precision;
  std::string text = json_text(head, -1) + "\n";
  for (const Recorded& recorded : recording.acts) {
    Json line;
    line["step"] = recorded.step;
    line.update(json_of(recorded.act));
    text += json_text(line, -1) + "\n";
  }
  return text;
}

Recording parse_recording(const std::string& text, const std::filesystem::path& file) {
  Recording recording;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    Json object = Json::parse(line, nullptr, false);
    if (!object.is_object()) refuse(file, number, "no JSON object; allowed: a recorded session");
    if (number == 1) {
      if (member(object, "format") != format_name) {
        refuse(file, number,
               fmt::format("the format is \"{}\"; allowed: \"{}\"", member(object, "format"),
                           format_name));
      }
      recording.program = member(object, "program");
      recording.precision = member(object, "precision");
      std::istringstream(member(object, "model")) >> std::hex >> recording.model;
      continue;
    }
    const auto step = object.find("step");
    if (step == object.end() || !step->is_number_integer() || step->get<std::int64_t>() < 0) {
      refuse(file, number, "the key \"step\" is missing, or no whole number from 0");
    }
    Recorded recorded{step->get<std::int64_t>(), {}};
    if (!recording.acts.empty() && recorded.step < recording.acts.back().step) {
      refuse(file, number,
             fmt::format("step {} comes after step {}", recorded.step, recording.acts.back().step));
    }
    object.erase("step");
    try {
      recorded.act = parse_request(object.dump());
    } catch (const InputError& error) {
      refuse(file, number, error.what());
    }
    if (!is_act(recorded.act.kind))
      refuse(file, number, "no act; allowed: grab, move, drop, set, reset, save");
    recording.acts.push_back(std::move(recorded));
  }
  if (recording.precision.empty()) refuse(file, 1, "no head; allowed: a recorded session");
  return recording;
}

}  // namespace phyxel::app
