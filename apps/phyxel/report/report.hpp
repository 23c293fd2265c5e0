/// phyxel report: one file that a browser opens, offline.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace phyxel::app {

/// How a trajectory becomes a page.
struct ReplayRequest {
  std::filesystem::path input;  ///< A run's folder, a series, or one frame.
  double megabytes = 64;        ///< The page may have so many.
  bool stress = true;           ///< Whether strain and stress are found, where frames lack them.
};

/// A page, and what it holds.
struct Report {
  std::string html;
  std::size_t frames = 0, phyxels = 0, surfels = 0;  ///< Shown.
  std::vector<std::string> fields;                   ///< That colours can show.
  std::vector<std::string> notes;                    ///< What was left out, and why.
};

/// A trajectory, replayed; its energies, scene, timing and warnings.
/// @throws InputError if there is none, or not even two of its frames fit
Report replay_page(const ReplayRequest& request);

/// Measurements: tables as `write_csv` leaves them, with charts.
/// @throws InputError for other files
Report results_page(const std::vector<std::filesystem::path>& tables);

/// How much of a trajectory fits into a page.
struct FramePlan {
  std::size_t frames = 0;
  std::size_t phyxel_stride = 1;  ///< One phyxel in so many is shown.
};
/// @param surface_bytes,phyxel_bytes of a frame, as text @param bytes for all frames
/// @throws InputError if no two frames fit, or not the only one
FramePlan plan_frames(std::size_t frames, double surface_bytes, double phyxel_bytes, double bytes);

}  // namespace phyxel::app
