/// Rubber, polymers, gels: the generalised Maxwell solid at finite strain, whose shear stress
/// relaxes.
///
/// Branches act side by side with a spring that stays. Each is a spring in series with a dashpot,
/// F = F_m F_v, and all springs are Hencky's (laws/hencky.hpp):
///   ψ = ½ K θ² + (1 - Σ g_m) μ |dev ε|² + Σ g_m μ |dev ε_m|²
/// with the logarithmic strains ε of F and ε_m of F_m. The dashpot flows along the deviator of the
/// spring's stress and keeps the volume, so that at a fixed deformation
///   dev ε_m ~ exp(-t/τ_m)
/// (Reese and Govindjee 1998, A theory of finite viscoelasticity and numerical aspects; Simo 1987
/// in small strains). A step takes the trial of the whole step times exp(-Δt/τ_m), by the
/// exponential map of metals (laws/plastic_flow.hpp): exact at a fixed deformation, whatever
/// Δt/τ_m, and of first order in Δt/τ_m in what a step itself deforms. A rotation of the body
/// between two steps has no effect. Dashpots turn into heat
///   ½ (S_before + S_after) : Δε_v = g_m μ (1 - e^{-Δt/τ_m}) |ε| (|ε_before| + e^{-Δt/τ_m} |ε|)
/// of a step, with the spring's ε_before at its start and the trial ε, taken to be coaxial: all
/// that the spring loses at a fixed deformation, and the rest of the work of forces at the ends of
/// steps.
///
/// In the endless time of a search for equilibrium branches relax, and in no time (Δt = 0) they do
/// not.
#pragma once

#include <array>
#include <cmath>
#include <span>

#include "phyxel/physics/laws/plastic_flow.hpp"

namespace phyxel {

/// The generalised Maxwell solid on Hencky's law.
template <class Real>
struct Maxwell {
  static constexpr int branches = 4;  ///< The most branches.

  static constexpr const char* name = "maxwell";
  static constexpr const char* meaning =
      "rubber, polymers, gels: Hencky's law whose shear stress relaxes, with up to four relaxation "
      "times (a Prony series)";
  static constexpr LawParameter parameters[] = {
      young_modulus,
      poisson_ratio,
      {.name = "relaxation",
       .unit = "",
       .low = 1e-6,
       .high = 1,
       .open = false,
       .meaning =
           "Branches: share of the shear modulus that relaxes, by relaxation time [s]. The "
           "shares add up to less than 1. `young` and `poisson` are those of fast "
           "deformation; the bulk modulus does not relax. Verlet's steps are a twentieth of the "
           "shortest time at most: what relaxes faster than the body moves is better "
           "described by `viscosity`.",
       .points = branches,
       .starts_above_zero = true,
       .argument = "relaxation time",
       .typical_curve = {{0.01, 0.3}, {0.1, 0.2}}}};

  /// Rejects shares that leave no shear modulus.
  static const char* unmet(std::span<const double> p) {
    return relaxing_share(p) < 1 ? "" : "shares of relaxation that add up to less than 1";
  }
  /// The members below, in their order.
  static std::array<double, 2 + 2 * branches> constants(std::span<const double> p) {
    std::array<double, 2 + 2 * branches> all{};
    const auto lame = lame_constants(p);
    const double lasting = lame[1] * (1 - relaxing_share(p));
    all[0] = lame[0] + 2.0 / 3 * (lame[1] - lasting), all[1] = lasting;
    for (int m = 0; m < branches; ++m) {
      all[2 + m] = lame[1] * share_of(p, m);
      all[2 + branches + m] = 1 / p[2 + 2 * m];
    }
    return all;
  }
  /// E times the share of the shear modulus that stays, or a tenth of E if that is more [Pa]:
  /// hourglass residuals do not relax.
  static double hourglass_modulus(std::span<const double> p) {
    const double lasting = 1 - relaxing_share(p);
    return p[0] * (lasting > 0.1 ? lasting : 0.1);
  }

