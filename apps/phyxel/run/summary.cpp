/// The plan and the summary of a run.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "outside_text.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/law_table.hpp"
#include "run/fragment_summary.hpp"
#include "run/run.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

/// Relative energy drift above which a run warns. Bodies that ring at the stability limit reach 9%;
/// the other hard cases stay below 2%.
constexpr double largest_drift = 0.1;

/// Energy of a body at rest from rounding errors [J], as strains of 1e-7 have.
double rounding_energy(const Model& model) {
  double energy = 0;
  for (const Part& part : model.parts) {
    const double speed = pressure_wave_speed(part.material);
    energy += 1e-14 * part.mass * speed * speed;
  }
  return energy;
}

/// The energy that gravity gives all bodies from rest in a step of `dt` [J]. Contact lifts bodies
/// that start at rest on an obstacle or on each other by as much.
double energy_of_first_step(const Model& model, double dt) {
  double mass = 0;
  for (const Part& part : model.parts) mass += part.mass;
  for (const Obstacle& obstacle : model.obstacles) mass += obstacle.free ? obstacle.free->mass : 0;
  return 0.5 * mass * dt * dt * dot(model.gravity, model.gravity);
}

nlohmann::ordered_json json_of(Vec3d v) { return {v.x, v.y, v.z}; }

nlohmann::ordered_json json_of(const std::vector<Load>& loads) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Load& load : loads) {
    list.push_back({{"body", load.body},
                    {"set", load.set},
                    {"force_n", json_of(load.total)},
                    {"force_density_n_m3", json_of(load.density)},
                    {"centroid_m", json_of(load.centroid)}});
  }
  return list;
}

/// Reactions, readings of probes, and gases that a summary prints.
constexpr std::size_t most_printed = 8;

nlohmann::ordered_json json_of(const std::vector<Reaction>& reactions) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Reaction& r : reactions) {
    nlohmann::ordered_json& entry = list.emplace_back();
    entry = {{"body", r.body},
             {"set", r.set},
             {"force_n", json_of(r.force)},
             {"torque_n_m", json_of(r.torque)},
             {"centre_m", json_of(r.centre)},
             {"work_j", nullptr}};
    if (std::isfinite(r.work)) entry["work_j"] = r.work;
  }
  return list;
}

nlohmann::ordered_json json_of(const std::vector<GasReading>& gases) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const GasReading& gas : gases) {
    list.push_back({{"body", gas.body},
                    {"set", gas.set},
                    {"pressure_pa", gas.pressure},
                    {"volume_m3", gas.volume}});
  }
  return list;
}

nlohmann::ordered_json json_of(const std::vector<ContactReading>& contacts,
                               const std::vector<double>& deepest) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const ContactReading& contact = contacts[k];
    list.push_back({{"obstacle", contact.obstacle},
                    {"shape", contact.shape},
                    {"force_n", json_of(contact.force)},
                    {"torque_n_m", json_of(contact.torque)},
                    {"impulse_n_s", json_of(contact.impulse)},
                    {"angular_impulse_n_m_s", json_of(contact.angular_impulse)},
                    {"work_j", contact.work},
                    {"friction_heat_j", contact.friction_heat},
                    {"impact_loss_j", contact.impact_loss},
                    {"depth_m", contact.depth},
                    {"deepest_m", deepest[k]},
                    {"place_m", json_of(contact.place)}});
  }
  return list;
}

nlohmann::ordered_json json_of(const std::vector<RigidReading>& bodies) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const RigidReading& body : bodies) {
    list.push_back({{"obstacle", body.obstacle},
                    {"shape", body.shape},
                    {"place_m", json_of(body.place)},
                    {"rotation_rad", json_of(body.rotation)},
                    {"velocity_m_s", json_of(body.velocity)},
                    {"spin_rad_s", json_of(body.spin)},
                    {"kinetic_energy_j", body.kinetic_energy}});
  }
  return list;
}

nlohmann::ordered_json json_of(const std::vector<ProbeReading>& readings) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ProbeReading& r : readings) {
    list.push_back({{"probe", r.probe},
                    {"point", r.number + 1},
                    {"place_m", json_of(r.place)},
                    {"displacement_m", json_of(r.displacement)},
                    {"velocity_m_s", json_of(r.velocity)},
                    {"stress_pa", r.stress},
                    {"von_mises_pa", r.von_mises},
                    {"strain", r.strain}});
  }
  return list;
}

}  // namespace

