#include "view/live_picture.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <span>

#include "compose.hpp"
#include "phyxel/history.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/point_fields.hpp"
#include "program_ranks.hpp"
#include "report/thinning.hpp"

namespace phyxel::app {
namespace {

static_assert(std::endian::native == std::endian::little, "frames are little-endian");
static_assert(sizeof(FrameHead) % 8 == 0);

/// Distance to carriers, over the distance between phyxels.
constexpr double reach = 1.6;
/// Fields that all scenes have; those of history follow.
enum : std::size_t { displacement, speed, von_mises, volume_ratio, always };

/// Vectors of the whole model, on the first rank. Collective.
std::vector<Vec3d> whole(const SharedModel& shared, Quantity quantity,
                         const std::vector<Vec3d>& here, Index count) {
  constexpr Index length = ChunkedSource::usual_length;
  const std::span<const double> numbers(&here.data()->x, 3 * here.size());
  std::vector<Vec3d> all;
  for (Index begin = 0; begin < count; begin += std::min(length, count - begin)) {
    const std::vector<double> chunk =
        shared.gathered(quantity, numbers, begin, begin + std::min(length, count - begin));
    for (std::size_t k = 0; k + 2 < chunk.size(); k += 3) {
      all.push_back({chunk[k], chunk[k + 1], chunk[k + 2]});
    }
  }
  return all;
}

/// The phyxels and the surfels of a body of a whole model: [begin, end).
struct BodyRange {
  Index body = 0;
  std::size_t phyxel_begin = 0, phyxel_end = 0, surfel_begin = 0, surfel_end = 0;
};

std::vector<BodyRange> ranges_of(const Model& model) {
  std::vector<BodyRange> ranges;
  std::size_t phyxel = 0, surfel = 0;
  for (const Part& part : model.parts) {
    if (ranges.empty() || ranges.back().body != part.body) {
      ranges.push_back({part.body, phyxel, phyxel, surfel, surfel});
    }
    phyxel += static_cast<std::size_t>(part.size);
    surfel += static_cast<std::size_t>(part.surfels);
    ranges.back().phyxel_end = phyxel;
    ranges.back().surfel_end = surfel;
  }
  return ranges;
}

/// A range of numbers of frames, in which 16 bits count.
struct Quantised {
  double middle = 0, half = 0;
  static constexpr double steps = 32767;

