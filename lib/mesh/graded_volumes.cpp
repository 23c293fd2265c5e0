#include "mesh/graded_volumes.hpp"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "mesh/nearest_site.hpp"
#include "mesh/rooms.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// Least number of sample points along a spacing.
constexpr double samples_along = 5;

/// The points of a room that have about the spacings of an octave.
struct OctavePoints {
  std::vector<std::size_t> index;  ///< Indices of the points, ascending.
  std::vector<Vec3d> place;        ///< [m]
  std::optional<NearestSite> search;
};

/// Searches of the points nearest to sample points, one for each octave of the spacing in each
/// room.
class Octaves {
 public:
  Octaves(const std::vector<Vec3d>& point, const Rooms& rooms, const SpacingField& spacing)
      : spacing_(spacing),
        count_(1 + static_cast<int>(std::log2(spacing.coarsest() / spacing.finest()) * (1 + 1e-9))),
        of_room_(rooms.size()) {
    // A block and the points nearest to its samples are within 1.6 spacings of its middle, and in
    // two directions at once the spacing may change faster.
    const double change = std::min(0.75, 1.6 * std::numbers::sqrt2 * spacing.growth());
    const std::vector<double> size = spacing.at(point);
    for (std::size_t room = 0; room < rooms.size(); ++room) {
      of_room_[room].resize(static_cast<std::size_t>(count_));
      for (int octave = 0; octave < count_; ++octave) {
        OctavePoints& near = of_room_[room][static_cast<std::size_t>(octave)];
        const double smallest = std::ldexp(spacing.finest(), octave);
        for (const std::size_t k : rooms.points_in(room)) {
          if (size[k] < (1 - change) * smallest || size[k] > 2 * (1 + change) * smallest) continue;
          near.index.push_back(k);
          near.place.push_back(point[k]);
        }
        if (!near.place.empty()) near.search.emplace(near.place, smallest);
      }
    }
  }

  /// The points of a room that may be nearest to samples of a block with a spacing in its middle.
  const OctavePoints& of(std::size_t room, double spacing) const {
    const int octave = std::clamp(std::ilogb(spacing / spacing_.finest()), 0, count_ - 1);
    return of_room_[room][static_cast<std::size_t>(octave)];
  }

 private:
  const SpacingField& spacing_;
  int count_;
  std::vector<std::vector<OctavePoints>> of_room_;
};

/// Numbers of voxels that belong to each point, in units of the smallest voxel.
class VoxelCount {
 public:
  VoxelCount(const Rooms& rooms, const Octaves& octaves, const SpacingField& spacing,
             double smallest, std::size_t points)
      : rooms_(rooms),
        octaves_(octaves),
        spacing_(spacing),
        smallest_(smallest),
        count_(points, 0),
        work_(static_cast<std::size_t>(omp_get_max_threads())) {}

  /// Adds the voxels of a block, on one of many threads.
  void add(const SampleBlock& block) {
    const double spacing = spacing_.at(block.centre);
    if (rooms_.size() == 1) {
      add(block, octaves_.of(0, spacing));
      return;
    }
    const double radius = 0.5 * block.region_radius;
    for (std::size_t room = 0; room < rooms_.size(); ++room) {
      if (!rooms_.may_reach(room, block.centre, radius)) continue;
      SampleBlock part = block;
      std::erase_if(part.offset, [&](Vec3<float> offset) {
        return rooms_.room_of(block.centre + to<double>(offset)) != room;
      });
      if (!part.offset.empty()) add(part, octaves_.of(room, spacing));
    }
  }

  const std::vector<std::uint64_t>& count() const { return count_; }

 private:
  /// Work space of a thread.
  struct Work {
    NearestSite::Scratch scratch;
    const OctavePoints* last = nullptr;  ///< The points that were searched last.
  };

  void add(const SampleBlock& block, const OctavePoints& near) {
    if (!near.search) return;
    Work& work = work_[static_cast<std::size_t>(omp_get_thread_num())];
    NearestSite::Scratch& scratch = work.scratch;
    // What a search found for a region is of no use to another search.
    if (work.last != &near) scratch.region = {NAN, NAN, NAN};
    work.last = &near;
    near.search->find(block, scratch);
    const auto doubled =
        static_cast<std::uint64_t>(std::lround(std::log2(block.voxel / smallest_)));
    const std::uint64_t of_one = std::uint64_t{1} << 3 * doubled;
    // Samples of a point mostly follow one another.
    const std::vector<Index>& owner = scratch.owner;
    for (std::size_t k = 0; k < owner.size();) {
      const Index point = owner[k];
      std::uint64_t voxels = 0;
      for (; k < owner.size() && owner[k] == point; ++k) voxels += of_one;
#pragma omp atomic
      count_[near.index[static_cast<std::size_t>(point)]] += voxels;
    }
  }

  const Rooms& rooms_;
  const Octaves& octaves_;
  const SpacingField& spacing_;
  double smallest_;  ///< Side of the smallest voxels [m].
  std::vector<std::uint64_t> count_;
  std::vector<Work> work_;  ///< One for each thread.
};

}  // namespace

std::vector<double> graded_volumes(const InsideSampler& sampler, const std::vector<Vec3d>& point,
                                   const SupportCuts& cuts, const SpacingField& spacing,
                                   std::uint64_t seed, Stage& stage) {
  const Rooms rooms(cuts, point);
  const Octaves octaves(point, rooms, spacing);
  const double smallest = spacing.finest() / samples_along;
  VoxelCount voxels(rooms, octaves, spacing, smallest, point.size());
  const auto coarse = [&](Vec3d middle, double half) {
    return 0.5 * half * samples_along <= spacing.at(middle);
  };
  sampler.visit(
      {.voxel = smallest, .seed = seed, .coarse = coarse},
      [&](std::size_t, const SampleBlock& block) { voxels.add(block); }, &stage);
  std::vector<double> volume = spacing.at(point);
  for (std::size_t k = 0; k < point.size(); ++k) {
    volume[k] = std::max(static_cast<double>(voxels.count()[k]) * std::pow(smallest, 3),
                         0.5 * std::pow(volume[k] / samples_along, 3));
  }
  return volume;
}

}  // namespace phyxel
