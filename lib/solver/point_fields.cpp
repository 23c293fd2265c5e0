#include "phyxel/point_fields.hpp"

#include <algorithm>
#include <array>

#include "phyxel/diagnostics.hpp"
#include "phyxel/fragments.hpp"
#include "phyxel/history.hpp"
#include "solver/field_point.hpp"
#include "solver/first_error.hpp"
#include "solver/tensors.hpp"

namespace phyxel {
namespace {

/// Terms of the field "boundary", whose values are sums of them.
constexpr int is_held = 1, is_moved = 2, is_loaded = 4;

std::vector<double> boundary_of(const Model& model) {
  std::vector<double> marks(static_cast<std::size_t>(model.size()), 0);
  const auto mark = [&](const std::vector<Index>& phyxels, int kind) {
    for (const Index i : phyxels) marks[i] = static_cast<int>(marks[i]) | kind;
  };
  for (const Motion& motion : model.motions) {
    mark(motion.phyxels, motion.stands_still() ? is_held : is_moved);
  }
  for (const Load& load : model.loads) mark(load.phyxels, is_loaded);
  return marks;
}

std::vector<double> broken_of(const Model& model, const Backend& backend) {
  const std::optional<Breakage> breakage = backend.breakage();
  return breakage ? breakage->broken
                  : std::vector<double>(static_cast<std::size_t>(model.size()), 0);
}

/// True for a field that follows from displacement gradients.
bool follows_from_gradient(Quantity quantity) {
  return quantity != Quantity::boundary && quantity != Quantity::broken &&
         quantity != Quantity::fragment;
}

/// The arrays that a computation fills, by quantity.
class Arrays {
 public:
  Arrays(FieldValues& values, std::span<const Quantity> wanted, Index n) : values_(values) {
    for (const Quantity q : wanted) {
      values[q].resize(static_cast<std::size_t>(n) * width_of(q));
    }
  }
  bool has(Quantity q) const { return values_.count(q) > 0; }
  template <std::size_t width>
  void set(Quantity q, Index i, const std::array<double, width>& entries) {
    std::copy(entries.begin(), entries.end(),
              values_.at(q).begin() + static_cast<std::ptrdiff_t>(width) * i);
  }

