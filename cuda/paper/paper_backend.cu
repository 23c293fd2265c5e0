/// The backend of the 2008 program on a GPU: the arrays of one body and the launches of its
/// kernels.
#include <algorithm>
#include <string>
#include <type_traits>

#include "check.hpp"
#include "device.hpp"
#include "device_values.cuh"
#include "kernels.cuh"
#include "paper_backend.hpp"
#include "paper_model.hpp"
#include "phyxel/physics/laws/st_venant_kirchhoff.hpp"

namespace phyxel::paper {
namespace {

// Threads a block of the surfel kernel, which has many threads of few registers.
constexpr unsigned surfel_block = 256;

/// Copies pair forces from the matrix into slots, as those of the neighbours; unused slots are
/// zero.
template <class Real>
__global__ void copy_pair_forces(CuBody<Real> body, Real* copies) {
  const int i = thread_index(), n = body.numPhyxels;
  if (i >= n) return;
  for (int k = 0; k < body.maxNeighbors; ++k) {
    const std::size_t slot = static_cast<std::size_t>(k) * n + i;
    const int j = body.d_neighbors[slot];
    store3(copies, slot,
           j == no_neighbor ? Vec3<Real>{} : load3(body.d_forces, matrix_entry(i, j, n)));
  }
}

template <class Real>
class GpuBackend final : public PaperBackend {
  template <class T>
  using Array = DeviceArray<T>;

 public:
  GpuBackend(const Model& model, const GpuOptions& options)
      : model_(model),
        device_(use_cuda_device(options.device)),
        dense_(options.store == ForceStore::dense),
        green_(model.parts[0].material.law == StVenantKirchhoff<double>::name),
        block_(options.block),
        n_(model.size()) {
    subject_ = "body \"" + model.parts[0].name + "\", " + std::to_string(n_) + " phyxels";
    for (const double c : material_tensor(model.parts[0].material)) {
      material_.push_back(static_cast<Real>(c));
    }
    make_phyxels();
    make_neighbours();
    make_forces();
    make_surfels();
    textures_ = {positions_texture_.object(), displacements_texture_.object(),
                 omega_texture_.object(), surfel_omega_texture_.object()};
    precalculate();
  }

  std::string name() const override {
    const char* arithmetic = std::is_same_v<Real, float> ? "float" : "double";
    return "the kernels of 2008, " + std::string(arithmetic) + ", " +
           (dense_ ? "n x n force matrix" : "CSR gather") + ", on " + device_.name;
  }
  Precision precision() const override {
    return std::is_same_v<Real, float> ? Precision::single : Precision::double_;
  }
  Index size() const override { return n_; }
  int threads() const override { return 0; }

  void put(const State& state) override {
    wait();
    dt_ = state.dt;
    const std::vector<char> held = held_phyxels(model_);
    std::vector<Real> now = volumes_only(), last(3 * static_cast<std::size_t>(n_));
    for (Index i = 0; i < n_; ++i) {
      const Vec3d u = state.displacement[i];
      const Vec3d before = held[i] ? u : u - dt_ * state.velocity[i];
      set3(now, 4 * static_cast<std::size_t>(i), u);
      set3(last, 3 * static_cast<std::size_t>(i), before);
    }
    displacements_volume_.upload(now.data());
    last_displacements_.upload(last.data());
  }

  void download(State& state) const override {
    wait();
    const std::vector<Real> now = copy_of(displacements_volume_),
                            last = copy_of(last_displacements_);
    state.displacement.resize(static_cast<std::size_t>(n_));
    state.velocity.resize(static_cast<std::size_t>(n_));
    for (Index i = 0; i < n_; ++i) {
      const Vec3d u = at3(now, 4 * static_cast<std::size_t>(i));
      state.displacement[i] = u;
      const Vec3d moved = u - at3(last, 3 * static_cast<std::size_t>(i));
      state.velocity[i] = dt_ > 0 ? moved / dt_ : Vec3d{};
    }
  }