nlohmann::ordered_json Run::identity() const {
  const Index phyxels = model().global_count();
  return {{"program", program_version()},
          {"scene", scene_.file.string()},
          {"title", scene_.title},
          {"device", backend_->name()},
          {"ranks", ranks().size()},
          {"phyxels", phyxels},
          {"surfels", model().global_surfel_count()},
          {"neighbours_per_phyxel", static_cast<double>(model().pairs()) / std::max(1, phyxels)},
          {"method", method_name(scene_.solver.method)}};
}

void Run::say_plan() const {
  if (options_.json || options_.quiet || !leads()) return;
  fmt::print("{}: {}\n", program_version(),
             scene_.title.empty() ? scene_.file.string() : scene_.title);
  fmt::print("{}", describe_model(scene_, model(), boundary_, supports_));
  const std::string why = backend_->path_reason();
  fmt::print("  device      {}{}\n", backend_->name(), why.empty() ? "" : " (" + why + ")");
  if (ranks().size() > 1) {
    const SharedModel::Shares& shares = shared_.shares();
    fmt::print(
        "  ranks       {} ranks, cut by {}: {} to {} phyxels each, at most {} ghosts; "
        "displacements and stresses exchanged through {}\n",
        ranks().size(), shared_.partitioner(), shares.fewest, shares.most, shares.most_ghosts,
        transport_);
    if (!gpus_.empty()) fmt::print("  gpus        {}, by rank\n", fmt::join(gpus_, ", "));
  }
  fmt::print("  time step   {}\n", plan_.why);
  fmt::print("  plan        {} steps to t = {:g} s, a frame every {} steps; set-up took {:.2f} s\n",
             plan_.steps, end_time(), plan_.steps_per_frame, setup_seconds_);
  if (begin_) fmt::print("  resumed     at t = {:g} s (step {})\n", solver_.time(), first_step_);
  std::fflush(stdout);
}

void Run::say_finished_already() const {
  if (!leads()) return;
  const std::string message =
      fmt::format("the checkpoint is at t = {:g} s, the run ends at {:g} s: nothing is left to do",
                  solver_.time(), end_time());
  if (options_.json) {
    fmt::print("{}\n", json_text({{"program", program_version()}, {"finished", message}}));
  } else {
    fmt::print("  finished    {}\n", message);
  }
}

nlohmann::ordered_json Run::timing() const {
  nlohmann::ordered_json timing;
  double energies = 0, pictures = 0, others = 0;
  for (const auto& [what, seconds] : spent_.all()) {
    if (what == "energies") {
      energies = seconds;
    } else if (what == "pictures") {
      pictures = seconds;
    } else {
      timing[what] = seconds;
      others += seconds;
    }
  }
  timing["rest of the set-up"] = std::max(0.0, setup_seconds_ - others);
  timing["steps"] = step_seconds_;
  timing["energies"] = energies;
  timing["frames and checkpoints"] = std::max(0.0, loop_seconds_ - step_seconds_ - energies);
  if (!pictures_.empty()) timing["pictures"] = pictures;
  return timing;
}

double Run::energy_drift(const Diagnostics& now) const {
  return (now.total_energy() - watched_.start_energy) / std::max(peak_energy_, 1e-300);
}

double Run::force_balance(const Diagnostics& now) {
  return norm(now.internal_force) / std::max(now.force_scale, 1e-300);
}

double Run::torque_balance(const Diagnostics& now) {
  return norm(now.internal_torque) / std::max(now.torque_scale, 1e-300);
}

