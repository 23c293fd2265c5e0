/// phyxel as a library on many ranks: a block of jelly, which may be larger than the memory of one
/// rank, spins while it falls. Each rank builds and steps a share of it, on a GPU if all find one.
///
///     large_body                          100,000 phyxels, 200 steps, one rank
///     mpirun -n 4 large_body 5000000      five million phyxels on four ranks
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <phyxel/phyxel.hpp>
#include <string>
#include <vector>

namespace {

struct Options {
  int phyxels = 100'000;  // approximate number
  int steps = 200;
};

Options options_of(int argc, char** argv) {
  Options options;
  const auto number = [&](int k, int least, const char* what, int& value) {
    if (k >= argc) return;
    char* end = nullptr;
    const long given = std::strtol(argv[k], &end, 10);
    if (*end != '\0' || given < least || given > 2'000'000'000) {
      throw phyxel::InputError(std::string(what) + " " + argv[k] + ": allowed are " +
                               std::to_string(least) + " to 2000000000");
    }
    value = static_cast<int>(given);
  };
  number(1, 64, "phyxels", options.phyxels);
  number(2, 1, "steps", options.steps);
  return options;
}

phyxel::Scene falling_block(int phyxels) {
  phyxel::Scene scene;
  scene.gravity = {0, 0, -9.81};
  phyxel::BodyRequest& block = scene.bodies.emplace_back();
  block.name = "block";
  block.material = {.young = 1e5, .poisson = 0.3, .density = 1000};
  block.spin = {0, 1, 2};          // [rad/s]
  block.source.phyxels = phyxels;  // ranks make pieces of the lattice
  phyxel::ShapeRequest& shape = block.source.shape;
  shape.name = "block";
  shape.size = {1, 1, 1};
  shape.surface = false;
  return scene;
}

/// Number of bytes that all ranks have sent for ghosts.
std::int64_t bytes_sent(const phyxel::Ranks& ranks, const phyxel::Backend& backend) {
  const auto exchanges = backend.exchanges();  // unset on one rank
  return ranks.sum(exchanges ? exchanges->traffic.bytes_sent : std::int64_t{0});
}

int fall(const phyxel::Ranks& ranks, int argc, char** argv) {
  // An error of one rank ends all ranks with one message.
  const Options options = ranks.agreed([&] { return options_of(argc, argv); });
  const phyxel::Scene scene = ranks.agreed([&] { return falling_block(options.phyxels); });
  const phyxel::ChosenDevice device = phyxel::choose_device(ranks, "auto");

  const phyxel::SharedModel block(ranks, scene, device);
  const phyxel::Model& share = block.here();
  const auto backend = block.make_backend(phyxel::Precision::single);
  const double step = 0.8 * phyxel::step_limit(share, *backend).largest_step;
  phyxel::Solver solver(*backend, phyxel::initial_state(share, scene, step));

  // Each rank steps its share, and the backend exchanges the values of ghosts.
  const phyxel::Diagnostics start = phyxel::diagnose(share, *backend, solver.steps(), step);
  const std::int64_t sent_before = bytes_sent(ranks, *backend);
  ranks.barrier();
  const auto begun = std::chrono::steady_clock::now();
  solver.step(options.steps - solver.steps());
  backend->wait();
  const std::chrono::duration<double> stepping = std::chrono::steady_clock::now() - begun;
  const double seconds = ranks.largest(stepping.count());
  const std::int64_t sent = bytes_sent(ranks, *backend) - sent_before;
  const phyxel::Diagnostics end = phyxel::diagnose(share, *backend, solver.steps(), step);

  // A sum over the whole body: each phyxel belongs to one rank, and values of ghosts are not valid.
  const phyxel::State state = solver.state();
  std::vector<double> terms;
  for (phyxel::Index i = 0; i < share.size(); ++i) {
    if (share.owns(i)) terms.push_back(share.mass[i] * state.displacement[i].z);
  }
  const double fallen = -ranks.exact_sum(terms) / share.parts[0].mass;

  if (!ranks.leads()) return 0;
  const double n = share.global_count(), t = solver.time();
  const phyxel::SharedModel::Shares& shares = block.shares();
  std::printf("%d ranks, each on %s: %s\n", ranks.size(),
              device.gpu ? device.gpu->describe().c_str() : device.why_no_gpu.c_str(),
              backend->name().c_str());
  std::printf("shares: %lld to %lld of %d phyxels, and at most %lld ghosts\n",
              static_cast<long long>(shares.fewest), static_cast<long long>(shares.most),
              share.global_count(), static_cast<long long>(shares.most_ghosts));
  std::printf("speed: %.3g phyxel-steps/s; %.0f bytes of ghosts a step\n",
              n * options.steps / seconds, static_cast<double>(sent) / options.steps);
  std::printf("%d steps to t = %.6g s\n", options.steps, t);
  std::printf("energy: %.9g J at the start, %.9g J at the end\n", start.total_energy(),
              end.total_energy());
  std::printf("centre of mass: fell %.6f m; gravity says %.6f m\n", fallen,
              0.5 * -scene.gravity.z * t * t);
  std::printf("largest displacement: %.9g m\n", end.largest_displacement);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return phyxel::on_ranks(argc, argv,
                          [&](const phyxel::Ranks& ranks) { return fall(ranks, argc, argv); });
}