  std::int16_t step_of(double value) const {
    if (!std::isfinite(value) || half == 0) return 0;
    return static_cast<std::int16_t>(
        std::lrint(std::clamp((value - middle) / half, -1.0, 1.0) * steps));
  }
};

/// The range of column c of rows of numbers, shape [n, each].
Quantised scale_of(std::span<const float> rows, std::size_t each, std::size_t c) {
  float low = std::numeric_limits<float>::infinity(), high = -low;
  for (std::size_t k = c; k < rows.size(); k += each) {
    if (!std::isfinite(rows[k])) continue;
    low = std::min(low, rows[k]);
    high = std::max(high, rows[k]);
  }
  if (low > high) return {};
  return {(double{low} + high) / 2, (double{high} - low) / 2};
}

/// The values of a field on all phyxels of this rank. @param field one that motions do not tell
std::vector<double> values_of(const LiveScene& live, std::size_t field) {
  const auto found = [&](Quantity quantity) {
    return find_fields(live.model(), live.backend(), {{quantity}})[quantity];
  };
  if (field == von_mises) return found(Quantity::von_mises);
  State state;
  live.backend().download(state);
  const std::size_t column = field - always;
  if (column < state.history.size()) return state.history[column].values;
  return found(Quantity::broken);
}

/// The values of a field on some phyxels of this rank. @param field its number; below 0 for none
std::vector<double> values_of(const LiveScene& live, const std::vector<Index>& phyxels,
                              const std::vector<PhyxelMotion>& motions, std::int32_t field) {
  std::vector<double> values(phyxels.size());
  const auto set = [&](auto&& value_of) {
    std::transform(motions.begin(), motions.end(), values.begin(), value_of);
  };
  if (field < 0) return values;
  const auto number = static_cast<std::size_t>(field);
  if (number == displacement) {
    set([](const PhyxelMotion& motion) { return norm(motion.displacement); });
  } else if (number == speed) {
    set([](const PhyxelMotion& motion) { return norm(motion.velocity); });
  } else if (number == volume_ratio) {
    set([](const PhyxelMotion& motion) { return 1 + volume_change(motion.gradient); });
  } else {
    const std::vector<double> all = values_of(live, number);
    std::transform(phyxels.begin(), phyxels.end(), values.begin(), [&](Index i) { return all[i]; });
  }
  return values;
}

/// Numbers of a phyxel that ranks send: displacement, gradient, field.
constexpr std::size_t sent_each = 13;
/// Phyxels from which on several threads make a frame.
constexpr std::size_t worth_threads = 10'000;

void append(std::string& text, const void* data, std::size_t size) {
  text.append(static_cast<const char*>(data), size);
}

}  // namespace

LivePicture::LivePicture(const LiveScene& live) {
  const Model& model = live.model();
  fields_ = {
      {"displacement", "m"}, {"speed", "m/s"}, {"stress (von Mises)", "Pa"}, {"volume ratio", ""}};
  for (const std::string& name : history_columns(model)) fields_.push_back({name, ""});
  if (model.fracture.acts()) fields_.push_back({"broken share of pairs", ""});
  const std::vector<Vec3d> rest =
      whole(live.shared(), Quantity::position, model.position, model.global_count());
  surfels_ = whole(live.shared(), Quantity::surfel_position, model.surfels.position,
                   model.global_surfel_count());
  if (all_ranks().leads()) choose_surfels(live, rest);
  ids_ = ranks().broadcast(ids_);
  find_rows(model);
}

void LivePicture::choose_surfels(const LiveScene& live, const std::vector<Vec3d>& rest) {
  FrameData surface;
  surface.point = std::move(surfels_);
  surface.triangle.assign(live.shared().triangles().begin(), live.shared().triangles().end());
  std::vector<std::uint16_t> bodies(rest.size());
  const std::vector<BodyRange> ranges = ranges_of(live.model());
  for (const BodyRange& range : ranges) {
    surface.body.resize(range.surfel_end, range.body);
    std::fill(bodies.begin() + static_cast<std::ptrdiff_t>(range.phyxel_begin),
              bodies.begin() + static_cast<std::ptrdiff_t>(range.phyxel_end),
              static_cast<std::uint16_t>(range.body));
  }
  const ThinnedSurface thin = thinned(surface, std::max(most_surfels, ranges.size()));
  triangles_ = thin.triangle;
  surfels_.clear();
  for (const std::size_t s : thin.surfel) {
    surfels_.push_back(surface.point[s]);
    surfel_bodies_.push_back(static_cast<std::uint16_t>(surface.body[s]));
  }
  // A surfel follows phyxels of its own body alone, whatever touches it.
  std::size_t done = 0;
  for (const BodyRange& range : ranges) {
    const std::vector<Vec3d> around(rest.begin() + static_cast<std::ptrdiff_t>(range.phyxel_begin),
                                    rest.begin() + static_cast<std::ptrdiff_t>(range.phyxel_end));
    const double apart = typical_spacing(around);
    spacing_ = spacing_ == 0 ? apart : std::min(spacing_, apart);
    std::vector<Vec3d> own;
    while (done < surfels_.size() && thin.surfel[done] < range.surfel_end) {
      own.push_back(surfels_[done++]);
    }
    if (own.empty()) continue;
    const Carriers found = carriers_of(own, around, apart > 0 ? reach * apart : 1);
    for (const std::uint32_t i : found.phyxel) {
      carriers_.phyxel.push_back(static_cast<std::uint32_t>(range.phyxel_begin) + i);
    }
    carriers_.weight.insert(carriers_.weight.end(), found.weight.begin(), found.weight.end());
  }
  if (rest.size() <= most_phyxels) {
    ids_.resize(rest.size());
    std::iota(ids_.begin(), ids_.end(), 0U);
  } else {
    ids_ = carriers_.phyxel;
    const std::size_t stride = 1 + rest.size() / most_phyxels;
    for (std::size_t i = 0; i < rest.size(); i += stride)
      ids_.push_back(static_cast<std::uint32_t>(i));
    std::sort(ids_.begin(), ids_.end());
    ids_.erase(std::unique(ids_.begin(), ids_.end()), ids_.end());
    for (std::uint32_t& i : carriers_.phyxel) {
      i = static_cast<std::uint32_t>(std::lower_bound(ids_.begin(), ids_.end(), i) - ids_.begin());
    }
  }
  for (const std::uint32_t i : ids_) {
    phyxels_.push_back(rest[i]);
    phyxel_bodies_.push_back(bodies[i]);
  }
}

void LivePicture::find_rows(const Model& model) {
  std::vector<std::uint32_t> sent;
  for (const Part& part : model.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      const auto id = static_cast<std::uint32_t>(model.global_id(i));
      if (!std::binary_search(ids_.begin(), ids_.end(), id)) continue;
      here_.push_back(i);
      sent.push_back(id);
    }
  }
  for (const std::uint32_t id : ranks().gathered(std::span<const std::uint32_t>(sent))) {
    place_.push_back(
        static_cast<std::size_t>(std::lower_bound(ids_.begin(), ids_.end(), id) - ids_.begin()));
  }
}