  void stress() override {
    use_material();
    const auto kernel =
        green_
            ? (dense_ ? calcStrainStressA<Real, true, true> : calcStrainStressA<Real, true, false>)
            : (dense_ ? calcStrainStressA<Real, false, true>
                      : calcStrainStressA<Real, false, false>);
    kernel<<<blocks(), block_>>>(body_, gather_, textures_);
    launched("calcStrainStressA", blocks(), block_);
  }

  void advance(double, double dt) override {
    dt_ = dt;
    sum_forces();
    const auto kernel = dense_ ? integrate<Real, true> : integrate<Real, false>;
    const Vec3<Real> gravity{static_cast<Real>(model_.gravity.x),
                             static_cast<Real>(model_.gravity.y),
                             static_cast<Real>(model_.gravity.z)};
    const Real step = static_cast<Real>(dt);
    kernel<<<blocks(), block_>>>(body_, gather_, textures_, gravity, step * step);
    launched("integrate", blocks(), block_);
  }

  void update_surfels() override {
    if (surfels_.numSurfels == 0) return;
    const unsigned blocks = (surfels_.numSurfels + surfel_block - 1) / surfel_block;
    updateSurfels<Real><<<blocks, surfel_block>>>(body_, surfels_, textures_);
    launched("updateSurfels", blocks, surfel_block);
  }

  void internal_forces(std::vector<Vec3d>& force, HistoryUse) override {
    stress();
    sum_forces();
    wait();
    force.resize(static_cast<std::size_t>(n_));
    if (dense_) {  // the diagonal of the matrix
      std::vector<Real> sums(3 * static_cast<std::size_t>(n_));
      const std::size_t width = 3 * sizeof(Real);
      PHYXEL_CUDA(cudaMemcpy2D(sums.data(), width, forces_.data(), width * (n_ + std::size_t{1}),
                               width, static_cast<std::size_t>(n_), cudaMemcpyDeviceToHost));
      for (Index i = 0; i < n_; ++i) force[i] = at3(sums, 3 * static_cast<std::size_t>(i));
    } else {
      const std::vector<Real> sums = copy_of(own_forces_);
      for (Index i = 0; i < n_; ++i) force[i] = at3(sums, 3 * static_cast<std::size_t>(i));
    }
  }

  void displacement_gradients(std::vector<Mat3d>& gradient) override {
    stress();
    wait();
    gradient = matrices(copy_of(gradui_));
  }

  void advect_surfels(SurfelState& surfels) override {
    stress();
    update_surfels();
    wait();
    const std::vector<Real> vertices = copy_of(vertex_buffer_);
    const std::size_t count = vertices.size() / 6;
    surfels.normal.resize(count);
    surfels.position.resize(count);
    for (std::size_t s = 0; s < count; ++s) {
      surfels.normal[s] = at3(vertices, 6 * s);
      surfels.position[s] = at3(vertices, 6 * s + 3);
    }
  }

  ImmutableValues immutable_values() const override {
    wait();
    ImmutableValues values;
    const std::vector<Real> omega = copy_of(omega_);
    const Csr& csr = model_.neighbourhood.neighbours;
    for (Index i = 0; i < n_; ++i) {
      for (Index k = 0; k < csr.length(i); ++k) {
        values.omega.push_back(omega[static_cast<std::size_t>(k) * n_ + i]);
      }
    }
    values.inverse_moment = matrices(copy_of(moment_matrices_));
    const std::vector<Real> now = copy_of(displacements_volume_);
    for (Index i = 0; i < n_; ++i)
      values.volume.push_back(now[4 * static_cast<std::size_t>(i) + 3]);
    return values;
  }

  std::vector<Vec3d> pair_forces() const override {
    std::vector<Vec3d> forces;
    if (!dense_) return forces;
    const Array<Real> copied(3 * neighbors_.size(), "copies of the forces of " + subject_);
    const Launch launch{"copy_pair_forces", blocks(), block_, subject_};
    copy_pair_forces<Real><<<launch.blocks, launch.threads>>>(body_, copied.data());
    check_launch(launch);
    wait_for_device(launch);
    const std::vector<Real> slots = copy_of(copied);
    for (Index i = 0; i < n_; ++i) {
      for (Index k = 0; k < model_.neighbourhood.neighbours.length(i); ++k) {
        forces.push_back(at3(slots, 3 * (static_cast<std::size_t>(k) * n_ + i)));
      }
    }
    return forces;
  }

