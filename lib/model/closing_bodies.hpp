/// The bodies whose gradients are closed, and where the search of each stands.
#pragma once

#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel::closing {

/// The numbers of a body that loops over its phyxels read.
struct Standing {
  double tolerance = 0;
  double unit = 1, volume = 1;  ///< s² [m²] and the volume of all phyxels [m³].
  double pair_length = 0;       ///< `Part::pair_length` [m].
  double areas = 0;             ///< Σ S², per s⁴ ρ⁴.
  double residual_squared = 0, gradient_squared = 0, next_gradient_squared = 0, image_squared = 0;
  double sum = 0, mean = 0;  ///< Sum and mean of the changes of volumes.
  double sought_volume = 0;  ///< Volume of the phyxels that have unknowns [m³].
};

/// A body whose gradients are closed.
struct Body : Standing {
  Body(std::span<Part> of_body, double closed_to) : parts(of_body) { tolerance = closed_to; }

  std::span<Part> parts;
  bool is_limited = false;  ///< True if some phyxels have no unknowns.
  double left = 0;          ///< Root mean square of the sums over that of the areas.
  double left_first = 0, left_before = HUGE_VAL;
  int iterations = 0;

  Index begin() const { return parts.front().begin; }
  Index end() const { return parts.back().end; }
};

/// Bodies in the order of their phyxels. Every rank has the same.
class Bodies {
 public:
  explicit Bodies(std::span<Body> bodies) {
    for (Body& body : bodies) list_.push_back(&body);
  }
  bool empty() const { return list_.empty(); }
  std::size_t size() const { return list_.size(); }
  Body& operator[](std::size_t b) const { return *list_[b]; }
  auto begin() const { return list_.begin(); }
  auto end() const { return list_.end(); }
  /// Leaves out bodies for which done(body).
  template <class Done>
  void erase_if(Done&& done) {
    std::erase_if(list_, [&](Body* body) { return done(*body); });
  }
  friend bool operator==(const Bodies&, const Bodies&) = default;

 private:
  std::vector<Body*> list_;
};

}  // namespace phyxel::closing
