#include "partition/share.hpp"

#include <algorithm>

#include "tabulated.hpp"

namespace phyxel {
namespace {

/// The kind of a phyxel for a part, in the order in which a body of a share lists them.
enum Kind : char { absent, owned, ghost };

class Maker {
 public:
  Maker(const Model& whole, const PartHalo& plan, const std::vector<int>& part_of)
      : whole_(whole),
        part_of_(part_of),
        has_lists_(whole.has_lists()),
        kind_(static_cast<std::size_t>(whole.size()), absent),
        here_(kind_.size(), -1) {
    out_.share.global_count = whole.size();
    mark(plan.owned, owned);
    mark(plan.ghosts, ghost);
    for (Index s = 0; s < static_cast<Index>(whole.surfels.position.size()); ++s) {
      if (!has_surfel(s)) continue;
      out_.share.global_surfel_id.push_back(s);
      for (const Index i : whole.surfels.carriers.row(s)) {
        if (kind_[i] == absent) kind_[i] = ghost;
      }
    }
  }

  ModelShare make() {
    Model& m = out_.model;
    m.gravity = whole_.gravity;
    m.degenerate = whole_.degenerate;
    m.warnings = whole_.warnings;
    m.neighbourhood.symmetric = whole_.neighbourhood.symmetric;
    for (const Part& part : whole_.parts) add_part(part);
    add_phyxels();
    add_surfels();
    for (const Motion& motion : whole_.motions) {
      m.motions.push_back(motion);
      m.motions.back().phyxels.clear();
      for (const Index i : motion.phyxels) {
        if (here_[i] >= 0) m.motions.back().phyxels.push_back(here_[i]);
      }
    }
    for (const Load& load : whole_.loads) {
      Load& own = m.loads.emplace_back(load);
      own.phyxels.clear();
      own.force.clear();
      for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
        if (here_[load.phyxels[k]] < 0) continue;
        own.phyxels.push_back(here_[load.phyxels[k]]);
        own.force.push_back(load.force[k]);
      }
    }
    for (const Probe& probe : whole_.probes) {
      Probe& own = m.probes.emplace_back(probe);
      own.phyxels.clear();
      for (const Index i : probe.phyxels) {
        if (here_[i] >= 0) own.phyxels.push_back(here_[i]);
      }
    }
    m.obstacles = whole_.obstacles;
    m.contact = owned_part(whole_.contact);
    m.held_points = whole_.held_points;
    m.body_contact = whole_.body_contact;
    m.body_contact.layer = owned_part(whole_.body_contact.layer);
    m.walls = whole_.walls;
    return std::move(out_);
  }

 private:
  void mark(const std::vector<Index>& phyxels, Kind kind) {
#pragma omp parallel for schedule(static)
    for (std::size_t k = 0; k < phyxels.size(); ++k) kind_[phyxels[k]] = kind;
  }
  /// The part of a contact layer that this rank steps.
  ContactLayer owned_part(const ContactLayer& whole) const {
    ContactLayer own;
    for (std::size_t k = 0; k < whole.phyxels.size(); ++k) {
      const Index i = whole.phyxels[k];
      if (kind_[i] != owned) continue;
      own.phyxels.push_back(here_[i]);
      own.offset.push_back(whole.offset[k]);
    }
    return own;
  }
  bool has_surfel(Index s) const { return kind_[whole_.surfels.carriers.row(s).front()] == owned; }
  Index present() const { return static_cast<Index>(out_.share.global_id.size()); }

  void add_part(const Part& part) {
    Part own = part;
    own.begin = present();
    Index count[ghost + 1] = {};
    for (const Kind kind : {owned, ghost}) {
      const Index first = present();
      const std::vector<Index> found =
          chosen(part.begin, part.end, [&](Index i) { return kind_[i] == kind; });
      count[kind] = static_cast<Index>(found.size());
#pragma omp parallel for schedule(static)
      for (Index k = 0; k < count[kind]; ++k) here_[found[k]] = first + k;
      out_.share.global_id.insert(out_.share.global_id.end(), found.begin(), found.end());
      out_.share.owned.insert(out_.share.owned.end(), found.size(), kind == owned);
    }
    own.end = present();
    own.ghosts = count[ghost];
    const std::vector<Index>& surfels = out_.share.global_surfel_id;
    const auto before = [&](Index end) {
      return static_cast<Index>(std::lower_bound(surfels.begin(), surfels.end(), end) -
                                surfels.begin());
    };
    own.surfel_begin = before(part.surfel_begin);
    own.surfel_end = before(part.surfel_end);
    out_.model.parts.push_back(own);
  }

  /// The values of the share's phyxels, from those of the whole model.
  template <class T>
  std::vector<T> own_of(const std::vector<T>& whole) const {
    const std::vector<Index>& number = out_.share.global_id;
    return tabulated(number.size(), [&](std::size_t k) { return whole[number[k]]; });
  }
  void add_phyxels() {
    Model& m = out_.model;
    Neighbourhood& hood = m.neighbourhood;
    out_.owner = own_of(part_of_);
    m.position = own_of(whole_.position);
    m.volume = own_of(whole_.volume);
    m.mass = own_of(whole_.mass);
    if (!whole_.closing.empty()) m.closing = own_of(whole_.closing);
    m.fracture = whole_.fracture;
    if (whole_.fracture.breaks) m.fracture.growth = own_of(whole_.fracture.growth);
    hood.support = own_of(whole_.neighbourhood.support);
    if (!has_lists_) return;
    m.inverse_moment = own_of(whole_.inverse_moment);
    m.moment_offset = own_of(whole_.moment_offset);
    for (const Index i : out_.share.global_id) {
      add_row(hood.neighbours, whole_.neighbourhood.neighbours, i, kind_[i] == owned);
      if (!hood.symmetric) {
        add_row(hood.inverse_lists, whole_.neighbourhood.inverse_lists, i, kind_[i] == owned);
      }
    }
  }
  void add_row(Csr& to, const Csr& from, Index row, bool filled) const {
    if (filled) {
      for (const Index j : from.row(row)) to.indices.push_back(here_[j]);
    }
    to.offsets.push_back(static_cast<Offset>(to.indices.size()));
  }

  void add_surfels() {
    Surfels& surfels = out_.model.surfels;
    surfels.unreached = whole_.surfels.unreached;
    for (const Index s : out_.share.global_surfel_id) {
      surfels.position.push_back(whole_.surfels.position[s]);
      surfels.normal.push_back(whole_.surfels.normal[s]);
      add_row(surfels.carriers, whole_.surfels.carriers, s, true);
    }
  }

  const Model& whole_;
  const std::vector<int>& part_of_;
  bool has_lists_;
  std::vector<char> kind_;   // kind of each phyxel of the whole model
  std::vector<Index> here_;  // its index in the share, or -1
  ModelShare out_;
};

}  // namespace

ModelShare share_of(const Model& whole, const PartHalo& plan, const std::vector<int>& part_of) {
  return Maker(whole, plan, part_of).make();
}

}  // namespace phyxel
