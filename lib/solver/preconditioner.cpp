#include "solver/preconditioner.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "model/contact_groups.hpp"
#include "model/parts.hpp"
#include "rank_exchange.hpp"
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
  const auto all = exchanged(ranks, std::vector(static_cast<std::size_t>(ranks.size()), boxes));
  for (const std::vector<Box>& some : all) {
    for (std::size_t b = 0; b < boxes.size(); ++b) {
      if (some[b].low.x > some[b].high.x) continue;  // that rank has none of its phyxels
      extend(boxes[b], some[b].low);
      extend(boxes[b], some[b].high);
    }
  }
  return boxes;
}

/// The inverse on free axes, 0 on others.
Mat3d inverse_on(Vec3d free, const Mat3d& block) {
  const double of_axis[] = {free.x, free.y, free.z};
  Eigen::Matrix3d all = Eigen::Matrix3d::Identity();
  for (int e = 0; e < 9; ++e) {
    if (of_axis[e / 3] * of_axis[e % 3] > 0) all(e / 3, e % 3) = block(e / 3, e % 3);
  }
  const Eigen::Matrix3d inverse = all.inverse();
  Mat3d found;
  for (int e = 0; e < 9; ++e) {
    found(e / 3, e % 3) = of_axis[e / 3] * of_axis[e % 3] * inverse(e / 3, e % 3);
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
    inverse_[i] = inverse_on(free[i], more.empty() ? block_[i] : block_[i] + more[i]);
  });
  for (BodyLattices& one : lattices_) one.set(free, {gradient_, more});
}

void Preconditioner::apply(const Vector& r, Vector& z) {
  const double largest = vectors_.largest([&](Index i) {
    return std::max({std::abs(r[i].x), std::abs(r[i].y), std::abs(r[i].z)});
  });
  vectors_.for_each([&](Index i) { z[i] = inverse_[i] * r[i]; });
  if (!(largest > 0)) return;
  double most = 1;
  for (const BodyLattices& one : lattices_) most = std::max(most, one.most());
  const double by = BodyLattices::largest_sum / (largest * most);
  std::size_t at = 0;
  for (BodyLattices& one : lattices_) {
    one.gather(free_, r, by, std::span(sums_).subspan(at, one.size()));
    at += one.size();
  }
  if (model_.share) model_.share->communicator->add(sums_);
  at = 0;
  for (BodyLattices& one : lattices_) {
    one.correct(std::span(sums_).subspan(at, one.size()), by, free_, z);
    at += one.size();
  }
}

}  // namespace phyxel
