/// The numbering of phyxels in the CPU backend. Each body starts at a multiple of the SIMD width,
/// and so do the boundary, interior and ghosts of a share, so that a pack never mixes two of them.
/// Neighbour lists are stored pack by pack.
#pragma once

#include <algorithm>
#include <cstddef>
#include <new>
#include <vector>

#include "huge_pages.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// A std::vector aligned to cache lines, and so for SIMD; large ones are in huge pages.
template <class T>
struct AlignedAllocator {
  using value_type = T;
  static constexpr std::align_val_t alignment{128};
  AlignedAllocator() = default;
  template <class U>
  explicit AlignedAllocator(const AlignedAllocator<U>&) {}
  T* allocate(std::size_t n) {
    const std::size_t bytes = n * sizeof(T);
    if (bytes < least_huge) return static_cast<T*>(::operator new(bytes, alignment));
    void* memory = allocate_huge(bytes);
    if (!memory) throw std::bad_alloc();
    return static_cast<T*>(memory);
  }
  void deallocate(T* p, std::size_t n) {
    if (n * sizeof(T) < least_huge) return ::operator delete(p, alignment);
    std::free(p);
  }
  template <class U>
  bool operator==(const AlignedAllocator<U>&) const {
    return true;
  }
};
template <class T>
using AlignedVector = std::vector<T, AlignedAllocator<T>>;

/// One body's packs [begin, end), each of `width` slots.
struct PackRange {
  Index begin = 0, end = 0;
};

/// Returns true for each phyxel of a share that another rank has as a ghost or that has a ghost in
/// its lists, shape [n]. Empty if the model is not a share.
inline std::vector<char> boundary_phyxels(const Model& model) {
  if (!model.share) return {};
  std::vector<char> boundary(static_cast<std::size_t>(model.size()), 0);
  for (const HaloPlan::Peer& peer : model.share->halo->peers) {
    for (const Index i : peer.send) boundary[i] = 1;
  }
  const auto reaches_ghosts = [&](const Csr& lists, Index i) {
    const auto row = lists.row(i);
    return std::any_of(row.begin(), row.end(), [&](Index j) { return !model.owns(j); });
  };
#pragma omp parallel for schedule(static)
  for (Index i = 0; i < model.size(); ++i) {
    if (!model.owns(i) || boundary[i]) continue;
    boundary[i] = reaches_ghosts(model.neighbourhood.neighbours, i) ||
                  reaches_ghosts(model.neighbourhood.inverse(), i);
  }
  return boundary;
}

/// Slots are phyxels renumbered so that each group fills whole packs: first the boundary of all
/// bodies, then their interior, then their ghosts. Slots past the end of a group are padding: they
/// have only themselves as neighbours, and neither volume nor mass.
class Layout {
 public:
  /// Numbers the slots of a model. @param boundary result of `boundary_phyxels`; if empty, all
  /// phyxels are interior. @param width lanes of a pack
  Layout(const Model& model, const std::vector<char>& boundary, int width)
      : width_(width), slot_(static_cast<std::size_t>(model.size())) {
    const auto is_boundary = [&](Index i) { return !boundary.empty() && boundary[i]; };
    for (const Part& part : model.parts) {
      boundary_.push_back(add(part.begin, part.owned_end(), is_boundary));
    }
    for (const Part& part : model.parts) {
      interior_.push_back(
          add(part.begin, part.owned_end(), [&](Index i) { return !is_boundary(i); }));
    }
    for (const Part& part : model.parts) {
      add(part.owned_end(), part.end, [](Index) { return true; });
    }
  }

  int width() const { return width_; }
  Index packs() const { return packs_; }
  Index slots() const { return packs_ * width_; }
  Index slot(Index phyxel) const { return slot_[phyxel]; }
  const Index* slot_of_phyxel() const { return slot_.data(); }
  /// Packs of a part's own phyxels that exchange values with other ranks.
  const PackRange& boundary(std::size_t part) const { return boundary_[part]; }
  /// Packs of a part's other own phyxels.
  const PackRange& interior(std::size_t part) const { return interior_[part]; }

 private:
  template <class Wanted>
  PackRange add(Index begin, Index end, Wanted&& wanted) {
    const Index first = packs_;
    Index count = 0;
    for (Index i = begin; i < end; ++i) {
      if (wanted(i)) slot_[i] = first * width_ + count++;
    }
    packs_ += (count + width_ - 1) / width_;
    return {first, packs_};
  }

  int width_;
  Index packs_ = 0;
  std::vector<PackRange> boundary_, interior_;
  std::vector<Index> slot_;
};

/// Neighbour lists in packs ("sliced ELLPACK"): entry k of the `width` phyxels of pack p stands at
/// indices[start[p] + k * width ...]. Short rows are filled with the phyxel itself, whose term in
/// every sum is exactly zero (x_ii = 0, u_ii = 0).
struct PackedLists {
  std::vector<Offset> start;  ///< shape [packs + 1]
  AlignedVector<Index> indices;

  PackedLists() = default;
  PackedLists(const Csr& csr, const Layout& layout) {
    const int width = layout.width();
    std::vector<Index> phyxel(static_cast<std::size_t>(layout.slots()), -1);
    for (Index i = 0; i < csr.rows(); ++i) phyxel[layout.slot(i)] = i;
    start.assign(static_cast<std::size_t>(layout.packs()) + 1, 0);
    for (Index p = 0; p < layout.packs(); ++p) {
      Index longest = 0;
      for (int l = 0; l < width; ++l) {
        const Index i = phyxel[p * width + l];
        if (i >= 0) longest = std::max(longest, csr.length(i));
      }
      start[p + 1] = start[p] + Offset{longest} * width;
    }
    indices.resize(static_cast<std::size_t>(start.back()));
#pragma omp parallel for schedule(static)
    for (Index p = 0; p < layout.packs(); ++p) {
      const auto longest = static_cast<Index>((start[p + 1] - start[p]) / width);
      for (int l = 0; l < width; ++l) {
        const Index slot = p * width + l, i = phyxel[slot];
        const Index length = i >= 0 ? csr.length(i) : 0;
        for (Index k = 0; k < longest; ++k) {
          indices[start[p] + Offset{k} * width + l] =
              k < length ? layout.slot(csr.row(i)[k]) : slot;
        }
      }
    }
  }
  std::size_t bytes() const {
    return start.size() * sizeof(Offset) + indices.size() * sizeof(Index);
  }
};

}  // namespace phyxel
