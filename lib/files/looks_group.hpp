/// `Looks` as the group /state/looks of a checkpoint: an attribute for each field.
#pragma once

#include "files/hdf5_file.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// The most steps or frames that a file may count: double counts no more exactly, and no run has
/// made more.
inline constexpr std::int64_t most_counted = std::int64_t{1} << 53;

void write_looks(Hdf5Writer& out, const Looks& looks);
/// @throws InputError, naming the file and the group, for steps that are negative or more than
///   `most_counted`, and for ratios that are not finite
Looks read_looks(const Hdf5Reader& in);

}  // namespace phyxel
