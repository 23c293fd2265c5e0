#include "solver/contact_watch.hpp"

#include <algorithm>
#include <cmath>

#include "model/box_overlaps.hpp"

namespace phyxel {
namespace {

/// The vectors of one box plus those of another one, `times` over.
Box sum_of(const Box& a, const Box& b, double times = 1) {
  return {a.low + times * b.low, a.high + times * b.high};
}

/// The largest length of the difference of a vector of one box and one of another box.
double largest_difference(const Box& a, const Box& b) {
  const auto along = [](double low_a, double high_a, double low_b, double high_b) {
    return std::max(std::abs(high_a - low_b), std::abs(high_b - low_a));
  };
  return norm(Vec3d{along(a.low.x, a.high.x, b.low.x, b.high.x),
                    along(a.low.y, a.high.y, b.low.y, b.high.y),
                    along(a.low.z, a.high.z, b.low.z, b.high.z)});
}

/// The largest length of the vectors of a box, 0 for the box of none.
double largest_in(const Box& box) {
  return box.low.x > box.high.x ? 0 : largest_difference(box, {});
}

}  // namespace

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

LayerWatch::LayerWatch(const SurfaceLayer& layer, int threads, int rarest)
    : layer_(layer),
      threads_(std::clamp(static_cast<int>(layer.phyxels().size() / 4000), 1, threads)),
      watch_(rarest),
      ways_(layer.groups().size()) {}

bool LayerWatch::is_late_on_ranks(double dt, double skin) {
  double moved = 0, fastest = 0;
  for (const SurfaceWay& way : ways_) {
    moved = std::max(moved, largest_in(way.moved));
    fastest = std::max(fastest, largest_in(way.speeds));
  }
  return watch_.look(layer_.model(), moved, fastest, skin, dt);
}

bool LayerWatch::is_late_here(double dt, double skin) {
  const bool is_late = !watch_.has_found(dt) || have_come_near(dt, skin);
  if (is_late) watch_.renew(dt);
  watch_.put_off();
  return is_late;
}

// Until the next look, the speeds of bodies against each other may double.
bool LayerWatch::have_come_near(double dt, double skin) const {
  const BodyContact& contact = layer_.model().body_contact;
  std::vector<Box> ways(reach_.boxes.size(), no_box);  // up to the next look
  const double span = watch_.rarest() * dt;
  for (std::size_t g = 0; g < ways_.size(); ++g) {
    const Box way = sum_of(ways_[g].moved, ways_[g].speeds, 2 * span);
    Box& of_body = ways[layer_.bodies()[layer_.groups()[g].begin]];
    extend(of_body, way.low);
    extend(of_body, way.high);
  }
  std::vector<Box> boxes = reach_.boxes;
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    if (boxes[b].low.x <= boxes[b].high.x) boxes[b] = sum_of(boxes[b], ways[b]);
  }
  bool is_late = false;
  const auto look_at = [&](std::size_t a, std::size_t b) {
    const auto first = static_cast<Index>(a), second = static_cast<Index>(b);
    const std::vector<Index>& near = reach_.partners[a];
    const bool were_near = std::binary_search(near.begin(), near.end(), second);
    is_late = is_late || (were_near ? largest_difference(ways[a], ways[b]) > skin
                                    : contact.law_of(first, second) != nullptr);
  };
  for_each_overlap(boxes, look_at);
  for (std::size_t b = 0; b < boxes.size() && contact.self; ++b) {
    if (boxes[b].low.x <= boxes[b].high.x) look_at(b, b);
  }
  return is_late;
}

}  // namespace phyxel
