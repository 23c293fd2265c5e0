/// Every function of phyxel/physics/ on the device against the same function on the host, for
/// random inputs. Skipped where no device is found.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "phyxel/physics/force.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/physics/surfel.hpp"
#include "phyxel/physics/verlet.hpp"
#include "phyxel/physics/weight.hpp"

namespace phyxel {
namespace {

constexpr int most_values = 160;

/// Random inputs of order one; the functions are tested as formulas, without units.
template <class Real>
struct Inputs {
  Mat3<Real> grad_u;  ///< entries in (-0.5, 0.5)
  Sym3<Real> moment;  ///< positive semi-definite
  Vec3<Real> u_ij, x_ij, acceleration, velocity, normal;
  Real w, r_squared, volume, lambda, mu, stiffness, dt, keep;
};

/// Values of one function after the other; `ends[k]` closes the values of the k-th.
template <class Real>
struct Outputs {
  Real values[most_values];
  int ends[40];
  int count, functions;

  PHYXEL_HD void start() { count = functions = 0; }
  PHYXEL_HD void close() { ends[functions++] = count; }
  PHYXEL_HD void value(Real v) { values[count++] = v; }
  PHYXEL_HD void add(Real v) {
    value(v);
    close();
  }
  PHYXEL_HD void add(Vec3<Real> v) {
    value(v.x);
    value(v.y);
    value(v.z);
    close();
  }
  PHYXEL_HD void add(const Sym3<Real>& s) {
    value(s.xx);
    value(s.xy);
    value(s.xz);
    value(s.yy);
    value(s.yz);
    value(s.zz);
    close();
  }
  PHYXEL_HD void add(const Mat3<Real>& m) {
    for (int e = 0; e < 9; ++e) value(m(e / 3, e % 3));
    close();
  }
};

/// All formulas but the pseudo-inverse.
template <class Real>
PHYXEL_HD void evaluate_formulas(const Inputs<Real>& in, Outputs<Real>& out) {
  const Mat3<Real>& g = in.grad_u;
  out.start();
  out.add(weight_shape(in.r_squared, Real(1.25)));
  out.add(moment_term(in.x_ij, in.w));
  Mat3<Real> gradient_sum{};
  add_gradient_term(gradient_sum, in.u_ij, in.w * in.x_ij);
  out.add(gradient_sum);
  out.add(displacement_gradient(g, in.moment));
  out.add(green_strain(g));
  out.add(cauchy_strain(g));

  const Hooke<Real> hooke{in.lambda, in.mu};
  out.add(hooke.stress(cauchy_strain(g)));
  out.add(hooke.energy(cauchy_strain(g)));
  const StVenantKirchhoff<Real> green{hooke};
  out.add(green.energy(g));
  out.add(green.first_piola_stress(g));
  const SmallStrain<Real> cauchy{hooke};
  out.add(cauchy.energy(g));
  out.add(cauchy.first_piola_stress(g));
  out.add(NeoHookean<Real>{hooke}.first_piola_stress(g));  // its energy takes a library's logarithm
  const VolumeConservation<Real> conservation{in.stiffness};
  out.add(volume_change(g));
  out.add(conservation.energy(g));
  out.add(conservation.first_piola_stress(g));
  const SumOf<StVenantKirchhoff<Real>, VolumeConservation<Real>> both{green, conservation};
  out.add(both.energy(g));
  out.add(both.first_piola_stress(g));

  const Mat3<Real> q = pair_stress(in.volume, green.first_piola_stress(g), in.moment);
  out.add(q);
  out.add(own_force(q, in.x_ij));
  out.add(neighbour_force(q, in.x_ij, in.w));
  out.add(verlet_velocity(in.velocity, in.acceleration, in.dt));
  out.add(verlet_velocity_damped(in.velocity, in.acceleration, in.keep, in.dt));

  SurfelBlend<Real> blend;
  blend.add(in.w, in.u_ij, g, in.x_ij);
  blend.add(in.volume, in.velocity, transpose(g), in.normal);
  out.add(blend.surfel_displacement());
  out.add(blend.surfel_normal(in.normal));
}

template <class Real>
PHYXEL_HD void evaluate_inverse(const Inputs<Real>& in, Outputs<Real>& out) {
  const PseudoInverse<Real> inverse = pseudo_inverse(in.moment);
  out.start();
  out.add(Real(inverse.rank));
  out.add(inverse.matrix);
}

enum class Part { formulas, inverse };

template <Part part, class Real>
PHYXEL_HD void evaluate(const Inputs<Real>& in, Outputs<Real>& out) {
  if constexpr (part == Part::formulas) {
    evaluate_formulas(in, out);
  } else {
    evaluate_inverse(in, out);
  }
}

template <Part part, class Real>
__global__ void evaluate_all(const Inputs<Real>* in, Outputs<Real>* out, int count) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i < count) evaluate<part>(in[i], out[i]);
}

