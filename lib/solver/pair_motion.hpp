/// How far the phyxels of pairs have moved apart at most, without a look at the pairs.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "phyxel/physics/pair_motion.hpp"
#include "solver/cpu_layout.hpp"

namespace phyxel {

/// An upper bound of the change of the lengths of pairs, added up over steps, for blocks of packs
/// (physics/pair_motion.hpp).
template <class Real>
class PairMotion {
 public:
  /// @param lists the pairs, of which some phyxel is in the pack. Bodies whose entry of `follows`
  /// is false are left out
  PairMotion(const Model& model, const Layout& layout, const PackedLists& lists,
             const std::vector<char>& follows, int threads)
      : width_(layout.width()),
        threads_(threads),
        body_(static_cast<std::size_t>(layout.packs()), -1),
        length_(body_.size(), 0),
        before_(static_cast<std::size_t>(layout.slots()) * 3, Real(0)),
        now_(before_),
        omega_(follows.size()) {
    for (const Part& part : model.parts) {
      if (!follows[static_cast<std::size_t>(part.body)]) continue;
      for (Index i = part.begin; i < part.end; ++i) {
        const Index pack = layout.slot(i) / width_;
        body_[pack] = part.body;
        ++length_[pack];
      }
    }
    find_neighbours(lists);
    boxes_.resize(neighbours_.size());
    apart_.assign(neighbours_.size(), 0);
  }

  /// True if the pairs of a pack are followed.
  bool follows(Index pack) const { return body_[pack] >= 0; }
  /// The bound for the pairs of a pack, since `start` [m].
  double apart(Index pack) const { return apart_[pack / block_packs]; }
  /// The displacement of a slot at the start of the last step.
  const Real* before(Index slot) const { return &before_[static_cast<std::size_t>(slot) * 3]; }
  std::size_t bytes() const {
    std::size_t bytes =
        2 * before_.size() * sizeof(Real) + body_.size() * (sizeof(body_[0]) + sizeof(length_[0]));
    for (const auto& of_block : neighbours_) bytes += of_block.size() * sizeof(Index);
    return bytes + boxes_.size() * (sizeof(boxes_[0]) + sizeof(apart_[0]));
  }

  /// Begins anew from the present displacements. @param record record(slot) points to the position
  /// of a slot at rest, and from the fifth number on to its displacement
  template <class RecordOf>
  void start(const RecordOf& record) {
    measure(record);
    std::swap(before_, now_);
    std::fill(apart_.begin(), apart_.end(), 0);
    std::fill(omega_.begin(), omega_.end(), Vec3d{});
  }
  /// Adds the step that has led to the present displacements. `before` stays until `end_step`.
  template <class RecordOf>
  void measure(const RecordOf& record) {
    const auto blocks = static_cast<Index>(boxes_.size());
#pragma omp parallel num_threads(threads_)
    {
#pragma omp for schedule(static)
      for (Index b = 0; b < blocks; ++b) boxes_[b] = box_of(b, record);
#pragma omp for schedule(static)
      for (Index b = 0; b < blocks; ++b) {
        MotionBox<Real> around;
        for (const Index other : neighbours_[b]) around.add(boxes_[other]);
        apart_[b] += around.diagonal();
      }
    }
    find_turning(record);
  }
  void end_step() { std::swap(before_, now_); }

 private:
  static constexpr Index block_packs = 8;
  static constexpr int displacement = 4;  // place in a record

  /// Finds the blocks that the pairs of each block reach.
  void find_neighbours(const PackedLists& lists) {
    const auto packs = static_cast<Index>(body_.size());
    neighbours_.resize(static_cast<std::size_t>((packs + block_packs - 1) / block_packs));
    const auto blocks = static_cast<Index>(neighbours_.size());
#pragma omp parallel for schedule(static) num_threads(threads_)
    for (Index b = 0; b < blocks; ++b) {
      std::vector<Index>& all = neighbours_[b];
      for (Index p = b * block_packs; p < std::min(packs, (b + 1) * block_packs); ++p) {
        if (body_[p] < 0) continue;
        for (Offset k = lists.start[p]; k < lists.start[p + 1]; ++k) {
          const Index other = lists.indices[static_cast<std::size_t>(k)] / width_ / block_packs;
          if (all.empty() || all.back() != other) all.push_back(other);
        }
      }
      std::sort(all.begin(), all.end());
      all.erase(std::unique(all.begin(), all.end()), all.end());
      all.shrink_to_fit();
    }
  }

  template <class RecordOf>
  MotionBox<Real> box_of(Index b, const RecordOf& record) {
    MotionBox<Real> box;
    const auto packs = static_cast<Index>(body_.size());
    for (Index p = b * block_packs; p < std::min(packs, (b + 1) * block_packs); ++p) {
      if (body_[p] < 0) continue;
      const Vec3d turning = omega_[static_cast<std::size_t>(body_[p])];
      const Vec3<Real> omega{static_cast<Real>(turning.x), static_cast<Real>(turning.y),
                             static_cast<Real>(turning.z)};
      for (Index slot = p * width_; slot < p * width_ + length_[p]; ++slot) {
        const Real* x = record(slot);
        const Real* u = x + displacement;
        Real* now = &now_[static_cast<std::size_t>(slot) * 3];
        const Real* old = &before_[static_cast<std::size_t>(slot) * 3];
        box.add(vector(x), vector(old), vector(u), omega);
        std::copy_n(u, 3, now);
      }
    }
    return box;
  }

  /// Finds how each body has turned in the last step, from some of its phyxels.
  template <class RecordOf>
  void find_turning(const RecordOf& record) {
    std::vector<TurningSums> sums(omega_.size());
    constexpr Index samples = 512;
    const auto packs = static_cast<Index>(body_.size());
    for (Index p = 0; p < packs; p += packs / samples + 1) {
      if (body_[p] < 0) continue;
      const Index slot = p * width_;
      const Real* x = record(slot);
      const Vec3d u = to<double>(vector(x + displacement)), old = to<double>(vector(before(slot)));
      sums[static_cast<std::size_t>(body_[p])].add(to<double>(vector(x)) + 0.5 * (old + u),
                                                   u - old);
    }
    for (std::size_t b = 0; b < sums.size(); ++b) omega_[b] = sums[b].turning();
  }
  static Vec3<Real> vector(const Real* at) { return {at[0], at[1], at[2]}; }

  Index width_;
  int threads_;
  std::vector<Index> body_;           // of the scene, of each pack; -1 where pairs are not followed
  std::vector<Index> length_;         // phyxels of each pack
  AlignedVector<Real> before_, now_;  // displacements at both ends of a step, by slot
  std::vector<Vec3d> omega_;  // turning in the next step of each body, guessed from the last
  std::vector<std::vector<Index>> neighbours_;  // of each block, by number, itself included
  std::vector<MotionBox<Real>> boxes_;          // of each block
  std::vector<double> apart_;                   // likewise
};

}  // namespace phyxel
