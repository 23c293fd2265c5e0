#include "video.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "outside_text.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// A format of videos.
struct Format {
  const char *ending, *muxer;          ///< Of the file's name, and ffmpeg's name.
  std::vector<std::string> arguments;  ///< Of the encoder, beside ffmpeg's choices.
};

const std::vector<Format>& formats() {
  static const std::vector<Format> all = [] {
    // Colours at half the resolution, which all players understand, and the index at the start.
    const std::vector<std::string> half{"-pix_fmt", "yuv420p"},
        fast{"-pix_fmt", "yuv420p", "-movflags", "+faststart"};
    return std::vector<Format>{
        {".mp4", "mp4", fast},
        {".mov", "mov", fast},
        {".mkv", "matroska", half},
        {".webm", "webm", half},
        {".gif", "gif", {"-filter_complex", "split[a][b];[a]palettegen[p];[b][p]paletteuse"}}};
  }();
  return all;
}

const Format* format_of(const fs::path& file) {
  const std::string ending = file.extension().string();
  const auto found = std::find_if(formats().begin(), formats().end(),
                                  [&](const Format& format) { return ending == format.ending; });
  return found == formats().end() ? nullptr : &*found;
}

ChildRequest encoding(const VideoRequest& request, int width, int height, const fs::path& to,
                      const fs::path& errors) {
  const Format& format = *format_of(request.file);
  ChildRequest child{program_on_path("ffmpeg"), {}, {}, errors, true};
  child.arguments = {"-hide_banner",
                     "-loglevel",
                     "error",
                     "-nostdin",
                     "-y",
                     "-f",
                     "rawvideo",
                     "-pixel_format",
                     "rgb24",
                     "-video_size",
                     fmt::format("{}x{}", width, height),
                     "-framerate",
                     fmt::format("{}", request.pictures_per_second),
                     "-i",
                     "pipe:0"};
  child.arguments.insert(child.arguments.end(), format.arguments.begin(), format.arguments.end());
  // file: keeps ffmpeg from taking a name for a protocol or an option.
  child.arguments.insert(child.arguments.end(),
                         {"-f", format.muxer, "file:" + fs::absolute(to).string()});
  return child;
}

}  // namespace

void check_video(const VideoRequest& request, int width, int height, bool overwrite) {
  const std::string name = request.file.string();
  if (!format_of(request.file)) {
    std::vector<std::string> endings;
    for (const Format& format : formats()) endings.push_back(format.ending);
    throw InputError(
        fmt::format("--video {}: allowed: a name that ends in {}", name, fmt::join(endings, ", ")));
  }
  if (width % 2 != 0 || height % 2 != 0) {
    throw InputError(
        fmt::format("--video with --width {} --height {}: allowed: even numbers", width, height));
  }
  if (program_on_path("ffmpeg").empty()) {
    throw InputError(
        fmt::format("--video {}: ffmpeg, which encodes videos, is not on PATH (Debian: ffmpeg); "
                    "allowed without it: a numbered sequence of pictures, without --video",
                    name));
  }
  check_output_file(request.file, overwrite, Output::file);
}

Video::Video(const VideoRequest& request, int width, int height)
    : file_(request.file),
      errors_(folder_.file("errors.txt")),
      new_file_(request.file, 0),
      encoder_(encoding(request, width, height, new_file_.temporary(), errors_)) {}

void Video::fail() {
  constexpr std::size_t most_read = std::size_t{1} << 26, most_said = 500;
  std::string said = valid_utf8(read_text_file(errors_, most_read)).substr(0, most_said);
  while (!said.empty() && said.back() == '\n') said.pop_back();
  throw OutputError(fmt::format("{}: ffmpeg failed: {}", file_.string(),
                                said.empty() ? "it gives no reason" : said));
}

void Video::add(const Image& picture) {
  if (encoder_.feed(std::as_bytes(std::span(picture.rgb)))) return;
  encoder_.wait();
  fail();
}

void Video::finish() {
  if (!encoder_.wait() || fs::file_size(new_file_.temporary()) == 0) fail();
  new_file_.finish(Durable::no);
}

}  // namespace phyxel::app