std::vector<std::string> Run::warnings_of(const Diagnostics& now) const {
  std::vector<std::string> warnings;
  // Implicit steps may lose energy, since they damp modes that they do not resolve.
  const double wrong = steps_explicitly() ? std::abs(energy_drift(now)) : energy_drift(now);
  if (scene_.solver.method != Method::equilibrium && is_conservative(model()) &&
      wrong > largest_drift &&
      std::abs(now.total_energy() - watched_.start_energy) > rounding_energy(model())) {
    warnings.push_back(fmt::format(
        "energy has drifted by {:.2g}% of the largest kinetic + elastic energy, in a scene that "
        "conserves energy: do not trust the result; a smaller time.safety may help",
        100 * energy_drift(now)));
  }
  const double least = std::max(0.01 * peak_energy_,
                                rounding_energy(model()) + energy_of_first_step(model(), plan_.dt));
  const auto warn_of_energy = [&](const std::string& what, double made) {
    if (!(made > least)) return;
    warnings.push_back(fmt::format(
        "{} has made {:.3g} J, {:.2g}% of the largest kinetic + elastic energy: do not trust the "
        "result; a smaller time.safety may help",
        what, made, 100 * made / peak_energy_));
  };
  double of_bodies = 0;  // each has a share, which may be negative
  for (std::size_t k = 0; k < readings_.contacts.size(); ++k) {
    const ContactReading& contact = readings_.contacts[k];
    if (k >= model().obstacles.size()) {
      of_bodies -= contact.impact_loss;
    } else {
      warn_of_energy(fmt::format("contact with obstacle \"{}\"", contact.obstacle),
                     -contact.impact_loss);
    }
  }
  warn_of_energy("contact of bodies with each other", of_bodies);
  for (const Part& part : model().parts) {
    const double steps = longest_time(part.material) / plan_.dt;
    if (scene_.solver.precision == Precision::double_ || !(steps > most_steps_of_history)) continue;
    warnings.push_back(fmt::format(
        "body \"{}\" relaxes in {:.2g} steps, and rounding in {} loses the change of a single "
        "step: "
        "allowed: up to {:g} steps, or precision double",
        part.name, steps, precision_name(scene_.solver.precision), most_steps_of_history));
  }
  if (std::string warning = warning_of_held_overlaps(model(), held_); !warning.empty()) {
    warnings.push_back(std::move(warning));
  }
  const std::span<const double> shares =
      std::span(deepest_shares_)
          .subspan(std::min(model().obstacles.size(), deepest_shares_.size()));
  if (shares.empty()) return warnings;
  const auto deepest = std::max_element(shares.begin(), shares.end());
  if (*deepest > trusted_share_in_bodies) {
    const std::size_t k = deepest_.size() - static_cast<std::size_t>(shares.end() - deepest);
    warnings.push_back(fmt::format(
        "phyxels of body \"{}\" were {:.3g} m deep in other bodies, {:.3g} of the smaller support "
        "of both, {} bodies had some deeper than {} of it, a distance between phyxels: contact may "
        "have led them out on the wrong side; smaller speeds, stiffer bodies, more sweeps or a "
        "smaller time.safety may help",
        readings_.contacts[k].obstacle, deepest_[k], *deepest,
        std::count_if(shares.begin(), shares.end(),
                      [](double share) { return share > trusted_share_in_bodies; }),
        trusted_share_in_bodies));
  }
  return warnings;
}

nlohmann::ordered_json Run::summary_of(const Diagnostics& now, std::int64_t bytes,
                                       const Traffic& traffic) const {
  const double steps = steps_taken();
  const Index phyxels = model().global_count();
  std::vector<std::string> warnings = model().warnings;
  for (const std::string& warning : warnings_of(now)) warnings.push_back(warning);
  nlohmann::ordered_json j = identity();
  j.update({{"time_s", now.time},
            {"steps", solver_.steps()},
            {"time_step_s", plan_.dt},
            {"time_step_halvings", plan_.halvings + solver_.looks().doublings},
            {"time_step_doublings", solver_.looks().doublings},
            {"largest_stable_step_s", plan_.limit.largest_step},
            {"omega_max_rad_s", plan_.limit.omega_max},
            {"force_evaluations", solver_.work().evaluations},
            {"newton_steps", solver_.work().newton_steps},
            {"newton_residual", solver_.work().residual},
            {"setup_seconds", setup_seconds_},
            {"loop_seconds", loop_seconds_},
            {"step_seconds", step_seconds_},
            {"seconds", timing()},
            {"steps_per_second", steps / std::max(step_seconds_, 1e-9)},
            {"phyxel_steps_per_second", steps * phyxels / std::max(step_seconds_, 1e-9)},
            {"bytes", bytes},
            {"transport", transport_},
            {"gpus", gpus_},
            {"exchange_bytes", traffic.bytes_sent},
            {"exchange_seconds", traffic.seconds},
            {"energy_j", now.total_energy()},
            {"energy_drift", energy_drift(now)},
            {"conservative", is_conservative(model())},
            {"internal_force_balance", force_balance(now)},
            {"internal_torque_balance", torque_balance(now)},
            {"inverted_phyxels", now.inverted},
            {"loads", json_of(model().loads)},
            {"reactions", json_of(readings_.reactions)},
            {"probes", json_of(readings_.probes)},
            {"gases", json_of(readings_.gases)},
            {"contacts", json_of(readings_.contacts, deepest_)},
            {"rigid_bodies", json_of(readings_.rigid)},
            {"fragments", json_of(readings_.fragments)},
            {"warnings", warnings},
            {"frames", recorder_->frames_written()},
            {"directory", recorder_->directory().string()},
            {"checkpoint", checkpoint_.string()}});
  return j;
}

