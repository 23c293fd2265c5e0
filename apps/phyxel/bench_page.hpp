/// The page about speed, made of tables.
#pragma once

#include <filesystem>

namespace phyxel::app {

/// Reads the gpu_*.csv files of a folder, draws their figures beside them where gnuplot is, and
/// writes the page. @throws InputError, OutputError
void write_bench_page(const std::filesystem::path& results, const std::filesystem::path& page);

}  // namespace phyxel::app
