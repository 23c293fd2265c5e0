#include "solver/body_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "mesh/distance_field.hpp"
#include "model/parts.hpp"

namespace phyxel {
BodyContacts::BodyContacts(const Model& model, int threads)
    : model_(model), threads_(threads), points_(model) {
  if (!acts()) return;
  sums_.resize(ContactTerms::count * model.body_contact.distances.size());
  for (const BodyDistances& distances : model.body_contact.distances) {
    fields_.push_back(distances ? distances.view() : PlacedDistances{});
  }
}

bool ContactWatch::look(const Model& model, double moved, double fastest, double skin, double dt) {
  if (model.share) {
    moved = model.share->communicator->largest(moved);
    fastest = model.share->communicator->largest(fastest);
  }
  // Speeds may double until the next look.
  const double way = 2 * fastest * dt, most = 0.5 * skin;
  const bool is_late = generation_ == 0 || dt != dt_ || moved + way > most;
  if (is_late) {
    moved = 0;
    ++generation_;
  }
  dt_ = dt;
  const double steps = (most - moved) / std::max(way, 1e-300);
  left_ = static_cast<int>(std::clamp(steps, 1.0, static_cast<double>(rarest_)));
  return is_late;
}

void BodyContacts::look(std::span<const SurfaceState> states, double dt) {
  const std::vector<Index>& layer = model_.body_contact.layer.phyxels;
  std::vector<Vec3d> now(layer.size());
  double moved = 0, fastest = 0;
  for (std::size_t k = 0; k < layer.size(); ++k) {
    now[k] = model_.position[layer[k]] + states[k].displacement;
    fastest = std::max(fastest, norm(states[k].velocity));
    if (!found_at_.empty()) moved = std::max(moved, norm(now[k] - found_at_[k]));
  }
  if (!watch_.look(model_, moved, fastest, points_.skin(), dt)) return;
  found_at_ = std::move(now);
  points_.find(found_at_, dt);
  motion_.assign(points_.sites().size(), {});
  velocity_.assign(points_.sites().size(), {});
}

void BodyContacts::set_gradient(std::size_t p, const Mat3d& gradient) {
  phyxel::set_gradient(motion_[p], points_.sites()[p], gradient);
}

int BodyContacts::threads_here() const {
  return std::clamp(static_cast<int>(points_.rows().size() / 200), 1, threads_);
}

ContactPasses BodyContacts::passes() {
  const std::size_t rows = points_.rows().size();
  touches_.resize(rows);
  responses_.resize(rows);
  row_forces_.resize(rows);
  carries_.resize(points_.row_of_entry().size());
  shares_.resize(points_.sites().size());
  return {.site = points_.sites().data(),
          .motion = motion_.data(),
          .velocity = velocity_.data(),
          .row = points_.rows().data(),
          .near_start = points_.near().offsets.data(),
          .near = points_.near().indices.data(),
          .row_of_entry = points_.row_of_entry().data(),
          .entries_of_start = points_.entries_of().offsets.data(),
          .entries_of = points_.entries_of().indices.data(),
          .rows_from_start = points_.rows_from().offsets.data(),
          .rows_from = points_.rows_from().indices.data(),
          .field = fields_.data(),
          .touch = touches_.data(),
          .response = responses_.data(),
          .force = row_forces_.data(),
          .carries = carries_.data(),
          .share = shares_.data(),
          .dt = dt_};
}

void BodyContacts::find_touches() {
  const ContactPasses passes = this->passes();
  const auto rows = static_cast<Index>(touches_.size());
#pragma omp parallel for schedule(static) num_threads(threads_here())
  for (Index r = 0; r < rows; ++r) passes.find_touch(OneThread{}, r);
}

void BodyContacts::add_depths(std::vector<double>& deepest) const {
  for (std::size_t r = 0; r < touches_.size(); ++r) {
    const Index point = points_.rows()[r].point;
    if (!touches_[r].is_inside || point >= static_cast<Index>(count())) continue;
    double& depth = deepest[part_of(model_, phyxel(point)).body];
    depth = std::max(depth, -touches_[r].gap);
  }
}

void BodyContacts::find_responses() {
  const ContactPasses passes = this->passes();
  const auto rows = static_cast<Index>(touches_.size()),
             points = static_cast<Index>(shares_.size());
#pragma omp parallel num_threads(threads_here())
  {
#pragma omp for schedule(static)
    for (Index p = 0; p < points; ++p) passes.find_share(OneThread{}, p);
#pragma omp for schedule(static)
    for (Index r = 0; r < rows; ++r) passes.find_response(OneThread{}, r);
  }
}

void BodyContacts::find_forces() {
  const ContactPasses passes = this->passes();
  const auto rows = static_cast<Index>(touches_.size());
  forces_.resize(count());
#pragma omp parallel num_threads(threads_here())
  {
#pragma omp for schedule(static)
    for (Index r = 0; r < rows; ++r) passes.find_force(OneThread{}, r);
#pragma omp for schedule(static)
    for (std::size_t p = 0; p < forces_.size(); ++p) {
      forces_[p] = passes.forces_on(OneThread{}, static_cast<Index>(p));
    }
  }
}

void BodyContacts::add_to_sums(std::size_t p, const PointForces& forces) {
  const Index i = phyxel(p);
  const Part& part = part_of(model_, i);
  const Vec3d mean = 0.5 * (motion_[p].earlier + velocity_[p]);
  ContactTerms terms;
  terms.set(dt_ * forces.normal, dt_ * forces.tangential, motion_[p].before - part.centre, mean,
            mean);
  for (int t = 0; t < ContactTerms::count; ++t) {
    sums_[static_cast<std::size_t>(part.body) * ContactTerms::count + t].add(terms.value[t]);
  }
}

std::size_t BodyContacts::bytes() const {
  if (!acts()) return 0;
  std::size_t distances = 0;
  std::set<const DistanceArrays*> counted;
  for (const BodyDistances& of_body : model_.body_contact.distances) {
    const bool is_new = of_body && counted.insert(of_body.arrays.get()).second;
    if (is_new) distances += of_body.arrays->bytes();
  }
  return distances + points_.bytes() + sums_.size() * sizeof(ExactSum) +
         found_at_.size() * sizeof(Vec3d) +
         motion_.size() * (sizeof(SurfaceMotion) + sizeof(Vec3d) + sizeof(double)) +
         touches_.size() * (sizeof(SurfaceTouch) + sizeof(SurfaceResponse) + sizeof(SurfaceForce)) +
         carries_.size() * sizeof(SurfaceShare) + forces_.size() * sizeof(PointForces);
}

}  // namespace phyxel
