/// What hourglass control is for, to look at.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace phyxel::studies {

struct AccuracyPicture {
  std::string file;  ///< In the results' folder.
  std::string what;
};
/// In the order in which a page shows them.
const std::vector<AccuracyPicture>& accuracy_pictures();

}  // namespace phyxel::studies
