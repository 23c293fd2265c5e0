#include "solver/contact_watch.hpp"

#include <algorithm>
#include <cmath>

#include "solver/contact_search.hpp"

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

/// The distance of two boxes along the axis along which it is largest; negative if they overlap.
double distance_between(const Box& a, const Box& b) {
  const auto along = [](double low_a, double high_a, double low_b, double high_b) {
    return std::max(low_a - high_b, low_b - high_a);
  };
  return std::max({along(a.low.x, a.high.x, b.low.x, b.high.x),
                   along(a.low.y, a.high.y, b.low.y, b.high.y),
                   along(a.low.z, a.high.z, b.low.z, b.high.z)});
}

/// True if a box has a point.
bool is_filled(const Box& box) { return box.low.x <= box.high.x; }

/// The largest length of the vectors of a box, 0 for the box of none.
double largest_in(const Box& box) { return is_filled(box) ? largest_difference(box, {}) : 0; }

/// The factor by which speeds may grow until the next look.
constexpr double speeds_may_grow = 2;

/// The longest way in a step of bodies that move against each other at a speed [m/s]; positive.
double way_in_step(double speed, double dt) {
  return std::max(speeds_may_grow * speed * dt, 1e-300);
}

}  // namespace

LayerWatch::LayerWatch(const SurfaceLayer& layer, int threads, int rarest)
    : layer_(layer),
      threads_(std::clamp(static_cast<int>(layer.phyxels().size() / 4000), 1, threads)),
      watch_(rarest),
      skins_(layer.skins(layer.least_skin())),
      ways_(layer.groups().size()) {}

double LayerWatch::skin_for(double speed, double dt) const {
  constexpr int steps = 12;  // three looks of a device
  const double way = way_in_step(speed, dt);
  return std::max(std::clamp(way * steps, layer_.least_skin(), layer_.most_skin()), way);
}

// Phyxels move by half a skin each. Speeds may grow until the next look.
bool LayerWatch::is_late_on_ranks(double dt, int since) {
  double moved = 0, fastest = 0;
  for (const SurfaceWay& way : ways_) {
    moved = std::max(moved, largest_in(way.moved));
    fastest = std::max(fastest, largest_in(way.speeds));
  }
  const Communicator& ranks = *layer_.model().share->communicator;
  moved = ranks.largest(moved);
  fastest = ranks.largest(fastest);
  const double way = way_in_step(fastest, dt);
  // All have the same skin.
  double left = (0.5 * skins_.front() - moved) / way - since;
  const bool is_late = !watch_.has_found(dt) || left < 1;
  if (is_late) {
    watch_.renew(dt);
    skins_ = layer_.skins(skin_for(2 * fastest, dt));
    left = 0.5 * skins_.front() / way;
  }
  watch_.put_off(left);
  return is_late;
}

bool LayerWatch::is_late_here(double dt, int since) {
  const BodyMotions bodies = body_motions();
  const double left = watch_.has_found(dt) ? steps_left(bodies, dt) - since : 0;
  if (left >= 1) {
    watch_.put_off(left);
    return false;
  }
  watch_.renew(dt);
  watch_.put_off(set_skins(bodies, dt));
  return true;
}

LayerWatch::BodyMotions LayerWatch::body_motions() const {
  const std::size_t count = layer_.model().body_contact.distances.size();
  BodyMotions bodies{std::vector(count, no_box), std::vector(count, no_box), reach_.boxes};
  for (std::size_t g = 0; g < ways_.size(); ++g) {
    const Index body = layer_.bodies_of_groups()[g];
    bodies.speeds[body] = together(bodies.speeds[body], ways_[g].speeds);
    bodies.ways[body] = together(bodies.ways[body], ways_[g].moved);
  }
  for (std::size_t b = 0; b < bodies.boxes.size(); ++b) {
    if (is_filled(bodies.boxes[b])) bodies.boxes[b] = sum_of(bodies.boxes[b], bodies.ways[b]);
  }
  return bodies;
}

std::vector<Box> LayerWatch::boxes_after(const BodyMotions& bodies, int steps, double dt) const {
  std::vector<Box> boxes = bodies.boxes;
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    if (is_filled(boxes[b])) {
      boxes[b] =
          together(boxes[b], sum_of(boxes[b], bodies.speeds[b], speeds_may_grow * steps * dt));
    }
  }
  return boxes;
}

template <class Visit>
void LayerWatch::for_each_meeting(std::span<const Box> boxes, Visit&& visit) {
  near_.for_each_overlap(boxes, visit);
  for (std::size_t b = 0; b < boxes.size() && layer_.model().body_contact.self; ++b) {
    if (is_filled(boxes[b])) visit(b, b);
  }
}

double LayerWatch::set_skins(const BodyMotions& bodies, double dt) {
  if (bodies.boxes.empty()) {
    Box all = no_box;
    for (const Box& speeds : bodies.speeds) all = together(all, speeds);
    const double fastest = is_filled(all) ? largest_difference(all, all) : 0,
                 skin = skin_for(fastest, dt);
    skins_ = layer_.skins(skin);
    return skin / way_in_step(fastest, dt);
  }
  std::vector<Box> boxes = boxes_after(bodies, watch_.rarest(), dt);
  for (Box& box : boxes) {
    if (is_filled(box)) box = grown(box, 0.5 * layer_.most_skin());
  }
  /// Bodies that may soon meet, and their relative speed.
  struct Meeting {
    Index a, b;
    double speed;  // [m/s]
  };
  std::vector<Meeting> meetings;
  std::vector<double> fastest(boxes.size(), 0);  // of the meetings of each body [m/s]
  for_each_meeting(boxes, [&](std::size_t a, std::size_t b) {
    const double speed = largest_difference(bodies.speeds[a], bodies.speeds[b]);
    fastest[a] = std::max(fastest[a], speed);
    fastest[b] = std::max(fastest[b], speed);
    meetings.push_back({static_cast<Index>(a), static_cast<Index>(b), speed});
  });
  for (std::size_t b = 0; b < fastest.size(); ++b) skins_[b] = skin_for(fastest[b], dt);
  double steps = HUGE_VAL;
  for (const auto& [a, b, speed] : meetings) {
    steps = std::min(steps, skin_of(skins_.data(), a, b) / way_in_step(speed, dt));
  }
  return steps;
}

double LayerWatch::steps_left(const BodyMotions& bodies, double dt) {
  const BodyContact& contact = layer_.model().body_contact;
  double least = HUGE_VAL;
  for_each_meeting(boxes_after(bodies, watch_.rarest() + 1, dt), [&](std::size_t a, std::size_t b) {
    const auto first = static_cast<Index>(a), second = static_cast<Index>(b);
    const std::span<const Index> near = reach_.partners.row(first);
    const double speed = largest_difference(bodies.speeds[a], bodies.speeds[b]);
    double left = 0;
    if (std::binary_search(near.begin(), near.end(), second)) {
      left = skin_of(skins_.data(), first, second) -
             largest_difference(bodies.ways[a], bodies.ways[b]);
    } else if (contact.law_of(first, second)) {
      left = distance_between(bodies.boxes[a], bodies.boxes[b]);
    } else {
      return;
    }
    least = std::min(least, left / way_in_step(speed, dt));
  });
  return least;
}

}  // namespace phyxel
