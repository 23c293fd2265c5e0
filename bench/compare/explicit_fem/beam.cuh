/// Measurement of the bar under gravity: the deflection of its end, the first frequency, the time.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <string>
#include <vector>

#include "body.cuh"

namespace fem {

/// How the damped bar came to rest.
struct Settling {
  long long steps = 0;
  double seconds = 0;     ///< Time that the steps took.
  double deflection = 0;  ///< [m]
};

/// Displacements of the end of the bar at equal times.
struct Swing {
  double interval = 0;  ///< [s]
  std::vector<double> displacements;
};

/// Returns the steps of a graph while the body settles.
inline int settling_steps(Path path) { return path == Path::resident ? 200 : 20; }

/// Brings a body from its undeformed state to rest under gravity.
template <class Element>
Settling settle(Body<Element>& body) {
  const double dt = time_step_of<Element>(body.mesh());
  const int steps = settling_steps(body.path());
  const Graph graph = body.graph(make_step(dt, gravity, settling_damping), steps);
  graph.launch();  // before time is measured
  body.stream().wait();
  body.reset();
  const int launches = int(std::ceil(settling_time / dt / steps));
  Stopwatch stopwatch(body.stream().get());
  stopwatch.start();
  graph.launch(launches);
  Settling settling;
  settling.seconds = stopwatch.stop();
  settling.steps = static_cast<long long>(launches) * steps;
  settling.deflection = deflection_of(body.mesh(), body.displacements());
  return settling;
}

/// Lets a body go without gravity and damping, and follows its end for 8 s: about every 0.02 s, or
/// every 20 steps if those are longer.
template <class Element>
Swing swing(const Body<Element>& body) {
  const Mesh& mesh = body.mesh();
  const double dt = time_step_of<Element>(mesh);
  constexpr int steps = 20;
  const int launches = std::max(1, int(0.02 / dt / steps));
  const int count = int(8.0 / (dt * steps * launches));
  const Graph graph = body.graph(make_step(dt, 0, 0), steps);
  std::vector<std::int64_t> end;  // nodes at the end of the bar
  for (std::int64_t a = 0; a < mesh.nodes; ++a) {
    if (mesh.end_weights[a] > 0) end.push_back(a);
  }
  Swing swing;
  swing.interval = dt * steps * launches;
  for (int i = 0; i < count; ++i) {
    graph.launch(launches);
    const std::vector<float4> part = body.displacements(end.front(), end.back() + 1);
    double z = 0;
    for (const std::int64_t a : end) z += mesh.end_weights[a] * part[a - end.front()].z;
    swing.displacements.push_back(z);
  }
  return swing;
}

/// Returns the power of a swing at a frequency, after a Hann window.
inline double power_of(const Swing& swing, double frequency) {
  const int count = int(swing.displacements.size());
  std::complex<double> sum = 0;
  for (int i = 0; i < count; ++i) {
    const double window = 1 - std::cos(2 * M_PI * (i + 0.5) / count);
    sum += swing.displacements[i] * window *
           std::polar(1., -2 * M_PI * frequency * (i + 1) * swing.interval);
  }
  return std::norm(sum);
}

/// Returns the frequency of most power between 0.7 and 1.5 Hz.
inline double frequency_of(const Swing& swing) {
  double best = 0.7, most = power_of(swing, best);
  for (double frequency = 0.7; frequency < 1.5; frequency += 0.01) {
    const double power = power_of(swing, frequency);
    if (power <= most) continue;
    best = frequency;
    most = power;
  }
  double low = best - 0.02, high = best + 0.02;
  for (int i = 0; i < 50; ++i) {
    const double third = low + (high - low) / 3, two_thirds = high - (high - low) / 3;
    if (power_of(swing, third) < power_of(swing, two_thirds)) {
      low = third;
    } else {
      high = two_thirds;
    }
  }
  return (low + high) / 2;
}

/// Prints the row of a path. @param swings whether the frequency is measured; else it stays empty
template <class Element>
void measure_beam(const Mesh& mesh, Path path, bool swings) {
  Body<Element> body(mesh, path);
  const double dt = time_step_of<Element>(mesh);
  const Settling settling = settle(body);
  std::printf("%s,%s,%d,%lld,%.6e,%lld,%.6e,%.6e,%.6e,%.5e,", Element::name, name_of(path),
              mesh.across, static_cast<long long>(mesh.nodes), dt, settling.steps,
              settling.seconds / settling.steps, settling.seconds / (settling.steps * dt),
              settling.deflection, settling.deflection / reference_deflection - 1);
  if (swings) {
    const double frequency = frequency_of(swing(body));
    std::printf("%.6f,%.5e\n", frequency, frequency / reference_frequency - 1);
  } else {
    std::printf(",\n");
  }
  std::fflush(stdout);
}

/// Frequencies of fine meshes are not measured, nor twice those of one mesh.
/// @param most cells across at most
inline void beam(int most) {
  std::printf(
      "element,path,across,nodes,time_step_s,steps,step_seconds,seconds_per_simulated_second,"
      "deflection_m,error,frequency_hz,frequency_error\n");
  for (const int across : {2, 4, 8, 12, 16, 24, 32, 48}) {
    if (across > most) break;
    const bool swings = across <= 16;
    measure_beam<Brick>(make_mesh<Brick>(across, NodeOrder::lattice), Path::lattice, swings);
    const Mesh bricks = make_mesh<Brick>(across, NodeOrder::morton);
    measure_beam<Brick>(bricks, fits_one_block<Brick>(bricks) ? Path::resident : Path::tiles,
                        swings);
    const Mesh tetrahedra = make_mesh<Tetrahedron>(across, NodeOrder::morton);
    const bool one_block = fits_one_block<Tetrahedron>(tetrahedra);
    measure_beam<Tetrahedron>(tetrahedra, one_block ? Path::resident : Path::atomics, swings);
    if (!one_block && across <= 32) measure_beam<Tetrahedron>(tetrahedra, Path::tiles, false);
  }
}

}  // namespace fem
