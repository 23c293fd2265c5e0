/// Whether the host has room.
#pragma once

#include <string>

namespace phyxel {

/// From now on this program counts on an equal share of the memory that so many of the host use.
void share_host_memory(int programs);

/// Memory this program may use [bytes]: the machine's, or less inside a container, and its share of
/// that.
double usable_memory();

/// The most that this program has had so far [bytes].
double peak_memory();

/// A measurement of the memory that this process takes from now on.
class MemoryGrowth {
 public:
  MemoryGrowth();
  /// The most memory in use at a time since then, less what was in use at the start [bytes].
  double largest() const;

 private:
  double before_ = 0;
};

/// @throws InputError naming `what`, how much its phyxels take, how much there is (in a container:
///   its limit), and how many would do; or if they are more than an index counts.
void require_host_memory(const std::string& what, double phyxels, double bytes_per_phyxel);

}  // namespace phyxel
