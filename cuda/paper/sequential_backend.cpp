/// The sequential program that Farias et al. 2008 compared with, on one core. Weights, moments and
/// neighbours are computed in advance (section 5). Each phyxel adds its forces to its neighbours,
/// so neither the n×n matrix nor the inverse neighbourhood is needed.
#include <fmt/format.h>

#include <type_traits>

#include "paper_backend.hpp"
#include "paper_model.hpp"
#include "phyxel/physics/force.hpp"
#include "phyxel/physics/laws/st_venant_kirchhoff.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/physics/surfel.hpp"
#include "phyxel/physics/weight.hpp"

namespace phyxel::paper {
namespace {

template <class Real>
Vec3<Real> to(Vec3d v) {
  return {static_cast<Real>(v.x), static_cast<Real>(v.y), static_cast<Real>(v.z)};
}
template <class Real>
Vec3d to_double(Vec3<Real> v) {
  return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

template <class Real>
class SequentialBackend final : public PaperBackend {
  using V = Vec3<Real>;
  using M = Mat3<Real>;

 public:
  explicit SequentialBackend(const Model& model)
      : model_(model), hooke_{Real(0), Real(0)}, held_(held_phyxels(model)) {
    const Material& material = model.parts[0].material;
    hooke_ = {static_cast<Real>(material.lame_lambda()), static_cast<Real>(material.lame_mu())};
    const auto n = static_cast<std::size_t>(model.size());
    for (const Vec3d& x : model.position) position_.push_back(to<Real>(x));
    displacement_.resize(n);
    last_.resize(n);
    force_.resize(n);
    gradient_.resize(n);
    prepare();
    for (const Vec3d& x : model.surfels.position) surfel_position_.push_back(to<Real>(x));
    for (const Vec3d& x : model.surfels.normal) surfel_normal_.push_back(to<Real>(x));
    for (const double w : surfel_weights(model)) surfel_omega_.push_back(static_cast<Real>(w));
    vertex_.resize(2 * surfel_position_.size());
  }

  std::string name() const override {
    const char* arithmetic = std::is_same_v<Real, float>    ? "float"
                             : std::is_same_v<Real, double> ? "double"
                                                            : "long double";
    return fmt::format("the sequential program of 2008, {}, 1 thread", arithmetic);
  }
  /// `double_` in long double, too.
  Precision precision() const override {
    return std::is_same_v<Real, float> ? Precision::single : Precision::double_;
  }
  Index size() const override { return model_.size(); }
  int threads() const override { return 1; }

  void put(const State& state) override {
    dt_ = state.dt;
    for (Index i = 0; i < size(); ++i) {
      displacement_[i] = to<Real>(state.displacement[i]);
      last_[i] = held_[i] ? displacement_[i]
                          : displacement_[i] - static_cast<Real>(dt_) * to<Real>(state.velocity[i]);
    }
  }

  void download(State& state) const override {
    state.displacement.clear();
    state.velocity.clear();
    for (Index i = 0; i < size(); ++i) {
      state.displacement.push_back(to_double(displacement_[i]));
      const Vec3d moved = to_double(displacement_[i] - last_[i]);
      state.velocity.push_back(dt_ > 0 ? moved / dt_ : Vec3d{});
    }
  }

  void stress() override {
    std::fill(force_.begin(), force_.end(), V{});
    for_law([&](const auto& law) {
      for (Index i = 0; i < size(); ++i) {
        gradient_[i] = gradient_of(i);
        for_each_push(law, i, [&](Index j, V push) {
          force_[j] += push;
          force_[i] -= push;
        });
      }
    });
  }

  void advance(double, double dt) override {
    dt_ = dt;
    const Real dt_squared = static_cast<Real>(dt) * static_cast<Real>(dt);
    const V gravity = to<Real>(model_.gravity);
    for (Index i = 0; i < size(); ++i) {
      if (held_[i]) continue;
      const V acceleration = force_[i] / mass_[i] + gravity;
      const V u = displacement_[i];
      displacement_[i] = u + ((u - last_[i]) + dt_squared * acceleration);
      last_[i] = u;
    }
  }

  void internal_forces(std::vector<Vec3d>& force, HistoryUse) override {
    stress();
    force.clear();
    for (const V& f : force_) force.push_back(to_double(f));
  }

  void displacement_gradients(std::vector<Mat3d>& gradient) override {
    stress();
    gradient.assign(gradient_.size(), {});
    for (std::size_t i = 0; i < gradient_.size(); ++i) {
      for (int e = 0; e < 9; ++e) {
        gradient[i](e / 3, e % 3) = static_cast<double>(gradient_[i](e / 3, e % 3));
      }
    }
  }

  void update_surfels() override {
    const Csr& carriers = model_.surfels.carriers;
    for (std::size_t s = 0; s < surfel_position_.size(); ++s) {
      SurfelBlend<Real> blend;
      for (Offset k = carriers.offsets[s]; k < carriers.offsets[s + 1]; ++k) {
        const Index i = carriers.indices[k];
        blend.add(surfel_omega_[k], displacement_[i], gradient_[i],
                  surfel_position_[s] - position_[i]);
      }
      const V normal = blend.surfel_normal(surfel_normal_[s]);
      vertex_[2 * s] = (Real(1) / std::sqrt(dot(normal, normal))) * normal;
      vertex_[2 * s + 1] = surfel_position_[s] + blend.surfel_displacement();
    }
  }

  void advect_surfels(SurfelState& surfels) override {
    stress();
    update_surfels();
    surfels.normal.resize(surfel_position_.size());
    surfels.position.resize(surfel_position_.size());
    for (std::size_t s = 0; s < surfel_position_.size(); ++s) {
      surfels.normal[s] = to_double(vertex_[2 * s]);
      surfels.position[s] = to_double(vertex_[2 * s + 1]);
    }
  }

  ImmutableValues immutable_values() const override {
    ImmutableValues values;
    for (const Real w : omega_) values.omega.push_back(static_cast<double>(w));
    for (const Real v : volume_) values.volume.push_back(static_cast<double>(v));
    for (const Sym3<Real>& a : inverse_moment_) {
      const M m = full(a);
      Mat3d& out = values.inverse_moment.emplace_back();
      for (int e = 0; e < 9; ++e) out(e / 3, e % 3) = static_cast<double>(m(e / 3, e % 3));
    }
    return values;
  }
  /// Evaluates the pair forces, which this program does not store.
  std::vector<Vec3d> pair_forces() const override {
    std::vector<Vec3d> forces;
    for_law([&](const auto& law) {
      for (Index i = 0; i < size(); ++i) {
        for_each_push(law, i, [&](Index, V push) { forces.push_back(to_double(push)); });
      }
    });
    return forces;
  }

  std::vector<ArrayBytes> memory() const override {
    const std::size_t n = position_.size();
    return {{"phyxels", n * (5 * sizeof(V) + sizeof(Sym3<Real>) + sizeof(M) + 2 * sizeof(Real))},
            {"neighbours", omega_.size() * (sizeof(Real) + sizeof(Index))},
            {"surfels", surfel_position_.size() * 4 * sizeof(V) +
                            surfel_omega_.size() * (sizeof(Real) + sizeof(Index))}};
  }
  std::size_t step_traffic() const override {
    return omega_.size() * (sizeof(Real) + sizeof(Index)) +
           position_.size() *
               (6 * sizeof(V) + sizeof(Sym3<Real>) + 2 * sizeof(M) + 2 * sizeof(Real));
  }

 private:
  const Csr& neighbours() const { return model_.neighbourhood.neighbours; }

  /// Does the work of precalcImutableValues.
  void prepare() {
    omega_.reserve(static_cast<std::size_t>(neighbours().entries()));
    for (Index i = 0; i < size(); ++i) mass_.push_back(static_cast<Real>(model_.mass[i]));
    for (Index i = 0; i < size(); ++i) {
      const Real h = static_cast<Real>(model_.neighbourhood.support[i]);
      const Real inverse_h_squared = Real(1) / (h * h);
      const Real at_centre = static_cast<Real>(weight(0, model_.neighbourhood.support[i]));
      Sym3<Real> moment;
      Real density = mass_[i] * at_centre;
      for (const Index j : neighbours().row(i)) {
        const V x = position_[j] - position_[i];
        const Real w = at_centre * weight_shape(dot(x, x), inverse_h_squared);
        omega_.push_back(w);
        moment += moment_term(x, w);
        density += mass_[j] * w;
      }
      inverse_moment_.push_back(pseudo_inverse(moment).matrix);
      volume_.push_back(mass_[i] / density);
    }
  }

  template <class Apply>
  void for_law(Apply&& apply) const {
    const bool green = model_.parts[0].material.law == StVenantKirchhoff<double>::name;
    green ? apply(StVenantKirchhoff<Real>{hooke_}) : apply(SmallStrain<Real>{hooke_});
  }

  M gradient_of(Index i) const {
    const Csr& csr = neighbours();
    M sum;
    for (Offset k = csr.offsets[i]; k < csr.offsets[i + 1]; ++k) {
      const Index j = csr.indices[k];
      add_gradient_term(sum, displacement_[j] - displacement_[i],
                        omega_[k] * (position_[j] - position_[i]));
    }
    return displacement_gradient(sum, inverse_moment_[i]);
  }

  /// Calls push(j, force) for each neighbour j with the force of phyxel i on it [N], from the
  /// present gradient of i.
  template <class Law, class Push>
  void for_each_push(const Law& law, Index i, Push&& push) const {
    const Csr& csr = neighbours();
    const M q = pair_stress(volume_[i], law.first_piola_stress(gradient_[i]), inverse_moment_[i]);
    for (Offset k = csr.offsets[i]; k < csr.offsets[i + 1]; ++k) {
      const Index j = csr.indices[k];
      push(j, neighbour_force(q, position_[i] - position_[j], omega_[k]));
    }
  }

  const Model& model_;
  Hooke<Real> hooke_;
  std::vector<char> held_;
  double dt_ = 0;
  std::vector<V> position_, displacement_, last_, force_;
  std::vector<Real> mass_, volume_;
  std::vector<M> gradient_;
  std::vector<Sym3<Real>> inverse_moment_;
  std::vector<Real> omega_;  // in the order of the neighbour lists
  std::vector<V> surfel_position_, surfel_normal_;
  std::vector<Real> surfel_omega_;  // in the order of the carriers
  std::vector<V> vertex_;           // normal, position of each surfel, as in the vertex buffer
};

}  // namespace

template <class Real>
std::unique_ptr<PaperBackend> make_sequential_backend(const Model& model) {
  check_paper_model(model);
  return std::make_unique<SequentialBackend<Real>>(model);
}

template std::unique_ptr<PaperBackend> make_sequential_backend<float>(const Model&);
template std::unique_ptr<PaperBackend> make_sequential_backend<double>(const Model&);
template std::unique_ptr<PaperBackend> make_sequential_backend<long double>(const Model&);

}  // namespace phyxel::paper
