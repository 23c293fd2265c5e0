/// The program of Farias et al. 2008, as an artefact: its kernels on the GPU, and the sequential
/// C++ program that they were compared with. See docs/paper.md for every choice.
///
/// Kept apart from the production solver on purpose. Both take a `Model` of one body made by
/// `paper_model` (or one that `check_paper_model` lets pass).
#pragma once

#include <memory>
#include <vector>

#include "phyxel/backend.hpp"

namespace phyxel::paper {

/// A backend that also shows what its kernels made, for proofs.
class PaperBackend : public Backend {
 public:
  /// What precalcImutableValues computes, once.
  struct ImmutableValues {
    std::vector<double> omega;  ///< Full weights ω_ij [1/m³] in the order of the neighbour lists.
    std::vector<Mat3d> inverse_moment;  ///< A⁻¹ with those weights [m], shape [n].
    std::vector<double> volume;         ///< v [m³], shape [n].
  };
  virtual ImmutableValues immutable_values() const = 0;

  /// What calcStrainStressA stored in the n×n matrix by the last `stress()`: the force of each
  /// phyxel on each of its neighbours [N], in the order of the neighbour lists. Empty for the CSR
  /// gather, which stores none.
  virtual std::vector<Vec3d> pair_forces() const = 0;

  /// calcStrainStressA: displacements -> gradients -> stresses -> forces on each neighbour.
  virtual void stress() = 0;
  /// calcStrainStressB and updatePositions: sums forces, and takes a step of `dt` [s].
  virtual void advance(double time, double dt) = 0;
  void step(std::int64_t first, double dt, int count, bool move_surfels) override {
    for (int s = 0; s < count; ++s) {
      stress();
      advance(static_cast<double>(first + s) * dt, dt);
      if (move_surfels) update_surfels();
    }
  }

  /// updateSurfels: fills the vertex buffer from the present displacements and the gradients of
  /// the last `stress()`. `advect_surfels` does both and copies the buffer to the host.
  void update_surfels() override = 0;
};

/// Most phyxels that `unsigned short` neighbour indices can name; 65,535 marks an empty slot.
inline constexpr Index most_phyxels = 65535;

/// How calcStrainStressA hands forces to calcStrainStressB.
enum class ForceStore {
  dense,  ///< The paper's n×n matrix, three numbers a pair.
  csr,    ///< One matrix a phyxel, gathered over compressed rows of the inverse neighbourhood; sums
          ///< in the same order and so gives the same bits.
};

struct GpuOptions {
  Precision precision = Precision::single;  ///< `single` as in the paper, or `double_`.
  ForceStore store = ForceStore::dense;
  int device = 0;
  unsigned block = 64;  ///< Threads a block of the phyxel kernels.
};

/// The kernels of section 5 on a GPU.
/// @throws InputError for a model that the 2008 program could not have run; DeviceError.
std::unique_ptr<PaperBackend> make_gpu_backend(const Model& model, const GpuOptions& options = {});

/// The sequential program of section 5: one phyxel after the other, each pushing its neighbours.
/// `Real` is float, double or long double; in long double it is the reference for rounding.
/// @throws InputError as above.
template <class Real>
std::unique_ptr<PaperBackend> make_sequential_backend(const Model& model);

}  // namespace phyxel::paper
