/// The time that a family of discretisations needs to reach an error.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "csv.hpp"

namespace phyxel::app {

/// A discretisation of a family, which differ in resolution alone.
struct Measured {
  int across = 0;      ///< Cells across the thinner sides.
  double error = 0;    ///< Relative to the known answer, with its sign.
  double seconds = 0;  ///< Time that it takes.
};

/// The largest error of each resolution and of all finer ones: an error that is small because it
/// changes its sign there does not count. @param family ascending resolutions
std::vector<double> lasting_errors(std::span<const Measured> family);

/// A place on the way from one resolution to the next.
struct Reached {
  double across = 0, seconds = 0;
};

/// Where the lasting errors of a family come down to a level: between two resolutions time and
/// resolution are taken as powers of the error. None if they do not, or only at the finest
/// resolution, beyond which nothing tells whether the error lasts.
std::optional<Reached> reach(std::span<const Measured> family, double level);

/// The columns of the table of all settings that `bench error` writes.
const std::vector<std::string>& error_columns();
/// The columns of the table of the fastest ones.
const std::vector<std::string>& fastest_columns();

/// The fastest setting for each problem, kind of cloud, kind of run ("rest" or "steps") and level:
/// rows of `fastest_columns`. The problem "all" is the worst of all problems.
/// @param measured a table with `error_columns`. @param levels errors to reach [%]
/// @throws InputError for a table that lacks a column, or a cell that is no number
std::vector<std::vector<std::string>> fastest_settings(const CsvTable& measured,
                                                       std::span<const double> levels);

}  // namespace phyxel::app