/// Says how many of `count` readings were not printed. @param where "more: probes.csv"
void say_left_out(std::size_t count, const char* where) {
  if (count > most_printed) fmt::print("              {} {}\n", count - most_printed, where);
}

void Run::say_probes() const {
  const std::size_t printed = std::min(readings_.probes.size(), most_printed);
  for (std::size_t k = 0; k < printed; ++k) {
    const ProbeReading& r = readings_.probes[k];
    fmt::print(
        "  probe       {}{}: displacement ({:.4g}, {:.4g}, {:.4g}) m, von Mises stress {:.4g} Pa\n",
        r.probe, r.number > 0 ? fmt::format(", point {}", r.number + 1) : "", r.displacement.x,
        r.displacement.y, r.displacement.z, r.von_mises);
  }
  say_left_out(readings_.probes.size(), "more: probes.csv");
}

void Run::say_gases() const {
  const std::size_t printed = std::min(readings_.gases.size(), most_printed);
  for (std::size_t k = 0; k < printed; ++k) {
    const GasReading& gas = readings_.gases[k];
    fmt::print("  gas         {}, {}: pressure {:.6g} Pa, volume {:.6g} m^3\n", gas.body, gas.set,
               gas.pressure, gas.volume);
  }
  say_left_out(readings_.gases.size(), "more: gas.csv");
}

void Run::say_rigid_bodies() const {
  const std::size_t printed = std::min(readings_.rigid.size(), most_printed);
  for (std::size_t k = 0; k < printed; ++k) {
    const RigidReading& r = readings_.rigid[k];
    fmt::print(
        "  free body   {}: centre at ({:.4g}, {:.4g}, {:.4g}) m, velocity ({:.4g}, {:.4g}, {:.4g}) "
        "m/s, spin ({:.4g}, {:.4g}, {:.4g}) rad/s\n",
        r.obstacle, r.place.x, r.place.y, r.place.z, r.velocity.x, r.velocity.y, r.velocity.z,
        r.spin.x, r.spin.y, r.spin.z);
  }
  say_left_out(readings_.rigid.size(), "more: rigid.csv");
}

void Run::say_contacts() const {
  const std::size_t printed = std::min(readings_.contacts.size(), most_printed);
  for (std::size_t k = 0; k < printed; ++k) {
    const ContactReading& c = readings_.contacts[k];
    if (k >= model().obstacles.size()) {
      fmt::print(
          "  contact     {}: force of other bodies ({:.4g}, {:.4g}, {:.4g}) N; since t = 0 impulse "
          "({:.4g}, {:.4g}, {:.4g}) N s, work {:.4g} J; deepest {:.2g} m\n",
          c.obstacle, c.force.x, c.force.y, c.force.z, c.impulse.x, c.impulse.y, c.impulse.z,
          c.work, deepest_[k]);
      continue;
    }
    fmt::print(
        "  contact     {}: force on the bodies ({:.4g}, {:.4g}, {:.4g}) N; since t = 0 impulse "
        "({:.4g}, {:.4g}, {:.4g}) N s, work {:.4g} J, heat of friction {:.4g} J, loss in impacts "
        "{:.4g} J; deepest {:.2g} m\n",
        c.obstacle, c.force.x, c.force.y, c.force.z, c.impulse.x, c.impulse.y, c.impulse.z, c.work,
        c.friction_heat, c.impact_loss, deepest_[k]);
  }
  say_left_out(readings_.contacts.size(), "more: contacts.csv");
  if (readings_.contacts.size() == model().obstacles.size()) return;
  double heat = 0, loss = 0;
  for (std::size_t k = model().obstacles.size(); k < readings_.contacts.size(); ++k) {
    heat += readings_.contacts[k].friction_heat;
    loss += readings_.contacts[k].impact_loss;
  }
  fmt::print(
      "              of bodies with each other, since t = 0: heat of friction {:.4g} J, loss in "
      "impacts {:.4g} J\n",
      heat, loss);
}