  /// The shortest relaxation time [s].
  static double shortest_time(std::span<const double> p) { return p[2]; }
  /// The longest relaxation time [s].
  static double longest_time(std::span<const double> p) { return p[2 * branches]; }

  static constexpr bool many_registers = true;
  static constexpr bool work_is_potential = false;  // of the rate

  static constexpr HistoryNumber history[] = {{"inverse_viscous_factor_1_xx", ""},
                                              {"inverse_viscous_factor_1_yx", ""},
                                              {"inverse_viscous_factor_1_yy", ""},
                                              {"inverse_viscous_factor_1_zx", ""},
                                              {"inverse_viscous_factor_1_zy", ""},
                                              {"inverse_viscous_factor_1_zz", ""},
                                              {"spring_strain_1", ""},
                                              {"inverse_viscous_factor_2_xx", ""},
                                              {"inverse_viscous_factor_2_yx", ""},
                                              {"inverse_viscous_factor_2_yy", ""},
                                              {"inverse_viscous_factor_2_zx", ""},
                                              {"inverse_viscous_factor_2_zy", ""},
                                              {"inverse_viscous_factor_2_zz", ""},
                                              {"spring_strain_2", ""},
                                              {"inverse_viscous_factor_3_xx", ""},
                                              {"inverse_viscous_factor_3_yx", ""},
                                              {"inverse_viscous_factor_3_yy", ""},
                                              {"inverse_viscous_factor_3_zx", ""},
                                              {"inverse_viscous_factor_3_zy", ""},
                                              {"inverse_viscous_factor_3_zz", ""},
                                              {"spring_strain_3", ""},
                                              {"inverse_viscous_factor_4_xx", ""},
                                              {"inverse_viscous_factor_4_yx", ""},
                                              {"inverse_viscous_factor_4_yy", ""},
                                              {"inverse_viscous_factor_4_zx", ""},
                                              {"inverse_viscous_factor_4_zy", ""},
                                              {"inverse_viscous_factor_4_zz", ""},
                                              {"spring_strain_4", ""},
                                              {"relaxation_work", "J/m^3"}};
  /// The history of a phyxel; all zero: never deformed.
  struct State {
    /// A spring and its dashpot.
    struct Branch : PlasticFactor<Real> {  // L of F_v⁻¹
      Real strain{};                       ///< |ε_m| at the end of the last step.
    };
    Branch branch[branches];
    Real relaxation_work{};  ///< Heat since the virgin state [J/m³].
  };

  Real lambda, mu;       ///< Lamé's parameters of the spring that stays, with all of K [Pa].
  Real shear[branches];  ///< g_m μ [Pa]
  Real rate[branches];   ///< 1/τ_m [1/s]

