/// phyxel info --partition: how a scene would be cut into parts, and what they would exchange.
#pragma once

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace phyxel::app {

/// Every partitioner's quality, on phyxels and on the tiles that a GPU keeps whole, and the halo
/// plan of each part by `partitioner` on tiles.
/// @param progress stream for the stages of set-up; null: none is shown
/// @throws InputError if the file is no scene, or the partitioner unknown
nlohmann::ordered_json partition_facts(const std::filesystem::path& scene, int parts,
                                       const std::string& partitioner, std::FILE* progress);

/// The same as two tables.
std::string partition_tables(const nlohmann::ordered_json& facts);

}  // namespace phyxel::app
