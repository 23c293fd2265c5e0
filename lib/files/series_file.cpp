/// Series files: the names and times of a trajectory's frames, in ParaView's format.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "files/atomic_file.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"

namespace phyxel {
namespace {

constexpr const char* opening = "{\"file-series-version\":\"1.0\",\"files\":[";
constexpr const char* closing = "\n]}\n";
constexpr std::size_t largest_series = std::size_t{256} << 20;

std::string line_of(const SeriesEntry& entry, bool first) {
  return fmt::format("{}\n{{\"name\":\"{}\",\"time\":{:.17g}}}", first ? "" : ",",
                     entry.file.filename().string(), entry.time);
}

}  // namespace

void SeriesFile::create(const std::filesystem::path& file,
                        const std::vector<SeriesEntry>& entries) {
  file_ = file;
  std::string text = opening;
  for (std::size_t e = 0; e < entries.size(); ++e) text += line_of(entries[e], e == 0);
  empty_ = entries.empty();
  end_ = text.size();
  write_whole_file(file, text + closing, Durable::no);
}

void SeriesFile::append(const SeriesEntry& entry) {
  const std::string line = line_of(entry, empty_);
  replace_tail(file_, end_, line + closing);
  end_ += line.size();
  empty_ = false;
}

std::vector<SeriesEntry> read_series(const std::filesystem::path& file) {
  using nlohmann::json;
  const json series = json::parse(read_text_file(file, largest_series), nullptr, false);
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format("{}: not a series of frames: {}", file.string(), why));
  };
  if (series.is_discarded()) refuse("it is not valid JSON");
  if (!series.is_object() || !series.contains("files") || !series["files"].is_array()) {
    refuse("it has no list \"files\"");
  }
  std::vector<SeriesEntry> entries;
  for (const json& item : series["files"]) {
    if (!item.is_object() || !item.contains("name") || !item["name"].is_string() ||
        !item.contains("time") || !item["time"].is_number()) {
      refuse(fmt::format("entry {} has no \"name\" and \"time\"", entries.size()));
    }
    const SeriesEntry entry{file.parent_path() / item["name"].get<std::string>(),
                            item["time"].get<double>()};
    if (!std::isfinite(entry.time))
      refuse(fmt::format("the time of entry {} is not finite", entries.size()));
    entries.push_back(entry);
  }
  return entries;
}

}  // namespace phyxel
