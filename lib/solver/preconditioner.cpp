#include "solver/preconditioner.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "model/contact_groups.hpp"
#include "model/parts.hpp"
#include "rank_exchange.hpp"
#include "rank_sums.hpp"
#include "solver/on_axes.hpp"
#include "solver/step_sums.hpp"
#include "solver/stiffness_blocks.hpp"

namespace phyxel {
namespace {

/// The boxes around the phyxels of all ranks of each body. Collective on a share.
std::vector<Box> boxes_of_bodies(const Model& model) {
  std::vector<Box> boxes;
  for (const Part& part : model.parts) {
    boxes.resize(static_cast<std::size_t>(part.body) + 1, no_box);
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      extend(boxes[part.body], model.position[i]);
    }
  }
  if (!model.share) return boxes;
  const Communicator& ranks = *model.share->communicator;
  const auto all = allgathered(ranks, boxes);
  for (const std::vector<Box>& some : all) {
    for (std::size_t b = 0; b < boxes.size(); ++b) {
      if (some[b].low.x > some[b].high.x) continue;  // that rank has none of its phyxels
      extend(boxes[b], some[b].low);
      extend(boxes[b], some[b].high);
    }
  }
  return boxes;
}

double largest_component(const OwnedVectors& vectors, const std::vector<Vec3d>& v) {
  return vectors.largest([&](Index i) {
    return std::max({std::abs(v[i].x), std::abs(v[i].y), std::abs(v[i].z)});
  });
}

/// The pseudo-inverse on some axes.
Mat3d pseudo_inverse_on(Vec3d axes, const Mat3d& matrix) {
  const Mat3d own = on_axes(matrix, axes, axes);
  Eigen::Matrix3d all;
  for (int e = 0; e < 9; ++e) all(e / 3, e % 3) = own(e / 3, e % 3);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(all);
  Mat3d found;
  for (int k = 0; k < 3; ++k) {
    const double value = solver.eigenvalues()[k];
    if (!(value > 0)) continue;
    const Eigen::Vector3d way = solver.eigenvectors().col(k);
    for (int e = 0; e < 9; ++e) found(e / 3, e % 3) += way[e / 3] * way[e % 3] / value;
  }
  return found;
}

}  // namespace

Preconditioner::Preconditioner(const Model& model, const OwnedVectors& vectors)
    : model_(model), vectors_(vectors), block_(stiffness_blocks(model, vectors)) {
  const std::vector<Box> boxes = boxes_of_bodies(model);
  std::vector<double> volume(boxes.size()), size(boxes.size());
  std::vector<std::vector<BodyLattices::Source>> sources(boxes.size());
  for (const Part& part : model.parts) {
    const LameParameters lame = small_strain_parameters(part);
    volume[part.body] += part.volume;
    size[part.body] += part.size;
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      sources[part.body].push_back({i, model.position[i], model.volume[i], lame.lambda, lame.mu});
    }
  }
  const Communicator* ranks = model.share ? model.share->communicator : nullptr;
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    lattices_.emplace_back(ranks, boxes[b], std::cbrt(volume[b] / size[b]), std::move(sources[b]));
  }
  std::size_t all = 0;
  for (const BodyLattices& one : lattices_) all += one.size();
  sums_.resize(all);
}

void Preconditioner::set(const Vector& free, std::span<const double> weight, const Blocks& contact,
                         std::vector<Mat3d> gradient) {
  const bool is_same = !inverse_.empty() && gradient.empty() && gradient_.empty() &&
                       free == free_ && contact.empty() && contact_.empty() &&
                       weight.size() == weight_.size() &&
                       std::equal(weight.begin(), weight.end(), weight_.begin(), weight_.end());
  const double changes = is_same ? 0 : 1;
  if ((model_.share ? model_.share->communicator->largest(changes) : changes) == 0) return;
  free_ = free;
  weight_.assign(weight.begin(), weight.end());
  contact_ = contact;
  gradient_ = std::move(gradient);
  const double any = contact.empty() ? 0 : 1;
  std::vector<Mat3d> more;
  if (!weight.empty() || (model_.share ? model_.share->communicator->largest(any) : any) > 0) {
    more.resize(block_.size());
  }
  if (!weight.empty()) {
    vectors_.for_each([&](Index i) { more[i] = weight[i] * identity<double>(); });
  }
  for (const auto& [i, block] : contact) more[i] += block;
  inverse_.resize(block_.size());
  vectors_.for_each([&](Index i) {
    inverse_[i] = inverse_on_axes(more.empty() ? block_[i] : block_[i] + more[i], free[i]);
  });
  find_wholes(more);
  if (any_loose_) {
    Vector shares = vectors_.make();
    vectors_.for_each([&](Index i) { shares[i] = share_of(i) * Vec3d{1, 1, 1}; });
    double by = 1;
    const auto sums = gathered(shares, largest_component(vectors_, shares), by);
    for (std::size_t b = 0; b < lattices_.size(); ++b) lattices_[b].set_shares(sums[b], by);
  }
  for (std::size_t b = 0; b < lattices_.size(); ++b) {
    if (wholes_[b].uses_lattices) lattices_[b].set(free, {gradient_, more});
  }
}

