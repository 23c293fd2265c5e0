#include "solver/body_momenta.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "rank_sums.hpp"

namespace phyxel {
namespace {

/// The vector of three sums, from the first of them on.
Vec3d vector_at(const StepSums& sums, std::size_t first) {
  return {sums[first].value(), sums[first + 1].value(), sums[first + 2].value()};
}

void add_vector(StepSums& sums, std::size_t first, Vec3d v) {
  sums[first].add(v.x);
  sums[first + 1].add(v.y);
  sums[first + 2].add(v.z);
}

/// The rotation [rad/s] that has an angular momentum, about the axes that are free.
/// @param second Σ m x xᵀ about the centre of mass: xx, xy, xz, yy, yz, zz [kg m²]
Vec3d rotation_with(const std::array<double, 6>& second, Vec3d momentum, Vec3d free) {
  const auto [xx, xy, xz, yy, yz, zz] = second;
  Eigen::Matrix3d inertia;
  inertia << yy + zz, -xy, -xz, -xy, xx + zz, -yz, -xz, -yz, xx + yy;
  Eigen::Vector3d wanted(momentum.x, momentum.y, momentum.z);
  const double about[] = {free.y * free.z, free.x * free.z, free.x * free.y};
  for (int a = 0; a < 3; ++a) {
    if (about[a] > 0) continue;
    const double own = inertia(a, a);
    inertia.row(a).setZero();
    inertia.col(a).setZero();
    inertia(a, a) = own;
    wanted(a) = 0;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia);
  constexpr double cut_off = 1e-9;  // phyxels on one line do not turn about it
  Eigen::Vector3d turn = solver.eigenvectors().transpose() * wanted;
  for (int a = 0; a < 3; ++a) {
    const double value = solver.eigenvalues()(a);
    turn(a) = value > cut_off * solver.eigenvalues()(2) ? turn(a) / value : 0;
  }
  turn = solver.eigenvectors() * turn;
  return {turn(0), turn(1), turn(2)};
}

}  // namespace

template <class Each>
void BodyMomenta::for_each(Each&& each) const {
  for (const Part& part : model_.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      each(i, static_cast<std::size_t>(part.body));
    }
  }
}

BodyMomenta::BodyMomenta(const Model& model) : model_(model) {
  std::size_t bodies = 0;
  for (const Part& part : model.parts) {
    bodies = std::max(bodies, static_cast<std::size_t>(part.body) + 1);
  }
  StepSums mass(bodies);
  std::vector<std::int64_t> held(3 * bodies), all(bodies);
  const std::vector<char> prescribed = prescribed_axes(model);
  for_each([&](Index i, std::size_t b) {
    mass[b].add(model.mass[i]);
    ++all[b];
    for (std::size_t a = 0; a < 3; ++a) held[3 * b + a] += prescribed[i] >> a & 1;
  });
  add_over_ranks(model, mass);
  if (model.share) {
    model.share->communicator->add(held);
    model.share->communicator->add(all);
  }
  for (std::size_t b = 0; b < bodies; ++b) {
    mass_.push_back(mass[b].value());
    bool is_alike = true;  // each axis is free for all phyxels, or for none
    for (std::size_t a = 0; a < 3; ++a) {
      is_alike = is_alike && (held[3 * b + a] == 0 || held[3 * b + a] == all[b]);
    }
    const auto of_axis = [&](std::size_t a) {
      return is_alike && held[3 * b + a] == 0 ? 1.0 : 0.0;
    };
    free_.push_back({of_axis(0), of_axis(1), of_axis(2)});
  }
}

std::vector<std::array<Vec3d, 2>> BodyMomenta::centres(const std::vector<Vec3d>& earlier,
                                                       const std::vector<Vec3d>& now) const {
  constexpr std::size_t each = 6;
  StepSums sums(each * mass_.size());
  for_each([&](Index i, std::size_t b) {
    const double m = model_.mass[i];
    add_vector(sums, each * b, m * (model_.position[i] + earlier[i]));
    add_vector(sums, each * b + 3, m * (model_.position[i] + now[i]));
  });
  add_over_ranks(model_, sums);
  std::vector<std::array<Vec3d, 2>> centres;
  for (std::size_t b = 0; b < mass_.size(); ++b) {
    const double scale = mass_[b] > 0 ? 1 / mass_[b] : 0;
    centres.push_back({scale * vector_at(sums, each * b), scale * vector_at(sums, each * b + 3)});
  }
  return centres;
}

void BodyMomenta::keep(const MovingPlaces& earlier, const std::vector<Vec3d>& displacement,
                       std::vector<Vec3d>& velocity) const {
  const std::vector<std::array<Vec3d, 2>> centre = centres(earlier.displacement, displacement);
  constexpr std::size_t each = 12;  // changes of both momenta, and second moments
  StepSums sums(each * mass_.size());
  for_each([&](Index i, std::size_t b) {
    const double m = model_.mass[i];
    const Vec3d x = model_.position[i] + displacement[i] - centre[b][1];
    const Vec3d before = model_.position[i] + earlier.displacement[i] - centre[b][0];
    add_vector(sums, each * b, m * (velocity[i] - earlier.velocity[i]));
    add_vector(sums, each * b + 3,
               m * (cross(x, velocity[i]) - cross(before, earlier.velocity[i])));
    add_vector(sums, each * b + 6, m * x.x * x);
    add_vector(sums, each * b + 9, m * Vec3d{x.y * x.y, x.y * x.z, x.z * x.z});
  });
  add_over_ranks(model_, sums);
  std::vector<Vec3d> shift(mass_.size()), turn(mass_.size());  // [m/s], [rad/s]
  for (std::size_t b = 0; b < mass_.size(); ++b) {
    if (!(mass_[b] > 0)) continue;
    std::array<double, 6> second{};
    for (std::size_t k = 0; k < 6; ++k) second[k] = sums[each * b + 6 + k].value();
    const Vec3d free = free_[b], of_sum = (1 / mass_[b]) * vector_at(sums, each * b);
    shift[b] = {free.x * of_sum.x, free.y * of_sum.y, free.z * of_sum.z};
    turn[b] = rotation_with(second, vector_at(sums, each * b + 3), free);
  }
  for_each([&](Index i, std::size_t b) {
    const Vec3d x = model_.position[i] + displacement[i] - centre[b][1];
    const Vec3d change = shift[b] + cross(turn[b], x), free = free_[b];
    velocity[i] -= Vec3d{free.x * change.x, free.y * change.y, free.z * change.z};
  });
}

}  // namespace phyxel
