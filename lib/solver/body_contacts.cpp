#include "solver/body_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "mesh/distance_field.hpp"
#include "model/parts.hpp"
#include "solver/contact_stiffness.hpp"

namespace phyxel {
BodyContacts::BodyContacts(const Model& model, int threads)
    : model_(model),
      threads_(threads),
      layer_(model),
      points_(layer_),
      watch_(layer_, threads),
      pushes_(has_body_penalties(model)) {
  if (!acts()) return;
  rubs_ = pushes_ && has_body_friction(model.body_contact);
  sums_.resize(ContactTerms::count * model.body_contact.distances.size());
  for (const BodyDistances& distances : model.body_contact.distances) {
    fields_.push_back(distances ? distances.view() : PlacedDistances{});
  }
}

void BodyContacts::find_points(std::vector<Vec3d> position, double dt) {
  points_.find(position, dt, watch_.skins());
  watch_.found(std::move(position), points_.reach());
  const std::size_t points = points_.sites().size(), rows = points_.rows().size();
  motion_.assign(points, {});
  velocity_.assign(points, {});
  touches_.assign(rows, {});
  is_inside_.assign(rows, 0);
  responses_.assign(rows, {});
  row_forces_.assign(rows, {});
  carries_.assign(points_.near().indices.size(), {});
  carriers_.assign(carries_.size(), {});
  carrier_counts_.assign(contact_threads * points, 0);
  in_patch_.assign(points_.have_patches() ? carries_.size() : 0, 1);
  shares_.assign(points, 0);
  wakes_.assign(rows, 0);
  place_.assign(points, {});
  way_ = {};
  is_active_.assign(points, 0);
  forces_.assign(count(), {});
  totals_.assign(count(), {});
  active_.clear();
  own_active_.clear();
  if (!pushes_) return;
  modulus_ = points_.wave_moduli();
  regain_ = points_.regains(dt);
}

void BodyContacts::set_gradient(std::size_t p, const Mat3d& gradient) {
  phyxel::set_gradient(motion_[p], points_.sites()[p], gradient);
}

int BodyContacts::threads_here() const {
  return std::clamp(static_cast<int>(points_.rows().size() / 200), 1, threads_);
}

ContactPasses BodyContacts::passes() {
  return {.site = points_.sites().data(),
          .motion = motion_.data(),
          .velocity = velocity_.data(),
          .row = points_.rows().data(),
          .near_start = points_.near().offsets.data(),
          .near = points_.near().indices.data(),
          .entries_of_start = points_.entries_of().offsets.data(),
          .entries_of = points_.entries_of().indices.data(),
          .rows_naming = points_.rows_naming().data(),
          .rows_from_start = points_.rows_from().offsets.data(),
          .rows_from = points_.rows_from().indices.data(),
          .field = fields_.data(),
          .touch = touches_.data(),
          .response = responses_.data(),
          .force = row_forces_.data(),
          .carries = carries_.data(),
          .carriers = carriers_.data(),
          .carrier_count = carrier_counts_.data(),
          .in_patch = in_patch_.empty() ? nullptr : in_patch_.data(),
          .share = shares_.data(),
          .wakes = wakes_.data(),
          .way = &way_,
          .is_inside = is_inside_.data(),
          .dt = dt_};
}

void BodyContacts::find_way() {
  double most = 0;
#pragma omp parallel for schedule(static) reduction(max : most) num_threads(threads_here())
  for (std::size_t p = 0; p < place_.size(); ++p) {
    const Vec3d way = motion_[p].after - place_[p];
    most = std::max(most, dot(way, way));
    place_[p] = motion_[p].after;
  }
  way_.before += std::sqrt(most);
}

void BodyContacts::find_touches() {
  const ContactPasses passes = this->passes();
  const auto rows = static_cast<Index>(touches_.size());
#pragma omp parallel for schedule(dynamic, 64) num_threads(threads_here())
  for (Index r = 0; r < rows; ++r) {
    passes.find_touch(OneThread{}, r);
  }
}

void BodyContacts::add_depths(std::vector<double>& deepest) const {
  for (std::size_t r = 0; r < touches_.size(); ++r) {
    const Index point = points_.rows()[r].point;
    if (!touches_[r].is_inside || point >= static_cast<Index>(count())) continue;
    const Index body = points_.bodies()[point], other = points_.rows()[r].body;
    const std::vector<double>& ranges = layer_.ranges_of_bodies();
    const double depth = -touches_[r].gap, share = depth / std::min(ranges[body], ranges[other]);
    deepest[body] = std::max(deepest[body], depth);
    double& deepest_share = deepest[ranges.size() + static_cast<std::size_t>(body)];
    deepest_share = std::max(deepest_share, share);
  }
}

void BodyContacts::find_active() {
  for (const Index p : active_) is_active_[p] = 0;
  inside_.clear();
  active_.clear();
  own_active_.clear();
  const auto add = [&](Index p) {
    if (is_active_[p]) return;
    is_active_[p] = 1;
    active_.push_back(p);
    if (p < static_cast<Index>(count())) own_active_.push_back(p);
  };
  for (std::size_t r = 0; r < is_inside_.size(); ++r) {
    if (!is_inside_[r]) continue;
    inside_.push_back(static_cast<Index>(r));
    add(points_.rows()[r].point);
    for (const Index p : points_.near_row(r)) add(p);
  }
  const ContactPasses passes = this->passes();
#pragma omp parallel for schedule(static) num_threads(threads_here())
  for (std::size_t k = 0; k < active_.size(); ++k) passes.find_carriers(OneThread{}, active_[k]);
}

void BodyContacts::find_responses() {
  const ContactPasses passes = this->passes();
#pragma omp parallel num_threads(threads_here())
  {
#pragma omp for schedule(static)
    for (std::size_t k = 0; k < active_.size(); ++k) passes.find_share(OneThread{}, active_[k]);
#pragma omp for schedule(static)
    for (std::size_t k = 0; k < inside_.size(); ++k) passes.find_response(OneThread{}, inside_[k]);
  }
}

template <class Passes, class Find>
void BodyContacts::find_forces_by(const Passes& passes, Find&& find) {
#pragma omp parallel num_threads(threads_here())
  {
#pragma omp for schedule(static)
    for (std::size_t k = 0; k < inside_.size(); ++k) find(passes, inside_[k]);
#pragma omp for schedule(static)
    for (std::size_t k = 0; k < own_active_.size(); ++k) {
      forces_[own_active_[k]] = passes.forces_on(OneThread{}, own_active_[k]);
    }
  }
}

void BodyContacts::find_forces() {
  find_forces_by(passes(), [](const auto& of, Index r) { of.find_force(OneThread{}, r); });
}

void BodyContacts::find_pushes() {
  find_forces_by(penalties(), [](const auto& of, Index r) { of.find_push(OneThread{}, r); });
}

void BodyContacts::find_rubs() {
  find_forces_by(penalties(), [](const auto& of, Index r) { of.find_rub(OneThread{}, r); });
}

PenaltyPasses BodyContacts::penalties() {
  return {passes(), modulus_.data(), share_of_layer * model_.body_contact.penalty};
}

void BodyContacts::add_push_energy(ExactSum& sum) {
  const PenaltyPasses passes = penalties();
  for (const Index r : inside_) {
    if (points_.rows()[r].point < static_cast<Index>(count())) sum.add(passes.energy(r));
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
  return distances + layer_.bytes() + points_.bytes() + sums_.size() * sizeof(ExactSum) +
         watch_.bytes() +
         motion_.size() * (sizeof(SurfaceMotion) + 2 * sizeof(Vec3d) + sizeof(double)) +
         touches_.size() * (sizeof(SurfaceTouch) + sizeof(SurfaceResponse) + sizeof(SurfaceForce)) +
         carries_.size() * sizeof(SurfaceShare) + carriers_.size() * sizeof(SurfaceCarrier) +
         carrier_counts_.size() * sizeof(Index) + in_patch_.size() +
         wakes_.size() * sizeof(double) + 2 * forces_.size() * sizeof(PointForces) +
         (modulus_.size() + regain_.size()) * sizeof(double);
}

}  // namespace phyxel