  void wait() const override { wait_for_device(last_launch_); }

  std::vector<ArrayBytes> memory() const override {
    std::vector<ArrayBytes> list{
        {"positions, displacements, last displacements",
         positions_masses_.bytes() + displacements_volume_.bytes() + last_displacements_.bytes()},
        {"moment matrices and gradients", moment_matrices_.bytes() + gradui_.bytes()},
        {"neighbours and weights", neighbors_.bytes() + omega_.bytes()},
        {"inverse neighbours",
         inverse_offsets_.bytes() + inverse_phyxels_.bytes() + inverse_slots_.bytes()}};
    if (dense_) list.push_back({"n x n force matrix", forces_.bytes()});
    if (!dense_)
      list.push_back({"pair stresses and forces", pair_stress_.bytes() + own_forces_.bytes()});
    if (surfels_.numSurfels > 0) {
      list.push_back({"surfels", surfel_positions_.bytes() + surfel_normals_.bytes() +
                                     surfel_neighbors_.bytes() + surfel_omega_.bytes() +
                                     vertex_buffer_.bytes()});
    }
    return list;
  }

  std::size_t step_traffic() const override {
    const auto pairs = static_cast<std::size_t>(model_.neighbourhood.neighbours.entries());
    const std::size_t n = static_cast<std::size_t>(n_);
    const std::size_t per_pair = sizeof(unsigned short) + sizeof(Real);
    return pairs * (2 * per_pair + (dense_ ? 2 * 3 * sizeof(Real) : per_pair)) +
           n * (4 + 4 + 9 + 9 + 6 + 4 + 4 + 3 + 3 + 4) * sizeof(Real);
  }

 private:
  // --- set-up ---------------------------------------------------------------------------------

  void make_phyxels() {
    const auto n = static_cast<std::size_t>(n_);
    std::vector<Real> positions(4 * n), supports(n);
    for (std::size_t i = 0; i < n; ++i) {
      set3(positions, 4 * i, model_.position[i]);
      positions[4 * i + 3] = static_cast<Real>(model_.mass[i]);
    }
    const std::string of = " of " + subject_;
    positions_masses_ = {4 * n, "positions and masses" + of};
    positions_masses_.upload(positions.data());
    displacements_volume_ = {4 * n, "displacements and volumes" + of};
    displacements_volume_.upload(std::vector<Real>(4 * n).data());
    last_displacements_ = {3 * n, "last displacements" + of};
    last_displacements_.upload(std::vector<Real>(3 * n).data());
    moment_matrices_ = {9 * n, "moment matrices" + of};
    gradui_ = {9 * n, "displacement gradients" + of};
    body_.d_positions_masses = positions_masses_.data();
    body_.d_displacements_volume = displacements_volume_.data();
    body_.d_lastDisplacements = last_displacements_.data();
    body_.d_momentMatrices = moment_matrices_.data();
    body_.d_gradui = gradui_.data();
    body_.numPhyxels = n_;
    using Texels = Vector4<Real>;
    positions_texture_ = Texture::over<typename Texels::texel>(positions_masses_);
    displacements_texture_ = Texture::over<typename Texels::texel>(displacements_volume_);
  }

