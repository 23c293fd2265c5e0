/// What hourglass control is for, to look at.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace phyxel::app {

struct AccuracyPicture {
  std::string file;  ///< In the results' folder.
  std::string what;
};
/// In the order in which a page shows them.
const std::vector<AccuracyPicture>& accuracy_pictures();

/// Lets the bar swing and draws it. @throws OutputError
void draw_accuracy_pictures(const std::filesystem::path& folder);

}  // namespace phyxel::app