std::shared_ptr<const std::string> LivePicture::frame(const LiveScene& live, std::int32_t field,
                                                      std::uint32_t number) const {
  const std::vector<PhyxelMotion> motions = live.backend().motions_of(here_);
  const std::vector<double> values = values_of(live, here_, motions, field);
  std::vector<float> sent(sent_each * here_.size());
#pragma omp parallel for schedule(static) if (motions.size() > worth_threads)
  for (std::size_t k = 0; k < motions.size(); ++k) {
    float* const to = sent.data() + sent_each * k;
    for (int axis = 0; axis < 3; ++axis) {
      to[axis] = static_cast<float>(component(motions[k].displacement, axis));
    }
    for (int e = 0; e < 9; ++e) to[3 + e] = static_cast<float>(motions[k].gradient(e / 3, e % 3));
    to[12] = static_cast<float>(values[k]);
  }
  const std::vector<float> rows = ranks().gathered(std::span<const float>(sent));
  const std::vector<RigidState> rigid = live.backend().rigid_states();
  if (!all_ranks().leads()) return nullptr;

  FrameHead head;
  head.number = number;
  head.phyxels = static_cast<std::uint32_t>(ids_.size());
  head.field = field;
  head.time = live.solver().time();
  Quantised scales[sent_each], turned;
#pragma omp parallel for schedule(static) if (place_.size() > worth_threads)
  for (std::size_t c = 0; c < sent_each; ++c) scales[c] = scale_of(rows, sent_each, c);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    head.middle[axis] = static_cast<float>(scales[axis].middle);
    head.half[axis] = static_cast<float>(scales[axis].half);
  }
  for (std::size_t c = 3; c < 12; ++c) {
    turned.half = std::max(turned.half, std::abs(scales[c].middle) + scales[c].half);
  }
  head.gradient = static_cast<float>(turned.half);
  const Quantised& coloured = scales[12];
  head.low = static_cast<float>(coloured.middle - coloured.half);
  head.high = static_cast<float>(coloured.middle + coloured.half);

  std::vector<std::int16_t> numbers(numbers_each * ids_.size());
#pragma omp parallel for schedule(static) if (place_.size() > worth_threads)
  for (std::size_t k = 0; k < place_.size(); ++k) {
    const float* const row = rows.data() + sent_each * k;
    std::int16_t* const to = numbers.data() + numbers_each * place_[k];
    for (std::size_t axis = 0; axis < 3; ++axis) to[axis] = scales[axis].step_of(row[axis]);
    to[3] = coloured.step_of(row[12]);
    for (std::size_t e = 0; e < 9; ++e) to[4 + 4 * (e / 3) + e % 3] = turned.step_of(row[3 + e]);
  }
  auto message = std::make_shared<std::string>();
  append(*message, &head, sizeof head);
  append(*message, numbers.data(), numbers.size() * sizeof numbers[0]);
  std::size_t free = 0;
  for (const Obstacle& obstacle : live.model().obstacles) {
    const ObstacleStep step =
        obstacle.free ? obstacle.placed(rigid.at(free++)) : obstacle.step_from(head.time, 0);
    float place[12];
    for (int e = 0; e < 9; ++e) place[e] = static_cast<float>(step.turn(e / 3, e % 3));
    for (int axis = 0; axis < 3; ++axis) {
      place[9 + axis] = static_cast<float>(component(step.place, axis));
    }
    append(*message, place, sizeof place);
  }
  return message;
}

}  // namespace phyxel::app