/// Finds the axes along which supports hold each body, and its inertia. @param more stiffness by
/// inertia and contact
void Preconditioner::find_wholes(std::span<const Mat3d> more) {
  enum Term { held, stiffness = 3, inertia = 12, elastic, count, terms };
  StepSums sums(terms * lattices_.size());
  for (const Part& part : model_.parts) {
    ExactSum* const own = &sums[terms * static_cast<std::size_t>(part.body)];
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      const double free[] = {free_[i].x, free_[i].y, free_[i].z};
      for (int axis = 0; axis < 3; ++axis) {
        own[held + axis].add(1 - free[axis]);
        own[elastic].add(block_[i](axis, axis));
      }
      own[count].add(1);
      if (!weight_.empty()) own[inertia].add(3 * weight_[i]);
      for (int e = 0; e < 9 && !more.empty(); ++e) {
        own[stiffness + e].add(more[i](e / 3, e % 3));
      }
    }
  }
  add_over_ranks(model_, sums);
  wholes_.resize(lattices_.size());
  any_loose_ = false;
  for (std::size_t b = 0; b < wholes_.size(); ++b) {
    const auto value = [&](int term) {
      return sums[terms * b + static_cast<std::size_t>(term)].value();
    };
    Whole& whole = wholes_[b];
    // At rest, lattices know of friction, and of contact with slanted surfaces.
    const auto along = [&](int axis) { return value(stiffness + 4 * axis); };
    constexpr double next_to_nothing = 1e-12;
    const double most = next_to_nothing * std::max({along(0), along(1), along(2)});
    const auto is_loose = [&](int axis) {
      return value(held + axis) == 0 && (!weight_.empty() || along(axis) <= most) ? 1.0 : 0.0;
    };
    whole.loose = {is_loose(0), is_loose(1), is_loose(2)};
    whole.shares = weight_.empty() ? value(count) : value(inertia) / 3;
    constexpr double share = 0.1;
    whole.uses_lattices = value(inertia) < share * value(elastic);
    any_loose_ = any_loose_ || whole.loose != Vec3d{};
    Mat3d all;
    for (int e = 0; e < 9; ++e) all(e / 3, e % 3) = value(stiffness + e);
    whole.compliance = weight_.empty() ? Mat3d{} : pseudo_inverse_on(whole.loose, all);
  }
}

/// Takes motions of whole bodies along loose axes out of z, and adds the motions that the total
/// forces cause.
void Preconditioner::project(Vector& z, const std::vector<Vec3d>& totals) const {
  const double largest = largest_component(vectors_, z);
  double most = 1;
  for (const Whole& whole : wholes_) most = std::max(most, whole.shares);
  const double by = largest > 0 ? std::ldexp(1, 61) / (largest * most) : 1;
  std::vector<std::int64_t> sums(3 * wholes_.size());
  for (const Part& part : model_.parts) {
    std::int64_t* const own = &sums[3 * static_cast<std::size_t>(part.body)];
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      const double scale = by * share_of(i);
      own[0] += std::llrint(scale * z[i].x);
      own[1] += std::llrint(scale * z[i].y);
      own[2] += std::llrint(scale * z[i].z);
    }
  }
  if (model_.share) model_.share->communicator->add(sums);
  for (const Part& part : model_.parts) {
    const auto b = static_cast<std::size_t>(part.body);
    const Whole& whole = wholes_[b];
    const auto mean = [&](std::size_t axis) {
      return static_cast<double>(sums[3 * b + axis]) / (by * whole.shares);
    };
    const Vec3d change =
        whole.compliance * totals[b] - by_components(whole.loose, Vec3d{mean(0), mean(1), mean(2)});
    for (Index i = part.begin; i < part.owned_end(); ++i) z[i] += change;
  }
}

/// The sums of r at the nodes of each body, of all ranks. @param largest component of r
/// @param by receives the factor of the values (`BodyLattices::gather`)
std::vector<std::span<std::int64_t>> Preconditioner::gathered(const Vector& r, double largest,
                                                              double& by) {
  double most = 1;
  for (const BodyLattices& one : lattices_) most = std::max(most, one.most());
  by = largest > 0 ? BodyLattices::largest_sum / (largest * most) : 1;
  std::vector<std::span<std::int64_t>> sums;
  std::size_t at = 0;
  for (BodyLattices& one : lattices_) {
    sums.push_back(std::span(sums_).subspan(at, one.size()));
    one.gather(free_, r, by, sums.back());
    at += one.size();
  }
  if (model_.share) model_.share->communicator->add(sums_);
  return sums;
}

void Preconditioner::apply(const Vector& r, Vector& z) {
  double by = 1;
  const std::vector<std::span<std::int64_t>> sums = gathered(r, largest_component(vectors_, r), by);
  std::vector<Vec3d> totals, means;
  for (std::size_t b = 0; b < lattices_.size(); ++b) {
    totals.push_back(by_components(wholes_[b].loose, lattices_[b].total(sums[b], by)));
    means.push_back((1 / wholes_[b].shares) * totals.back());
  }
  for (const Part& part : model_.parts) {
    const Vec3d mean = means[static_cast<std::size_t>(part.body)];
#pragma omp parallel for schedule(static)
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      z[i] = inverse_[i] * (r[i] - share_of(i) * mean);
    }
  }
  for (std::size_t b = 0; b < lattices_.size(); ++b) {
    if (wholes_[b].uses_lattices) lattices_[b].correct(sums[b], by, means[b], free_, z);
  }
  if (any_loose_) project(z, totals);
}

}  // namespace phyxel