void Run::say_reactions() const {
  const std::size_t printed = std::min(readings_.reactions.size(), most_printed);
  for (std::size_t k = 0; k < printed; ++k) {
    const Reaction& r = readings_.reactions[k];
    fmt::print(
        "  reaction    {}, {}: force ({:.4g}, {:.4g}, {:.4g}) N, torque ({:.4g}, {:.4g}, {:.4g}) N "
        "m "
        "about ({:.4g}, {:.4g}, {:.4g}) m{}\n",
        r.body, r.set, r.force.x, r.force.y, r.force.z, r.torque.x, r.torque.y, r.torque.z,
        r.centre.x, r.centre.y, r.centre.z,
        std::isnan(r.work) || r.work == 0 ? "" : fmt::format(", work {:.4g} J", r.work));
  }
  say_left_out(readings_.reactions.size(), "more sets: reactions.csv");
}

void Run::say_summary(const Diagnostics& now, std::int64_t bytes, const Traffic& traffic) const {
  const double steps = steps_taken();
  const Index phyxels = model().global_count();
  fmt::print(
      "  speed       {:.4g} steps/s, {:.4g} phyxel-steps/s; {:.2f} s for the steps, {:.2f} s "
      "with "
      "output; {:.0f} bytes per phyxel\n",
      steps / std::max(step_seconds_, 1e-9), steps * phyxels / std::max(step_seconds_, 1e-9),
      step_seconds_, loop_seconds_, static_cast<double>(bytes) / std::max(1, phyxels));
  if (ranks().size() > 1) {
    fmt::print(
        "  exchange    at most {:.3g} kB a step and rank; {:.1f}% of the seconds above for "
        "packing "
        "and waiting\n",
        1e-3 * static_cast<double>(traffic.bytes_sent) / std::max(steps, 1.0),
        100 * traffic.seconds / std::max(loop_seconds_, 1e-9));
  }
  const std::int64_t doublings = solver_.looks().doublings;
  if (plan_.halvings + doublings > 0) {
    const auto times = [](std::int64_t count) {
      return count == 1 ? std::string("once") : fmt::format("{} times", count);
    };
    fmt::print(
        "  time step   halved {} because a body stiffened, doubled {}; {:.4g} s at the end\n",
        times(plan_.halvings + doublings), doublings > 0 ? times(doublings) : "never", plan_.dt);
  }
  if (!steps_explicitly()) {
    const SolverWork work = solver_.work();
    fmt::print(
        "  newton      {} steps of Newton's method, {} evaluations of the forces; residual "
        "{:.1e} "
        "of what acts\n",
        work.newton_steps, work.evaluations, work.residual);
  }
  if (scene_.solver.method == Method::equilibrium) {
    fmt::print("  energy      {:.6g} J at rest, {:.4g} J of it elastic\n", now.total_energy(),
               now.elastic_energy());
  } else if (is_conservative(model())) {
    fmt::print("  energy      drift {:+.2e} of the largest kinetic + elastic energy, {:.4g} J\n",
               energy_drift(now), peak_energy_);
  } else {
    fmt::print(
        "  energy      {:.6g} J, not conserved in this scene (damping, motion or changing load)\n",
        now.total_energy());
  }
  fmt::print("  momentum    internal forces sum to {:.1e} of their size, torques to {:.1e}\n",
             force_balance(now), torque_balance(now));
  say_reactions();
  say_probes();
  say_gases();
  say_contacts();
  say_rigid_bodies();
  say_fragments(readings_.fragments);
  if (now.inverted > 0) {
    fmt::print(
        "  warning     {} phyxels are inside out (det F <= 0) at the end; a finer time step will "
        "not "
        "cure that: volume_stiffness or a stiffer material may\n",
        now.inverted);
  }
  for (const std::string& warning : warnings_of(now)) fmt::print("  warning     {}\n", warning);
  fmt::print("  written     {} frames: ", recorder_->frames_written());
  const auto files = recorder_->files();
  for (std::size_t f = 0; f < files.size(); ++f)
    fmt::print("{}{}", f ? ", " : "", files[f].string());
  fmt::print("\n              {} (checkpoint)\n", checkpoint_.string());
  if (!pictures_.empty()) {
    fmt::print("              {} pictures: {} ... {}\n", pictures_.size(),
               pictures_.front().string(), pictures_.back().string());
  }
}

}  // namespace phyxel::app
