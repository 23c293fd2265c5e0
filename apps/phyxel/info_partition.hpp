/// phyxel info --partition: partitions of a scene and their communication.
#pragma once

#include <cstdio>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace phyxel::app {

/// The quality of each partitioner on phyxels and on the tiles of a GPU, and the halo of each part
/// by `partitioner` on tiles.
/// @param progress stream for the stages of set-up; null for none
/// @throws InputError if the file is not a scene, or for an unknown partitioner
nlohmann::ordered_json partition_facts(const std::filesystem::path& scene, int parts,
                                       const std::string& partitioner, std::FILE* progress);

/// The facts as two tables.
std::string partition_tables(const nlohmann::ordered_json& facts);

}  // namespace phyxel::app
