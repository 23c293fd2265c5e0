/// The program of Farias et al. 2008: its kernels on a GPU, and the sequential C++ program that
/// they were compared with. docs/paper.md explains each choice.
///
/// The two are independent of the production solver. Both take a `Model` of one body made by
/// `paper_model`, or one that `check_paper_model` accepts.
#pragma once

#include <memory>
#include <vector>

#include "phyxel/backend.hpp"

namespace phyxel::paper {

/// A backend that exposes intermediate results of its kernels for verification.
class PaperBackend : public Backend {
 public:
  /// The results of precalcImutableValues.
  struct ImmutableValues {
    std::vector<double> omega;  ///< Weights ω_ij [1/m³] in the order of the neighbour lists.
    std::vector<Mat3d> inverse_moment;  ///< A⁻¹ with those weights [m], shape [n].
    std::vector<double> volume;         ///< v [m³], shape [n].
  };
  virtual ImmutableValues immutable_values() const = 0;

  /// The force of each phyxel on each of its neighbours [N] in the order of the neighbour lists, as
  /// calcStrainStressA stored them in the n×n matrix in the last `stress()`. Empty for the CSR
  /// gather, which does not store them.
  virtual std::vector<Vec3d> pair_forces() const = 0;

  /// Runs calcStrainStressA: gradients, stresses and forces on neighbours from displacements.
  virtual void stress() = 0;
  /// Runs calcStrainStressB and integrate: sums forces and takes a step of `dt` [s].
  virtual void advance(double time, double dt) = 0;
  void step(std::int64_t first, double dt, int count, bool move_surfels) override {
    for (int s = 0; s < count; ++s) {
      stress();
      advance(static_cast<double>(first + s) * dt, dt);
      if (move_surfels) update_surfels();
    }
  }

  /// Runs updateSurfels, which fills the vertex buffer from the present displacements and the
  /// gradients of the last `stress()`. `advect_surfels` calls both and copies the buffer to the
  /// host.
  void update_surfels() override = 0;
};

/// Largest number of phyxels for `unsigned short` neighbour indices; 65,535 marks an empty slot.
inline constexpr Index most_phyxels = 65535;

/// How calcStrainStressA passes forces to calcStrainStressB.
enum class ForceStore {
  dense,  ///< By the paper's n×n matrix of forces.
  csr,    ///< By a pair stress for each phyxel, gathered over the compressed inverse neighbourhood;
          ///< sums have the same order, and results the same bits.
};

struct GpuOptions {
  Precision precision = Precision::single;  ///< `single` as in the paper, or `double_`.
  ForceStore store = ForceStore::dense;
  int device = 0;
  unsigned block = 64;  ///< Threads a block of the phyxel kernels.
};

/// Makes the backend of section 5 on a GPU.
/// @throws InputError for a model that the 2008 program could not run; DeviceError
std::unique_ptr<PaperBackend> make_gpu_backend(const Model& model, const GpuOptions& options = {});

/// Makes the sequential program of section 5, which visits one phyxel after the other and adds its
/// forces to its neighbours. `Real` is float, double or long double; long double is the reference
/// for rounding. @throws InputError for a model that the 2008 program could not run
template <class Real>
std::unique_ptr<PaperBackend> make_sequential_backend(const Model& model);

}  // namespace phyxel::paper
