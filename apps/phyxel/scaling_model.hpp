/// What steps would take on more GPUs than were measured.
#pragma once

#include <string>
#include <vector>

#include "csv.hpp"

namespace phyxel::app {

/// A section of the page of scaling: a model of a step's time fitted to tables of `bench scaling`
/// on GPUs, and what it says of up to 1,024. Empty if there is too little to fit.
/// @param sizes table of `bench step` over bodies of many sizes on one GPU
std::string scaling_model(const std::vector<CsvTable>& tables, const CsvTable& sizes);

}  // namespace phyxel::app
