/// Pictures of the effect of hourglass control.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace phyxel::studies {

struct AccuracyPicture {
  std::string file;  ///< Name in the folder of the results.
  std::string what;
};
/// The pictures, in the order of the page.
const std::vector<AccuracyPicture>& accuracy_pictures();

}  // namespace phyxel::studies
