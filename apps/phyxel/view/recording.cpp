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
/// Largest length of an act: deeper nesting would exhaust the stack.
constexpr std::size_t most_of_line = 4096;

[[noreturn]] void refuse(const std::filesystem::path& file, int line, const std::string& fault) {
  throw InputError(fmt::format("{}:{}: {}", file.string(), line, fault));
}

/// A text member of an object; empty if it has none.
std::string member(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

/// The run that a head tells of.
RecordedRun run_of(const Json& head) {
  RecordedRun of;
  std::istringstream(member(head, "model")) >> std::hex >> of.model;
  of.precision = member(head, "precision");
  of.method = member(head, "method");
  if (const auto dt = head.find("dt"); dt != head.end() && dt->is_number()) {
    of.dt = dt->get<double>();
  }
  const auto parameters = head.find("parameters");
  if (parameters == head.end() || !parameters->is_object()) return of;
  for (const auto& [name, value] : parameters->items()) {
    if (value.is_string()) of.parameters.push_back({name, value.get<std::string>()});
  }
  return of;
}

}  // namespace

std::string differences(const RecordedRun& then, const RecordedRun& now) {
  std::string lines;
  const auto compare = [&](const char* what, const auto& before, const auto& after) {
    if (before != after) lines += fmt::format("{}: {} then, {} now\n", what, before, after);
  };
  compare("precision", then.precision, now.precision);
  compare("method", then.method, now.method);
  compare("time step [s]", then.dt, now.dt);
  lines += parameter_differences(then.parameters, now.parameters);
  if (lines.empty() && then.model != now.model) lines = "the model's digest is another";
  while (!lines.empty() && lines.back() == '\n') lines.pop_back();
  return lines;
}

std::string text_of(const Recording& recording) {
  Json head;
  head["format"] = format_name;
  head["program"] = recording.program;
  const RecordedRun& of = recording.of;
  head["model"] = fmt::format("{:016x}", of.model);
  head["precision"] = of.precision;
  head["method"] = of.method;
  head["dt"] = of.dt;
  head["parameters"] = Json::object();
  for (const auto& [name, value] : of.parameters) head["parameters"][name] = value;
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
    if (number > 1 && line.size() > most_of_line) {
      refuse(file, number, fmt::format("{} bytes; allowed: {} a line", line.size(), most_of_line));
    }
    Json object = Json::parse(line, nullptr, false);
    if (!object.is_object()) refuse(file, number, "no JSON object; allowed: a recorded session");
    if (number == 1) {
      if (member(object, "format") != format_name) {
        refuse(file, number,
               fmt::format("the format is \"{}\"; allowed: \"{}\"", member(object, "format"),
                           format_name));
      }
      recording.program = member(object, "program");
      recording.of = run_of(object);
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
  if (recording.of.precision.empty()) refuse(file, 1, "no head; allowed: a recorded session");
  return recording;
}

}  // namespace phyxel::app
