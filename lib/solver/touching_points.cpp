#include <algorithm>

#include "solver/body_contacts.hpp"
#include "tabulated.hpp"
#include "timeline.hpp"

namespace phyxel {
namespace {

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

}  // namespace

std::vector<ContactCandidate> TouchingPoints::candidates(std::span<const Vec3d> position,
                                                         double dt) const {
  const int rank = model_.share ? model_.share->communicator->rank() : 0;
  const std::vector<double> gains = layer_.gains(dt);
  std::vector<ContactCandidate> some;
  for (std::size_t k = 0; k < position.size(); ++k) {
    const Index body = layer_.bodies()[k];
    SurfaceSite site = layer_.sites()[k];
    const std::span<const Index> others = reach_.partners.row(body);
    if (std::none_of(others.begin(), others.end(), [&](Index b) {
          return may_be_near(position[k], site.range, skin_of(skins_.data(), body, b),
                             reach_.boxes[b]);
        })) {
      continue;
    }
    site.mobility = gains[k] * site.mobility;
    some.push_back({position[k], site, model_.global_id(layer_.phyxels()[k]), body, rank,
                    static_cast<Index>(k)});
  }
  return of_all_ranks(model_, std::move(some));
}

void TouchingPoints::find(std::span<const Vec3d> position, double dt,
                          std::span<const double> skins) {
  const Phase phase("points that may touch");
  skins_.assign(skins.begin(), skins.end());
  reach_ = layer_.reach_at(position, skins, near_bodies_);
  const std::vector<ContactCandidate> all = candidates(position, dt);
  ContactRows found = find_rows(model_.body_contact, all, skins);
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
  std::vector<std::vector<Index>> receive(wanted.size());
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
        receive[all[k].rank].push_back(number[k]);
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
  if (ranks) exchange_ = {*ranks, wanted, std::move(receive), own_};
}

void TouchingPoints::invert() {
  std::vector<std::pair<Index, Index>> of, from;
  std::vector<Index> row_of_entry;
  for (std::size_t r = 0; r < rows_.rows.size(); ++r) {
    const Index point = rows_.rows[r].point;
    from.emplace_back(point, static_cast<Index>(r));
    for (const Index k : rows_.near_row(r)) {
      of.emplace_back(contact_threads * k + id_[point] % contact_threads,
                      static_cast<Index>(row_of_entry.size()));
      row_of_entry.push_back(static_cast<Index>(r));
    }
  }
  entries_of_ = grouped(contact_threads * site_.size(), of);
  rows_from_ = grouped(site_.size(), from);
  rows_naming_ = tabulated(row_of_entry.size(),
                           [&](std::size_t k) { return row_of_entry[entries_of_.indices[k]]; });
}

std::vector<double> TouchingPoints::wave_moduli() const {
  std::vector<double> modulus = of_own(layer_.wave_moduli());
  modulus.resize(site_.size());
  refresh(modulus);
  return modulus;
}

std::vector<double> TouchingPoints::of_own(const std::vector<double>& of_layer) const {
  return tabulated(own_.size(), [&](std::size_t p) { return of_layer[own_[p]]; });
}

std::size_t TouchingPoints::bytes() const {
  return site_.size() * sizeof(SurfaceSite) + rows_.rows.size() * sizeof(ContactRow) +
         (own_.size() + 2 * id_.size() + 3 * rows_naming_.size() + rows_.rows.size()) *
             sizeof(Index) +
         (rows_.near.offsets.size() + entries_of_.offsets.size() + rows_from_.offsets.size()) *
             sizeof(Offset);
}

}  // namespace phyxel
