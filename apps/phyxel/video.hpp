/// Videos, encoded by ffmpeg.
#pragma once

#include <filesystem>
#include <string>

#include "child_process.hpp"
#include "files/atomic_file.hpp"
#include "rasteriser.hpp"

namespace phyxel::app {

/// The file of a video and its pictures per second of playing.
struct VideoRequest {
  std::filesystem::path file;
  int pictures_per_second = 25;
};

/// Checks that a video may be written: its ending, ffmpeg on PATH, the size of its pictures [px],
/// and that no file is in the way. @throws InputError
void check_video(const VideoRequest& request, int width, int height, bool overwrite);

/// A video that is being written. The file appears once it is complete; an unfinished one is
/// removed.
class Video {
 public:
  /// Starts ffmpeg. @throws InputError and OutputError
  Video(const VideoRequest& request, int width, int height);
  /// Adds a picture of the video's size. @throws OutputError with ffmpeg's message
  void add(const Image& picture);
  /// Completes the file. @throws OutputError with ffmpeg's message
  void finish();

 private:
  [[noreturn]] void fail();

  std::filesystem::path file_;
  PrivateFolder folder_;
  std::filesystem::path errors_;  // what ffmpeg says
  NewFile new_file_;
  Child encoder_;
};

}  // namespace phyxel::app