  void make_neighbours() {
    const Csr& csr = model_.neighbourhood.neighbours;
    body_.maxNeighbors = longest_row(csr);
    const std::vector<unsigned short> slots = slots_of(csr, body_.maxNeighbors);
    neighbors_ = {slots.size(), "neighbour lists of " + subject_};
    neighbors_.upload(slots.data());
    omega_ = {slots.size(), "weights of " + subject_};
    omega_.upload(std::vector<Real>(slots.size()).data());
    body_.d_neighbors = neighbors_.data();
    body_.d_omega = omega_.data();
    omega_texture_ = Texture::over<typename Vector4<Real>::texel1>(omega_);

    // Inverse rows are ascending, since rows are visited in order.
    std::vector<std::vector<std::pair<Index, Index>>> inverse(static_cast<std::size_t>(n_));
    for (Index i = 0; i < n_; ++i) {
      const auto row = csr.row(i);
      for (std::size_t k = 0; k < row.size(); ++k) {
        inverse[row[k]].emplace_back(i, static_cast<Index>(k));
      }
    }
    std::vector<int> offsets{0};
    std::vector<unsigned short> phyxels, slot_numbers;
    for (const auto& row : inverse) {
      for (const auto& [phyxel, slot] : row) {
        phyxels.push_back(static_cast<unsigned short>(phyxel));
        slot_numbers.push_back(static_cast<unsigned short>(slot));
      }
      offsets.push_back(static_cast<int>(phyxels.size()));
    }
    const std::string what = "inverse neighbourhood of " + subject_;
    inverse_offsets_ = {offsets.size(), what};
    inverse_offsets_.upload(offsets.data());
    inverse_phyxels_ = {phyxels.size(), what};
    inverse_phyxels_.upload(phyxels.data());
    if (!dense_) {
      inverse_slots_ = {slot_numbers.size(), what};
      inverse_slots_.upload(slot_numbers.data());
    }
    inverse_ = {inverse_offsets_.data(), inverse_phyxels_.data(), inverse_slots_.data()};
  }

  void make_forces() {
    const auto n = static_cast<std::size_t>(n_);
    if (dense_) {
      forces_ = {3 * n * n, "the n x n force matrix of " + subject_ +
                                " (the sparse matrix of section 5.2; the CSR gather needs none)"};
      body_.d_forces = forces_.data();
    } else {
      pair_stress_ = {9 * n, "pair stresses of " + subject_};
      own_forces_ = {3 * n, "forces of " + subject_};
      gather_ = {pair_stress_.data(), own_forces_.data()};
    }
  }

  void make_surfels() {
    const Surfels& surfels = model_.surfels;
    const std::size_t count = surfels.position.size();
    surfels_.numSurfels = static_cast<int>(count);
    if (count == 0) return;
    std::vector<Real> positions(3 * count), normals(3 * count);
    for (std::size_t s = 0; s < count; ++s) {
      set3(positions, 3 * s, surfels.position[s]);
      set3(normals, 3 * s, surfels.normal[s]);
    }
    surfels_.maxNeighbors = longest_row(surfels.carriers);
    const std::vector<unsigned short> slots = slots_of(surfels.carriers, surfels_.maxNeighbors);
    std::vector<Real> omega(slots.size());
    const std::vector<double> weights = surfel_weights(model_);
    for (std::size_t s = 0; s < count; ++s) {
      const Offset begin = surfels.carriers.offsets[s];
      for (Index k = 0; k < surfels.carriers.length(static_cast<Index>(s)); ++k) {
        omega[static_cast<std::size_t>(k) * count + s] = static_cast<Real>(weights[begin + k]);
      }
    }
    const std::string of = " of " + subject_;
    surfel_positions_ = {3 * count, "surfels" + of};
    surfel_positions_.upload(positions.data());
    surfel_normals_ = {3 * count, "surfel normals" + of};
    surfel_normals_.upload(normals.data());
    surfel_neighbors_ = {slots.size(), "surfel neighbours" + of};
    surfel_neighbors_.upload(slots.data());
    surfel_omega_ = {slots.size(), "surfel weights" + of};
    surfel_omega_.upload(omega.data());
    vertex_buffer_ = {6 * count, "vertex buffer" + of};
    surfels_.d_positions = surfel_positions_.data();
    surfels_.d_normals = surfel_normals_.data();
    surfels_.d_neighbors = surfel_neighbors_.data();
    surfels_.d_omega = surfel_omega_.data();
    surfels_.d_vertexBuffer = vertex_buffer_.data();
    surfel_omega_texture_ = Texture::over<typename Vector4<Real>::texel1>(surfel_omega_);
  }