  /// The stored energy of all springs [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u, const State& state) const {
    Real energy = lasting().energy(grad_u);
    each_branch([&](int m) {
      energy = fused(shear[m], strain_of(grad_u, state.branch[m]).deviator_squared(), energy);
    });
    return energy;
  }
  /// The elastic stress ∂ψ/∂∇u [Pa] with dashpots that stand still.
  PHYXEL_HD Mat3<Real> elastic_stress(const Mat3<Real>& grad_u, const State& state) const {
    Mat3<Real> stress = lasting().first_piola_stress(grad_u);
    each_branch([&](int m) {
      stress += stress_of(strain_of(grad_u, state.branch[m]), state.branch[m], shear[m]);
    });
    return stress;
  }
  /// Heat of dashpots since the virgin state [J/m³].
  PHYXEL_HD Real viscous_work(const State& state) const { return state.relaxation_work; }
  /// First Piola stress [Pa] at the end of a step of `dt` [s].
  /// @param grad_u F - I at the end of the step
  /// @param state history at the start of the step; advanced to its end
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u, State& state, Real dt) const {
    using std::sqrt;
    Mat3<Real> stress = lasting().first_piola_stress(grad_u);
    each_branch([&](int m) {
      auto& branch = state.branch[m];
      const HenckyStrain<Real> trial = strain_of(grad_u, branch);
      // A crushed or inverted spring (a stretch below s₀ of Hencky's law) does not relax, since
      // flow would enlarge a negative stretch; it recovers elastically.
      const Real least = smaller(smaller(trial.isolated.biot, trial.near.biot), trial.far.biot);
      const Real lost = where_larger(least, Real(LogarithmicStrain<Real>::least_stretch - 1),
                                     -exp_minus_one(rate[m] * dt), Real(0));
      const Real strain = sqrt(trial.deviator_squared()), left = strain - lost * strain;
      stress += stress_of(trial, branch, shear[m] - shear[m] * lost);
      state.relaxation_work =
          fused(shear[m] * lost * strain, branch.strain + left, state.relaxation_work);
      branch.flow(trial, lost);
      branch.strain = left;
    });
    return stress;
  }
  /// The linearisation at rest of fast deformation, Hooke's law in Cauchy's strain.
  PHYXEL_HD SmallStrain<Real> at_rest(Real volume_stiffness) const {
    const Real relaxing = all_shear();
    return SmallStrain<Real>{{fused(Real(-2.0 / 3), relaxing, lambda), mu + relaxing}}.at_rest(
        volume_stiffness);
  }
  /// An upper bound of the stiffness of plane waves [Pa] (physics/law.hpp). The springs of branches
  /// are taken to be stretched by up to the square of what the body is, as by a body that has
  /// relaxed stretched and is then compressed as much.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const Real clipped = larger(Real(0.01), s.smallest);
    const Real gap = Real(2) * log_one_plus((s.largest - clipped) / clipped);
    const Real relaxing = all_shear();
    const Real von_mises = Real(1.7320508075688772) * relaxing * gap;
    return lasting().wave_stiffness(s) +
           wave_stiffness_of_flow(Real(-2.0 / 3) * relaxing, relaxing, von_mises, s);
  }

 private:
  /// g of branch m. `p` repeats the last branch in place of those that are not there.
  static double share_of(std::span<const double> p, int m) {
    return m > 0 && !(p[2 + 2 * m] > p[2 * m]) ? 0 : p[3 + 2 * m];
  }
  static double relaxing_share(std::span<const double> p) {
    double sum = 0;
    for (int m = 0; m < branches; ++m) sum += share_of(p, m);
    return sum;
  }
  PHYXEL_HD Hencky<Real> lasting() const { return {lambda, mu}; }
  PHYXEL_HD Real all_shear() const {
    Real sum = shear[0];
    for (int m = 1; m < branches; ++m) sum = sum + shear[m];
    return sum;
  }
  /// Calls act(m) for each branch that the material has.
  template <class Act>
  PHYXEL_HD void each_branch(Act&& act) const {
#if defined(__CUDA_ARCH__)
#pragma unroll 1
#elif defined(__GNUC__) && !defined(__clang__)
#pragma GCC unroll 1
#endif
    for (int m = 0; m < branches; ++m) {
      if (detail::has_positive(shear[m])) act(m);
    }
  }
  /// The strain of a branch's spring.
  PHYXEL_HD static HenckyStrain<Real> strain_of(const Mat3<Real>& grad_u,
                                                const PlasticFactor<Real>& branch) {
    return HenckyStrain<Real>::of(branch.elastic_gradient(grad_u));
  }
  /// The stress of a branch [Pa]. @param modulus of its spring, or less after relaxation [Pa]
  PHYXEL_HD static Mat3<Real> stress_of(const HenckyStrain<Real>& strain,
                                        const PlasticFactor<Real>& branch, Real modulus) {
    return branch.times_transpose(strain.first_piola_stress(Real(-2.0 / 3) * modulus, modulus));
  }
};

}  // namespace phyxel
