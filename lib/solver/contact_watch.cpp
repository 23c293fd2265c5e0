#include "solver/contact_watch.hpp"

#include <algorithm>
#include <cmath>

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

/// True if a box has a point.
bool is_filled(const Box& box) { return box.low.x <= box.high.x; }

/// The largest length of the vectors of a box, 0 for the box of none.
double largest_in(const Box& box) { return is_filled(box) ? largest_difference(box, {}) : 0; }

/// The factor by which speeds may grow until the next look.
constexpr double speeds_may_grow = 2;

}  // namespace

LayerWatch::LayerWatch(const SurfaceLayer& layer, int threads, double widest, int rarest)
    : layer_(layer),
      threads_(std::clamp(static_cast<int>(layer.phyxels().size() / 4000), 1, threads)),
      watch_(rarest),
      widest_(std::max(widest, layer.least_skin())),
      skin_(layer.least_skin()),
      ways_(layer.groups().size()) {}

void LayerWatch::set_skin(double speed, double dt) {
  const int steps = 4 * watch_.rarest() + 8;        // some looks, and some steps more
  const double way = speeds_may_grow * speed * dt;  // in a step
  skin_ = std::max(std::clamp(way * steps, layer_.least_skin(), widest_), way);
}

// Phyxels move by half a skin each. Speeds may grow until the next look.
bool LayerWatch::is_late_on_ranks(double dt) {
  double moved = 0, fastest = 0;
  for (const SurfaceWay& way : ways_) {
    moved = std::max(moved, largest_in(way.moved));
    fastest = std::max(fastest, largest_in(way.speeds));
  }
  const Communicator& ranks = *layer_.model().share->communicator;
  moved = ranks.largest(moved);
  fastest = ranks.largest(fastest);
  const double way = speeds_may_grow * fastest * dt;
  const bool is_late = !watch_.has_found(dt) || moved + way > 0.5 * skin_;
  if (is_late) {
    moved = 0;
    watch_.renew(dt);
    set_skin(2 * fastest, dt);
  }
  watch_.put_off((0.5 * skin_ - moved) / std::max(way, 1e-300));
  return is_late;
}

bool LayerWatch::is_late_here(double dt) {
  const BodyMotions bodies = body_motions(dt);
  if (watch_.has_found(dt) && !have_come_near(bodies)) {
    watch_.put_off();
    return false;
  }
  const double fastest = fastest_meeting(bodies);
  watch_.renew(dt);
  set_skin(fastest, dt);
  watch_.put_off(skin_ / std::max(speeds_may_grow * fastest * dt, 1e-300));
  return true;
}

LayerWatch::BodyMotions LayerWatch::body_motions(double dt) const {
  const std::size_t count = layer_.model().body_contact.distances.size();
  BodyMotions bodies{std::vector(count, no_box), std::vector(count, no_box), reach_.boxes};
  for (std::size_t g = 0; g < ways_.size(); ++g) {
    const Index body = layer_.bodies_of_groups()[g];
    bodies.speeds[body] = together(bodies.speeds[body], ways_[g].speeds);
    bodies.ways[body] = together(bodies.ways[body], ways_[g].moved);
  }
  const double span = speeds_may_grow * watch_.rarest() * dt;
  for (std::size_t b = 0; b < bodies.boxes.size(); ++b) {
    if (!is_filled(bodies.boxes[b])) continue;
    bodies.ways[b] = sum_of(bodies.ways[b], bodies.speeds[b], span);
    bodies.boxes[b] = sum_of(bodies.boxes[b], bodies.ways[b]);
  }
  return bodies;
}

template <class Visit>
void LayerWatch::for_each_meeting(std::span<const Box> boxes, Visit&& visit) {
  near_.for_each_overlap(boxes, visit);
  for (std::size_t b = 0; b < boxes.size() && layer_.model().body_contact.self; ++b) {
    if (is_filled(boxes[b])) visit(b, b);
  }
}

double LayerWatch::fastest_meeting(const BodyMotions& bodies) {
  if (bodies.boxes.empty()) {
    Box all = no_box;
    for (const Box& speeds : bodies.speeds) all = together(all, speeds);
    return is_filled(all) ? largest_difference(all, all) : 0;
  }
  std::vector<Box> boxes = bodies.boxes;
  for (Box& box : boxes) {
    if (is_filled(box)) box = grown(box, 0.5 * layer_.most_skin());
  }
  double fastest = 0;
  for_each_meeting(boxes, [&](std::size_t a, std::size_t b) {
    fastest = std::max(fastest, largest_difference(bodies.speeds[a], bodies.speeds[b]));
  });
  return fastest;
}

bool LayerWatch::have_come_near(const BodyMotions& bodies) {
  const BodyContact& contact = layer_.model().body_contact;
  bool is_late = false;
  for_each_meeting(bodies.boxes, [&](std::size_t a, std::size_t b) {
    const auto first = static_cast<Index>(a), second = static_cast<Index>(b);
    const std::span<const Index> near = reach_.partners.row(first);
    const bool were_near = std::binary_search(near.begin(), near.end(), second);
    is_late = is_late || (were_near ? largest_difference(bodies.ways[a], bodies.ways[b]) > skin_
                                    : contact.law_of(first, second) != nullptr);
  });
  return is_late;
}

}  // namespace phyxel