  /// Computes the immutable values, and then marks fixed phyxels by mass 0.
  void precalculate() {
    const auto n = static_cast<std::size_t>(n_);
    std::vector<Real> supports;
    for (const double h : model_.neighbourhood.support) supports.push_back(static_cast<Real>(h));
    const Array<Real> device_supports(n, "supports of " + subject_);
    device_supports.upload(supports.data());
    precalcImutableValues<Real><<<blocks(), block_>>>(body_, textures_, device_supports.data());
    launched("precalcImutableValues", blocks(), block_);
    wait();
    std::vector<Real> positions = copy_of(positions_masses_);
    const std::vector<char> held = held_phyxels(model_);
    for (std::size_t i = 0; i < n; ++i) {
      if (held[i]) positions[4 * i + 3] = Real(0);
    }
    positions_masses_.upload(positions.data());
  }

  // --- launches ---------------------------------------------------------------------------------

  unsigned blocks() const { return (static_cast<unsigned>(n_) + block_ - 1) / block_; }

  void launched(const char* kernel, unsigned blocks, unsigned threads) {
    last_launch_.kernel = kernel;
    last_launch_.blocks = blocks;
    last_launch_.threads = threads;
    if (last_launch_.subject.empty()) last_launch_.subject = subject_;
    check_launch(last_launch_);
  }

  /// Puts the body's material into constant memory, in stream order, if that holds another one. Not
  /// thread-safe: one thread drives this program, as in 2008.
  void use_material() {
    static std::vector<Real> present;
    static int present_device = -1;
    if (present_device == device_.index && present == material_) return;
    const std::size_t bytes = material_.size() * sizeof(Real);
    if constexpr (std::is_same_v<Real, float>) {
      PHYXEL_CUDA(cudaMemcpyToSymbolAsync(c_material_float, material_.data(), bytes));
    } else {
      PHYXEL_CUDA(cudaMemcpyToSymbolAsync(c_material_double, material_.data(), bytes));
    }
    present = material_;
    present_device = device_.index;
  }

  void sum_forces() {
    if (dense_) {
      calcStrainStressB<Real><<<blocks(), block_>>>(body_, inverse_);
    } else {
      calcStrainStressB_csr<Real><<<blocks(), block_>>>(body_, inverse_, gather_, textures_);
    }
    launched("calcStrainStressB", blocks(), block_);
  }

  // --- values -----------------------------------------------------------------------------------

  /// The displacement array with zero displacements.
  std::vector<Real> volumes_only() const {
    std::vector<Real> now = copy_of(displacements_volume_);
    for (std::size_t k = 0; k < now.size(); ++k) {
      if (k % 4 != 3) now[k] = Real(0);
    }
    return now;
  }

  const Model& model_;
  Device device_;
  bool dense_, green_;
  unsigned block_;
  Index n_;
  double dt_ = 0;
  std::string subject_;
  std::vector<Real> material_;
  Launch last_launch_;

  CuBody<Real> body_{};
  CuInverse inverse_{};
  CuGather<Real> gather_{};
  CuSurfels<Real> surfels_{};
  CuTextures textures_{};

  Array<Real> positions_masses_, displacements_volume_, last_displacements_, moment_matrices_,
      gradui_, omega_, forces_, pair_stress_, own_forces_;
  Array<unsigned short> neighbors_, inverse_phyxels_, inverse_slots_, surfel_neighbors_;
  Array<int> inverse_offsets_;
  Array<Real> surfel_positions_, surfel_normals_, surfel_omega_, vertex_buffer_;
  Texture positions_texture_, displacements_texture_, omega_texture_, surfel_omega_texture_;
};

}  // namespace

std::unique_ptr<PaperBackend> make_gpu_backend(const Model& model, const GpuOptions& options) {
  check_paper_model(model);
  if (options.precision == Precision::double_) {
    return std::make_unique<GpuBackend<double>>(model, options);
  }
  return std::make_unique<GpuBackend<float>>(model, options);
}

}  // namespace phyxel::paper
