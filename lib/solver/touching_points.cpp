#include <algorithm>
#include <cmath>

#include "mesh/distance_field.hpp"
#include "model/body_contact.hpp"
#include "model/box_overlaps.hpp"
#include "model/parts.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/physics/verlet.hpp"
#include "rank_exchange.hpp"
#include "solver/body_contacts.hpp"
#include "solver/boundary_conditions.hpp"
#include "timeline.hpp"

namespace phyxel {
namespace {

constexpr double share_of_range = 0.25;  // of the skin

/// Adds the points of rows that have a chosen one to those. @returns which rows these are
std::vector<char> spread(const ContactRows& rows, std::vector<char>& chosen) {
  std::vector<char> touched(rows.rows.size());
  const std::vector<char> before = chosen;
  for (std::size_t r = 0; r < rows.rows.size(); ++r) {
    const std::span<const Index> near = rows.near_row(r);
    const Index point = rows.rows[r].point;
    touched[r] = before[point] ||
                 std::any_of(near.begin(), near.end(), [&](Index k) { return before[k] != 0; });
    if (!touched[r]) continue;
    chosen[point] = 1;
    for (const Index k : near) chosen[k] = 1;
  }
  return touched;
}

/// Sets where a phyxel's distance from other bodies is looked up, and the level of its surface,
/// from the distances of places around it from its own body's surface.
void look_around(SurfaceSite& site, const PlacedDistances& own) {
  const double spacing = 0.45 * site.range;
  const auto slope = [&](Vec3d way) {
    return (own.gap(site.rest + spacing * way).distance -
            own.gap(site.rest - spacing * way).distance) /
           (2 * spacing);
  };
  const Vec3d normal{slope({1, 0, 0}), slope({0, 1, 0}), slope({0, 0, 1})};
  const double size = norm(normal);
  if (!(size > 0.1)) return;                             // a body so thin that it has no inside
  constexpr double share_of_spacing = 0.5, flat = 0.95;  // at an edge of a box, the size is 0.71
  site.inward = (-share_of_spacing * spacing / size) * normal;
  if (site.offset == 0 && size > flat) site.level = own.gap(site.rest).distance;
}

}  // namespace

TouchingPoints::TouchingPoints(const Model& model) : model_(model) {
  const ContactLayer& layer = model.body_contact.layer;
  if (!model.body_contact.acts()) return;
  double least = HUGE_VAL;
  for (const Index i : layer.phyxels) {
    least = std::min(least, model.neighbourhood.support[i]);
  }
  const std::vector<Vec3d> free = free_axes(model);
  for (std::size_t k = 0; k < layer.phyxels.size(); ++k) {
    const Index i = layer.phyxels[k];
    const double range = model.neighbourhood.support[i];
    SurfaceSite site{.rest = model.position[i],
                     .mobility = free.empty() ? Vec3d{1, 1, 1} : free[i],
                     .area = model.volume[i] / range,
                     .offset = layer.offset[k],
                     .range = range};
    look_around(site, model.body_contact.distances[part_of(model, i).body].view());
    layer_.push_back(site);
  }
  if (model.share) least = model.share->communicator->smallest(least);
  skin_ = share_of_range * least;
}

std::vector<ContactCandidate> TouchingPoints::candidates(std::span<const Vec3d> position,
                                                         double dt) const {
  const BodyContact& contact = model_.body_contact;
  const std::vector<Box> boxes = boxes_of_bodies(model_, position, layer_, skin_);
  const std::vector<std::vector<Index>> partners = partners_of_bodies(contact, boxes);
  const int rank = model_.share ? model_.share->communicator->rank() : 0;
  std::vector<ContactCandidate> some;
  for (std::size_t k = 0; k < position.size(); ++k) {
    const Index i = contact.layer.phyxels[k];
    const Part& part = part_of(model_, i);
    const Box around = grown({position[k], position[k]}, layer_[k].range + 0.5 * skin_);
    const std::vector<Index>& others = partners[part.body];
    if (std::none_of(others.begin(), others.end(),
                     [&](Index b) { return overlap(around, boxes[b]); })) {
      continue;
    }
    SurfaceSite site = layer_[k];
    site.mobility = damped_flow(part.material.damping, dt).gain / model_.mass[i] * site.mobility;
    some.push_back(
        {position[k], site, model_.global_id(i), part.body, rank, static_cast<Index>(k)});
  }
  if (!model_.share) return some;
  const Communicator& ranks = *model_.share->communicator;
  std::vector<ContactCandidate> all;
  for (const auto& of_rank :
       exchanged(ranks, std::vector(static_cast<std::size_t>(ranks.size()), some))) {
    all.insert(all.end(), of_rank.begin(), of_rank.end());
  }
  std::sort(all.begin(), all.end(),
            [](const ContactCandidate& a, const ContactCandidate& b) { return a.id < b.id; });
  return all;
}

void TouchingPoints::find(std::span<const Vec3d> position, double dt) {
  const Phase phase("points that may touch");
  const std::vector<ContactCandidate> all = candidates(position, dt);
  ContactRows found = find_rows(model_.body_contact, all, skin_);
  any_ = !found.rows.empty();
  keep_what_counts(all, std::move(found));
  invert();
}

// The force on a point of this rank needs the forces of all rows that it is in, these the shares of
// all points of these rows, and these all rows that those are in.
void TouchingPoints::keep_what_counts(const std::vector<ContactCandidate>& all, ContactRows found) {
  const Communicator* ranks = model_.share ? model_.share->communicator : nullptr;
  const int rank = ranks ? ranks->rank() : 0;
  std::vector<char> in_rows(all.size()), chosen(all.size());
  for (const ContactRow& row : found.rows) in_rows[row.point] = 1;
  for (const Index k : found.near.indices) in_rows[k] = 1;
  for (std::size_t k = 0; k < all.size(); ++k) chosen[k] = in_rows[k] && all[k].rank == rank;
  spread(found, chosen);
  const std::vector<char> kept = spread(found, chosen);

  own_.clear();
  site_.clear();
  id_.clear();
  body_.clear();
  std::vector<Index> number(all.size(), -1);
  std::vector<std::vector<Index>> wanted(ranks ? static_cast<std::size_t>(ranks->size()) : 0);
  receive_.assign(wanted.size(), {});
  for (const bool of_this_rank : {true, false}) {
    for (std::size_t k = 0; k < all.size(); ++k) {
      if (!chosen[k] || (all[k].rank == rank) != of_this_rank) continue;
      number[k] = static_cast<Index>(site_.size());
      site_.push_back(all[k].site);
      id_.push_back(all[k].id);
      body_.push_back(all[k].body);
      if (of_this_rank) {
        own_.push_back(all[k].place);
      } else {
        wanted[all[k].rank].push_back(all[k].place);
        receive_[all[k].rank].push_back(number[k]);
      }
    }
  }
  rows_ = {};
  for (std::size_t r = 0; r < found.rows.size(); ++r) {
    if (!kept[r]) continue;
    ContactRow row = found.rows[r];
    row.point = number[row.point];
    rows_.rows.push_back(row);
    for (const Index k : found.near_row(r)) rows_.near.indices.push_back(number[k]);
    const Offset* start = found.near.offsets.data() + contact_threads * r;
    for (int part = 0; part < contact_threads; ++part) {
      rows_.near.offsets.push_back(rows_.near.offsets.back() + start[part + 1] - start[part]);
    }
  }
  if (!ranks) return;
  std::vector<Index> own_number(layer_.size(), -1);
  for (std::size_t p = 0; p < own_.size(); ++p) own_number[own_[p]] = static_cast<Index>(p);
  send_ = exchanged(*ranks, wanted);
  for (std::vector<Index>& places : send_) {
    for (Index& place : places) place = own_number[place];
  }
}

void TouchingPoints::invert() {
  std::vector<std::pair<Index, Index>> of, from;
  row_of_entry_.clear();
  for (std::size_t r = 0; r < rows_.rows.size(); ++r) {
    const Index point = rows_.rows[r].point;
    from.emplace_back(point, static_cast<Index>(r));
    for (const Index k : rows_.near_row(r)) {
      of.emplace_back(contact_threads * k + id_[point] % contact_threads,
                      static_cast<Index>(row_of_entry_.size()));
      row_of_entry_.push_back(static_cast<Index>(r));
    }
  }
  entries_of_ = grouped(contact_threads * site_.size(), of);
  rows_from_ = grouped(site_.size(), from);
}

template <class T>
void TouchingPoints::refresh(std::vector<T>& of_points) const {
  if (!model_.share) return;
  std::vector<std::vector<T>> sent(send_.size());
  for (std::size_t r = 0; r < send_.size(); ++r) {
    for (const Index p : send_[r]) sent[r].push_back(of_points[p]);
  }
  const auto received = exchanged(*model_.share->communicator, sent);
  for (std::size_t r = 0; r < receive_.size(); ++r) {
    for (std::size_t k = 0; k < receive_[r].size(); ++k) {
      of_points[receive_[r][k]] = received[r][k];
    }
  }
}
template void TouchingPoints::refresh(std::vector<SurfaceMotion>&) const;
template void TouchingPoints::refresh(std::vector<Vec3d>&) const;
template void TouchingPoints::refresh(std::vector<double>&) const;

std::vector<double> TouchingPoints::wave_moduli() const {
  std::vector<double> modulus(site_.size());
  for (std::size_t p = 0; p < own_.size(); ++p) {
    const Index i = model_.body_contact.layer.phyxels[own_[p]];
    modulus[p] = wave_stiffness_at_rest(part_of(model_, i).material);
  }
  refresh(modulus);
  return modulus;
}

std::vector<double> TouchingPoints::regains(double dt) const {
  std::vector<double> regain;
  for (const Index k : own_) {
    const Part& part = part_of(model_, model_.body_contact.layer.phyxels[k]);
    regain.push_back(1 / damped_flow(part.material.damping, dt).keep);
  }
  return regain;
}

std::size_t TouchingPoints::bytes() const {
  return (layer_.size() + site_.size()) * sizeof(SurfaceSite) +
         rows_.rows.size() * sizeof(ContactRow) +
         (own_.size() + 2 * id_.size() + 3 * row_of_entry_.size() + rows_.rows.size()) *
             sizeof(Index) +
         (rows_.near.offsets.size() + entries_of_.offsets.size() + rows_from_.offsets.size()) *
             sizeof(Offset);
}

}  // namespace phyxel
