#include "files/looks_group.hpp"

#include <algorithm>
#include <cmath>

namespace phyxel {
namespace {

constexpr const char* group = "/state/looks";

/// The one list of the fields: each(name, field).
/// @param doubles false for files of the time before steps were doubled, which lack two fields
template <class AnyLooks, class Each>
void for_each_field(AnyLooks& looks, bool doubles, Each&& each) {
  each("next", looks.next);
  each("last", looks.last);
  each("ratio", looks.ratio);
  each("change", looks.change);
  each("measured", looks.measured);
  each("measured_ratio", looks.measured_ratio);
  each("measured_share", looks.measured_share);
  each("apart", looks.apart);
  if (!doubles) return;
  each("too_long", looks.too_long);
  each("doublings", looks.doublings);
}

void read(const Hdf5Reader& in, const char* name, std::int64_t& field) {
  field = in.integer_attribute(group, name);
}
void read(const Hdf5Reader& in, const char* name, double& field) {
  field = in.number_attribute(group, name);
}

}  // namespace

void write_looks(Hdf5Writer& out, const Looks& looks) {
  out.group(group);
  for_each_field(looks, true,
                 [&](const char* name, const auto& field) { out.attribute(group, name, field); });
}

Looks read_looks(const Hdf5Reader& in) {
  Looks looks;
  const bool doubles = in.has_attribute(group, "too_long") || in.has_attribute(group, "doublings");
  for_each_field(looks, doubles, [&](const char* name, auto& field) { read(in, name, field); });
  if (std::min({looks.next, looks.last + 1, looks.measured + 1, looks.apart, looks.too_long + 1,
                looks.doublings}) < 0 ||
      std::max({looks.next, looks.last, looks.measured, looks.apart, looks.too_long,
                looks.doublings}) > most_counted ||
      !std::isfinite(looks.ratio) || !(looks.change >= 0) || !(looks.measured_ratio > 0) ||
      !std::isfinite(looks.measured_ratio) || !(looks.measured_share >= 0)) {
    in.refuse("/state/looks: steps that are negative or ratios that are not finite");
  }
  return looks;
}

}  // namespace phyxel