class Random {
 public:
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  template <class Real>
  Vec3<Real> vector() {
    const auto x = static_cast<Real>((*this)(-1, 1)), y = static_cast<Real>((*this)(-1, 1));
    return {x, y, static_cast<Real>((*this)(-1, 1))};
  }

 private:
  std::mt19937_64 engine_{20080722};
};

/// @param directions 3: twelve neighbours all round; 2: in a plane; 1: on a line; 0: none.
template <class Real>
Inputs<Real> random_inputs(Random& random, int directions) {
  Inputs<Real> in;
  const auto real = [&](double low, double high) { return static_cast<Real>(random(low, high)); };
  for (int e = 0; e < 9; ++e) in.grad_u(e / 3, e % 3) = real(-0.5, 0.5);
  // Two directions at right angles and of one length, however they lie.
  const Vec3d a = normalised(random.vector<double>());
  const Vec3d b = normalised(cross(a, random.vector<double>()));
  const Vec3<Real> first{Real(a.x), Real(a.y), Real(a.z)}, second{Real(b.x), Real(b.y), Real(b.z)};
  for (int k = 0; k < 12 && directions > 0; ++k) {
    Vec3<Real> x = random.vector<Real>();
    if (directions == 1) x = x.x * first;
    if (directions == 2) x = x.x * first + x.y * second;
    in.moment += moment_term(x, real(0.1, 0.2));
  }
  in.u_ij = random.vector<Real>();
  in.x_ij = random.vector<Real>();
  in.acceleration = random.vector<Real>();
  in.velocity = random.vector<Real>();
  in.normal = random.vector<Real>();
  in.w = real(0.1, 1);
  in.r_squared = real(0, 0.8);
  in.volume = real(0.1, 1);
  in.lambda = real(0, 2);
  in.mu = real(0.1, 1);
  in.stiffness = real(0, 2);
  in.dt = real(0, 1);
  in.keep = real(0, 1);
  return in;
}

template <class T>
class DeviceArray {
 public:
  explicit DeviceArray(std::size_t count) {
    if (cudaMalloc(&data_, count * sizeof(T)) != cudaSuccess) data_ = nullptr;
    // Whole records are copied back, the unused ends of their arrays too.
    if (data_) cudaMemset(data_, 0, count * sizeof(T));
  }
  ~DeviceArray() { cudaFree(data_); }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;
  T* data() { return data_; }

 private:
  T* data_ = nullptr;
};

template <Part part, class Real>
std::vector<Outputs<Real>> on_device(const std::vector<Inputs<Real>>& in) {
  DeviceArray<Inputs<Real>> device_in(in.size());
  DeviceArray<Outputs<Real>> device_out(in.size());
  EXPECT_EQ(cudaMemcpy(device_in.data(), in.data(), in.size() * sizeof(in[0]), cudaMemcpyDefault),
            cudaSuccess);
  const int block = 64, count = static_cast<int>(in.size());
  evaluate_all<part>
      <<<(count + block - 1) / block, block>>>(device_in.data(), device_out.data(), count);
  std::vector<Outputs<Real>> out(in.size());
  EXPECT_EQ(
      cudaMemcpy(out.data(), device_out.data(), out.size() * sizeof(out[0]), cudaMemcpyDefault),
      cudaSuccess)
      << cudaGetErrorString(cudaGetLastError());
  return out;
}

