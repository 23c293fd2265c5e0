/// phyxel report: a self-contained page for a browser.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace phyxel::app {

/// Settings of a page.
struct ReplayRequest {
  std::filesystem::path input;  ///< A run's folder, a series or a frame.
  double megabytes = 16;        ///< Largest size of the page [MB].
  bool stress = true;           ///< True if strains and stresses that frames lack are computed.
};

/// A page and a summary of its content.
struct Report {
  std::string html;
  std::size_t frames = 0, phyxels = 0, surfels = 0;  ///< Numbers that the page shows.
  std::vector<std::string> fields;                   ///< Names of the fields that colours can show.
  std::vector<std::string> obstacles;                ///< Names of the obstacles that are drawn.
  std::vector<std::string> notes;                    ///< What was left out, with reasons.
};

/// A page that replays a trajectory, with its energies, scene, timing and warnings.
/// @throws InputError if there is no trajectory, or if the page has no room for two frames
Report replay_page(const ReplayRequest& request);

/// The part of a trajectory that a page shows.
struct FramePlan {
  std::size_t frames = 0;
  std::size_t phyxel_stride = 1;  ///< One phyxel in this number is shown.
};
/// Chooses the frames and phyxels that fit a size.
/// @param surface_bytes,phyxel_bytes size of a frame's surface and phyxels, as text [bytes]
/// @param bytes size for all frames [bytes]
/// @throws InputError if two frames do not fit, or a trajectory's single frame
FramePlan plan_frames(std::size_t frames, double surface_bytes, double phyxel_bytes, double bytes);

}  // namespace phyxel::app
