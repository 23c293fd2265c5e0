/// Energies that contact takes from the motion, over time, from the log of contacts of a run.
#pragma once

#include <filesystem>
#include <string>
#include <unordered_map>

namespace phyxel::app {

/// Energy lost in contact since t = 0, summed over all obstacles and bodies [J].
struct ContactLosses {
  double friction_heat = 0, impact_loss = 0;
};

/// Reads contacts.csv of a run: the losses by time, as its text there. Numbers of steps recur where
/// the step changes. A line that is being written is skipped. @throws InputError if a column is
/// missing
std::unordered_map<std::string, ContactLosses> read_contact_losses(
    const std::filesystem::path& file);

}  // namespace phyxel::app