/// Largest difference in units of `epsilon × max(1, largest value of that function)`.
template <class Real>
double difference(const Outputs<Real>& device, const Outputs<Real>& host, int function) {
  const int begin = function == 0 ? 0 : host.ends[function - 1], end = host.ends[function];
  double size = 1, error = 0;
  for (int k = begin; k < end; ++k) {
    size = std::max(size, std::abs(static_cast<double>(host.values[k])));
    const double gap = static_cast<double>(device.values[k]) - static_cast<double>(host.values[k]);
    error = std::isfinite(gap) ? std::max(error, std::abs(gap)) : HUGE_VAL;
  }
  return error / (size * static_cast<double>(std::numeric_limits<Real>::epsilon()));
}

template <class Real>
class DevicePhysics : public ::testing::Test {
 protected:
  void SetUp() override {
    int devices = 0;
    if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
      GTEST_SKIP() << "no CUDA device";
    }
  }

  template <Part part>
  void compare(const std::vector<Inputs<Real>>& in, double tolerance) {
    const std::vector<Outputs<Real>> device = on_device<part>(in);
    double worst = 0;
    for (std::size_t i = 0; i < in.size(); ++i) {
      Outputs<Real> host;
      evaluate<part>(in[i], host);
      ASSERT_EQ(device[i].functions, host.functions);
      for (int f = 0; f < host.functions; ++f) {
        const double error = difference(device[i], host, f);
        ASSERT_LE(error, tolerance) << "function " << f << " of input " << i;
        worst = std::max(worst, error);
      }
    }
    this->RecordProperty("largest_difference_in_epsilon", std::to_string(worst));
    std::printf("largest difference: %.3g epsilon\n", worst);
  }
};

using Reals = ::testing::Types<float, double>;
TYPED_TEST_SUITE(DevicePhysics, Reals);

#ifdef PHYXEL_TEST_EXACT
// IEEE 754 rounds +, -, ×, / and the square root alike on both sides; nothing is fused here.
constexpr double formula_tolerance = 0;
constexpr double inverse_tolerance = 0;
#else
// The device fuses a × b + c and so leaves out one rounding each time, half an epsilon of a term.
// The longest formula (forces through Green's stress and the pair stress) has some 60 such places
// in a row of sums, with terms of order one, which do not all err the same way: 16 is twice the
// square root of 60.
constexpr double formula_tolerance = 16;
// The rotations round by some epsilon of the largest eigenvalue, and inverting multiplies that by
// the condition number, below 50 or so for twelve neighbours all round; relative to the inverse.
constexpr double inverse_tolerance = 200;
#endif

TYPED_TEST(DevicePhysics, FormulasEqualTheHost) {
  Random random;
  std::vector<Inputs<TypeParam>> in;
  for (int k = 0; k < 5000; ++k) in.push_back(random_inputs<TypeParam>(random, 3));
  this->template compare<Part::formulas>(in, formula_tolerance);
}

TYPED_TEST(DevicePhysics, PseudoInverseEqualsTheHostAtFullRank) {
  Random random;
  std::vector<Inputs<TypeParam>> in;
  for (int k = 0; k < 5000; ++k) in.push_back(random_inputs<TypeParam>(random, 3));
  this->template compare<Part::inverse>(in, inverse_tolerance);
}

TYPED_TEST(DevicePhysics, PseudoInverseFindsTheSameRankOfSheetsThreadsAndNothing) {
  Random random;
  for (int directions = 0; directions < 3; ++directions) {
    std::vector<Inputs<TypeParam>> in;
    for (int k = 0; k < 500; ++k) in.push_back(random_inputs<TypeParam>(random, directions));
    this->template compare<Part::inverse>(in, inverse_tolerance);
    for (const Outputs<TypeParam>& out : on_device<Part::inverse>(in)) {
      ASSERT_EQ(out.values[0], TypeParam(directions));
    }
  }
}

}  // namespace
}  // namespace phyxel