 private:
  FieldValues& values_;
};

void set_strains(Arrays& arrays, Index i, const Mat3d& grad_u) {
  if (arrays.has(Quantity::volume_ratio)) {
    arrays.set(Quantity::volume_ratio, i, std::array{1 + volume_change(grad_u)});
  }
  if (arrays.has(Quantity::strain)) {
    arrays.set(Quantity::strain, i, components(full(green_strain(grad_u))));
  }
}

void set_stresses(Arrays& arrays, Index i, const Mat3d& sigma) {
  if (arrays.has(Quantity::von_mises)) {
    arrays.set(Quantity::von_mises, i, std::array{von_mises_stress(sigma)});
  }
  if (arrays.has(Quantity::stress)) arrays.set(Quantity::stress, i, components(sigma));
  if (arrays.has(Quantity::principal_stress)) {
    arrays.set(Quantity::principal_stress, i, principal_values(sigma));
  }
}

bool is_stress(Quantity quantity) {
  return quantity == Quantity::von_mises || quantity == Quantity::stress ||
         quantity == Quantity::principal_stress;
}

}  // namespace

std::span<const PointField> point_fields() {
  static constexpr PointField fields[] = {
      {"von_mises", Quantity::von_mises, "von Mises equivalent of the Cauchy stress [Pa]"},
      {"volume_ratio", Quantity::volume_ratio, "det F"},
      {"stress", Quantity::stress, "Cauchy stress [Pa]: xx, yy, zz, xy, yz, xz"},
      {"principal_stress", Quantity::principal_stress,
       "principal values of the Cauchy stress [Pa], the largest first"},
      {"strain", Quantity::strain, "Green's strain: xx, yy, zz, xy, yz, xz"},
      {"boundary", Quantity::boundary,
       "sum of 1 for phyxels that are held along an axis, 2 for moved and 4 for loaded ones"},
      {"broken", Quantity::broken,
       "share of a phyxel's pairs that are broken, by cracks and notches"},
      {"fragment", Quantity::fragment,
       "number of a phyxel's fragment, from 1 for the heaviest of the scene; 0 for dust, which has "
       "lost all its pairs, and in scenes without fracture and notches"}};
  return fields;
}

std::vector<Quantity> wanted_fields(const OutputRequest& output) {
  std::vector<Quantity> wanted;
  for (const PointField& field : point_fields()) {
    if (output.wants(field.name)) wanted.push_back(field.quantity);
  }
  return wanted;
}

std::unique_ptr<const Recovery> recovery_for(const OutputRequest& output, const Model& model) {
  const std::vector<Quantity> wanted = wanted_fields(output);
  const bool follows = std::any_of(wanted.begin(), wanted.end(), follows_from_gradient);
  return output.recovery && (follows || !model.probes.empty()) ? std::make_unique<Recovery>(model)
                                                               : nullptr;
}

FieldValues find_fields(const Model& model, Backend& backend, std::span<const Quantity> wanted,
                        const Recovery* recovery) {
  FieldValues values;
  std::vector<Quantity> computed(wanted.begin(), wanted.end());
  if (std::erase(computed, Quantity::boundary) > 0) values[Quantity::boundary] = boundary_of(model);
  if (std::erase(computed, Quantity::broken) > 0) {
    values[Quantity::broken] = broken_of(model, backend);
  }
  if (std::erase(computed, Quantity::fragment) > 0) {
    values[Quantity::fragment] = fragment_numbers(model, backend);
  }
  if (computed.empty()) return values;
  check_fits(model, backend);
  std::vector<Mat3d> own;
  backend.displacement_gradients(own);
  const bool has_stresses = std::any_of(computed.begin(), computed.end(), is_stress);
  const std::vector<std::string> columns = history_columns(model);
  State state;
  if (recovery || (has_stresses && !columns.empty())) backend.download(state);
  // A recovered gradient would reach across cracks.
  const std::optional<Breakage> breakage = backend.breakage();
  std::vector<Mat3d> recovered;
  if (recovery) recovered = recovery->gradients(state.displacement);
  Arrays arrays(values, computed, static_cast<Index>(own.size()));
  for (const Part& part : model.parts) {
    const PartLaw law(part.material);
    const PartHistory history(state, part.material, columns);
    FirstError error;  // of a caller's law
#pragma omp parallel for schedule(dynamic, 256)
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      thread_local std::vector<double> numbers;
      numbers.resize(history.size());
      const bool is_whole = !breakage || breakage->broken[i] == 0;
      const bool is_recovered = recovery && recovery->share(i) > 0 && is_whole;
      if (!is_recovered && !has_stresses) {
        set_strains(arrays, i, own[i]);
        continue;
      }
      const std::span<const double> past = history.of(i, numbers);
      const FieldPoint point = error.caught([&] {
        const FieldPoint of_own = own_point(law, own[i], past, state.history_interval);
        if (!is_recovered) return of_own;
        return recovered_point(law, of_own, past, recovered[i], recovery->normal(i),
                               recovery->share(i));
      });
      set_strains(arrays, i, point.grad_u);
      if (!has_stresses) continue;
      const double carried = breakage ? breakage->carried[i] : 1;
      set_stresses(arrays, i, carried * cauchy_stress(point.first_piola_stress, point.grad_u));
    }
    error.rethrow();
  }
  return values;
}

void stress_fields(const Model& model, Backend& backend, std::vector<double>* von_mises,
                   std::vector<double>* volume_ratio) {
  check_fits(model, backend);
  std::vector<Quantity> wanted;
  if (von_mises) wanted.push_back(Quantity::von_mises);
  if (volume_ratio) wanted.push_back(Quantity::volume_ratio);
  FieldValues found = find_fields(model, backend, wanted);
  if (von_mises) *von_mises = std::move(found[Quantity::von_mises]);
  if (volume_ratio) *volume_ratio = std::move(found[Quantity::volume_ratio]);
}

}  // namespace phyxel
