#include "mesh/inside_filling.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "phyxel/error.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// Number of samples from which the volume is known to 20%.
constexpr Offset telling_samples = 30;

class Search {
 public:
  Search(const InsideSampler& sampler, const FillingRequest& request, InsideFilling& filling)
      : sampler_(sampler),
        request_(request),
        filling_(filling),
        most_voxels_(std::max(3e6, 8 * request.samples)) {}

  void run() {
    Stage stage("filling the surface");
    // The volume is not known if the surface is open or covers parts of space twice: a coarse
    // filling tells how fine the next must be.
    filling_ = {};
    filling_.voxel = sampler_.extent() / 24;
    const double wanted = request_.samples;
    double expected = 0;  // samples of the next sweep
    for (int sweep = 0;; ++sweep) {
      refuse_if_too_fine();
      // Coarse sweeps are not reported as progress.
      collect(expected > 0.5 * wanted ? &stage : nullptr);
      const double found = static_cast<double>(filling_.tally.samples);
      if ((found >= 0.9 * wanted && found <= 1.3 * wanted) ||
          (sweep > 8 && found >= 0.5 * wanted)) {
        stage.finish();
        return;
      }
      // Small numbers of samples are only a rough guess; go four times finer at most at a time.
      const double finer = found > 0 ? std::clamp(std::cbrt(found / wanted), 0.25, 4.0) : 0.4;
      filling_.voxel *= finer;
      expected = found / (finer * finer * finer);
    }
  }

 private:
  /// Makes one sweep, limited to the remaining work.
  void collect(Stage* stage) {
    const Offset most =
        hopeless() ? most_filling_work(request_) / 100 : most_filling_work(request_);
    filling_.tally = sampler_.collect({.voxel = filling_.voxel,
                                       .seed = request_.seed,
                                       .most_work = std::max<Offset>(most - filling_.work, 0)},
                                      filling_.blocks, stage);
    swept_ = filling_.voxel;
    filling_.work += filling_.tally.work;
    ++filling_.sweeps;
    if (filling_.work <= most) return;
    filling_.blocks.clear();
    filling_.tally.samples = 0;
    refuse(fmt::format(
        "the search was given up after {} sweeps and {:.2g} tests of triangles, at most {:.2g}",
        filling_.sweeps, static_cast<double>(filling_.work), static_cast<double>(most)));
  }

  void refuse_if_too_fine() const {
    // With 3e5 voxels, some would lie inside a plate as thin as 1e-7 of its width.
    const bool nothing = (filling_.sweeps > 0 && filling_.tally.samples == 0) || hopeless();
    const double most = nothing ? 3e5 : most_voxels_;
    const double voxels = sampler_.surface_voxels(filling_.voxel);
    if (voxels <= most && filling_.voxel >= 1e-7 * sampler_.extent()) return;
    refuse(voxels <= most || nothing ? "no sample point was found inside" : too_many(voxels));
  }

  std::string too_many(double voxels) const {
    return fmt::format("its samples would need {:.2g} voxels along the surface, at most {:.2g}",
                       voxels, most_voxels_);
  }

  /// Best estimate of the enclosed volume [m^3]: from the surface if it is closed, and from the
  /// samples, which also count regions enclosed inside out; unset if neither is known.
  std::optional<double> volume() const {
    std::optional<double> known = request_.volume;
    if (filling_.tally.samples >= telling_samples) {
      const double sampled = static_cast<double>(filling_.tally.samples) * std::pow(swept_, 3);
      known = std::max(known.value_or(0), sampled);
    }
    return known;
  }
  /// Side of the voxels of which the requested number make up `volume` [m].
  double voxel_for(double volume) const {
    return std::cbrt(std::max(volume, 0.0) / request_.samples);
  }
  /// True if the volume shows that the surface would need too many voxels. The factor of two leaves
  /// room for the tolerances of `run` and of the volume.
  bool hopeless() const {
    const auto known = volume();
    return known && !(sampler_.surface_voxels(voxel_for(*known)) <= 2 * most_voxels_);
  }

  /// @param why the reason, used if the volume does not give one
  [[noreturn]] void refuse(std::string why) const {
    const double unit = std::ldexp(1.0, -request_.exponent);
    const auto known = volume();
    const bool flat = !known || !(*known > 1e-15 * sampler_.area() * sampler_.extent());
    if (!flat && hopeless()) why = too_many(sampler_.surface_voxels(voxel_for(*known)));
    throw InputError(fmt::format(
        "the surface encloses {}: {:.3g} m^2 in a box of {:.3g} m; {} ({}); allowed: a closed "
        "surface thick enough for {} phyxels; thicken it, leave its thin parts out, or ask for "
        "fewer",
        flat ? "no volume"
             : fmt::format("too little volume for its size, {:.3g} m^3",
                           *known * unit * unit * unit),
        sampler_.area() * unit * unit, sampler_.extent() * unit, why, request_.defects,
        request_.phyxels));
  }

  const InsideSampler& sampler_;
  const FillingRequest& request_;
  InsideFilling& filling_;
  double most_voxels_;  ///< Largest number of voxels along the surface.
  double swept_ = 0;    ///< Side of the voxels of the last sweep [m].
};

}  // namespace

Offset most_filling_work(const FillingRequest& request) {
  return static_cast<Offset>(200 * std::max(3e6, 8 * request.samples) +
                             1000 * static_cast<double>(request.triangles));
}

void fill_inside(const InsideSampler& sampler, const FillingRequest& request,
                 InsideFilling& filling) {
  Search(sampler, request, filling).run();
}

}  // namespace phyxel
