/// The steps of a run: as long as the stability limit allows, with the progress of Newton's method.
#include <fmt/format.h>

#include "run/run.hpp"
#include "scene/scene_error.hpp"
#include "stop_signal.hpp"

namespace phyxel::app {

void Run::take_step(Progress& progress) {
  const double before = solver_.dt();
  const std::int64_t steps = solver_.steps();
  const int halvings = control_.look(solver_, plan_.halvings);
  if (halvings != 0) {
    plan_.halve(halvings);
    first_step_ += solver_.steps() - steps;  // keeps the number of steps taken
  }
  // An oscillating body may halve its steps repeatedly; only a new number of halvings is printed.
  if (plan_.halvings > halvings_told_) {
    halvings_told_ = plan_.halvings;
    if (!options_.json && !options_.quiet) {
      const std::string where = control_.where_it_began();
      progress.say(
          fmt::format("the time step is halved from {:.4g} to {:.4g} s at t = {:g} s: a body "
                      "stiffens; {}",
                      before, solver_.dt(), solver_.time(), where));
    }
  }
  const auto next = [&](std::int64_t every) { return (solver_.steps() / every + 1) * every; };
  const std::int64_t limit = std::min({plan_.steps, next(plan_.steps_per_frame),
                                       next(watch_interval), control_.next_look(solver_)});
  naming(scene_, [&] { solver_.step(solver_.steps_to(limit)); });  // a search may fail
}

void Run::watch_newton(Progress& progress) {
  if (steps_explicitly()) return;
  solver_.observe([this, &progress](const NewtonProgress& now) {
    const std::string newton = fmt::format("newton {}", now.step + 1),
                      iteration = fmt::format("iteration {}", now.iteration),
                      residual = fmt::format("residual {:.1e} (target {:.0e})", now.residual,
                                             now.tolerance),
                      energy = fmt::format("E = {:.4g} J", now.energy);
    if (scene_.solver.method == Method::equilibrium) {
      // Before the first step there is only the residual of the start.
      progress.update(now.step > 0 ? std::vector{residual, newton, iteration, energy}
                                   : std::vector{residual, newton, iteration});
    } else {
      const double share = solver_.time() / end_time();
      progress.update({fmt::format("{:5.1f}%", 100 * share),
                       fmt::format("{:.3f}/{:g} s", solver_.time(), end_time()), residual, newton,
                       iteration});
    }
    writer_.serve();
    return StopSignal::stop_requested() == 0;
  });
}

void Run::show_progress(Progress& progress, const Diagnostics& now) const {
  if (scene_.solver.method != Method::equilibrium) {
    progress.update(solver_.time(), solver_.steps(), speed(), now.total_energy());
    return;
  }
  const SolverWork work = solver_.work();
  progress.update({fmt::format("residual {:.1e}", work.residual),
                   fmt::format("{} steps of Newton's method", work.newton_steps),
                   fmt::format("E = {:.4g} J at rest", now.total_energy())});
}

std::string Run::stopped_in_search(const InterruptedError& error, Progress& progress) {
  good_ = good_state(diagnose(model(), *backend_, solver_));
  write_state();
  writer_.finish();
  progress.finish();
  const auto signal = ranks().largest(std::int64_t{StopSignal::stop_requested()});
  return fmt::format("stopped by signal {}: {}; the checkpoint is written, --resume auto continues",
                     signal, error.what());
}

}  // namespace phyxel::app
