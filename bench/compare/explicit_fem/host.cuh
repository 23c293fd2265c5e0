/// The steps of lattices and tiles on the host, for machines without a GPU.
#pragma once

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "lattice.cuh"
#include "tiles.cuh"

namespace fem {

/// The state of a body on the host.
struct HostState {
  explicit HostState(const Mesh& mesh)
      : displacements(mesh.rest), moved(mesh.rest), velocities(mesh.nodes, float4{0, 0, 0, 0}) {}

  /// Moves a node by a force f [N].
  void advance_node(std::int64_t a, const float f[3], Step step) {
    float4 u = displacements[a];
    advance(u, velocities[a], f[0], f[1], f[2], step);
    moved[a] = u;
  }
  void end_step() { std::swap(displacements, moved); }

  std::vector<float4> displacements, moved, velocities;
};

/// The tiles of a mesh on the host.
template <class Element>
class HostTiles {
 public:
  explicit HostTiles(const Mesh& mesh)
      : tiles_(make_tiles<Element>(mesh, usual_tile)),
        strides_(strides_of<Element>(tiles_)),
        view_{int(mesh.nodes),          usual_tile,          tiles_.head.data(),
              tiles_.first_item.data(), tiles_.near.data(),  tiles_.corner.data(),
              tiles_.row.data(),        tiles_.items.data(), tiles_.numbers.data()},
        near_(3 * strides_.nodes),
        forces_(3 * strides_.forces) {}

  void advance(HostState& state, Step step) {
    for (int tile = 0; tile < tiles_.count; ++tile) {
      load_tile<Element>(view_, tile, 0, 1, state.displacements.data(), near_.data(),
                         strides_.nodes);
      compute_tile<Element>(view_, tile, 0, 1, near_.data(), strides_.nodes, forces_.data(),
                            strides_.forces);
      const int begin = tile * usual_tile, end = std::min(view_.nodes, begin + usual_tile);
      for (int a = begin; a < end; ++a) {
        float f[3];
        sum_tile(view_, tile, a - begin, forces_.data(), strides_.forces, f);
        state.advance_node(a, f, step);
      }
    }
  }
  /// Returns the columns tiles, tile_nodes, redundancy and shared_bytes.
  std::string columns() const {
    char text[100];
    std::snprintf(text, sizeof text, "%d,%d,%.2f,%zu", tiles_.count, tiles_.most_nodes,
                  tiles_.redundancy, shared_bytes(strides_));
    return text;
  }

 private:
  Tiles tiles_;
  TileStrides strides_;
  TileView view_;
  std::vector<float> near_, forces_;
};

/// A lattice on the host.
class HostLattice {
 public:
  explicit HostLattice(const Mesh& mesh)
      : lattice_(make_lattice(mesh)), near_(3 * Lattice::near), forces_(24 * Lattice::elements) {}

  void advance(HostState& state, Step step) {
    for (int x = 0; x <= lattice_.along; x += Lattice::block_x) {
      for (int y = 0; y <= lattice_.across; y += Lattice::block_y) {
        for (int z = 0; z <= lattice_.across; z += Lattice::block_z) {
          advance_block(state, x, y, z, step);
        }
      }
    }
  }
  std::string columns() const {
    return ",,," + std::to_string(Lattice::shared_floats * sizeof(float));
  }

 private:
  void advance_block(HostState& state, int x, int y, int z, Step step) {
    load_block(lattice_, x, y, z, 0, 1, state.displacements.data(), near_.data());
    compute_block(lattice_, x, y, z, 0, 1, near_.data(), forces_.data());
    for (int q = 0; q < Lattice::block; ++q) {
      const int a = q / (Lattice::block_y * Lattice::block_z),
                b = q / Lattice::block_z % Lattice::block_y, c = q % Lattice::block_z;
      if (x + a > lattice_.along || y + b > lattice_.across || z + c > lattice_.across) continue;
      float f[3];
      sum_block(a, b, c, forces_.data(), f);
      state.advance_node(lattice_.number(x + a, y + b, z + c), f, step);
    }
  }

  Lattice lattice_;
  std::vector<float> near_, forces_;
};

/// Brings the damped bar to rest, and prints a row.
template <class Element, class HostBody>
void settle_on_host(int across, NodeOrder order) {
  const Mesh mesh = make_mesh<Element>(across, order);
  const double dt = time_step_of<Element>(mesh);
  const Step step = make_step(dt, gravity, settling_damping);
  HostBody body(mesh);
  HostState state(mesh);
  const int steps = int(settling_time / dt);
  for (int k = 0; k < steps; ++k) {
    body.advance(state, step);
    state.end_step();
  }
  const double deflection = deflection_of(mesh, state.displacements);
  std::printf("%s,%s,%d,%lld,%lld,%s,%.6e,%d,%.9e,%.5e\n", Element::name,
              order == NodeOrder::lattice ? "lattice" : "tiles", across,
              static_cast<long long>(mesh.nodes), static_cast<long long>(mesh.elements),
              body.columns().c_str(), dt, steps, deflection, deflection / reference_deflection - 1);
  std::fflush(stdout);
}

/// @param most cells across at most
inline void cpu(int most) {
  std::printf(
      "element,path,across,nodes,elements,tiles,tile_nodes,redundancy,shared_bytes,time_step_s,"
      "steps,deflection_m,error\n");
  for (int across = 2; across <= most; across *= 2) {
    settle_on_host<Brick, HostLattice>(across, NodeOrder::lattice);
    settle_on_host<Brick, HostTiles<Brick>>(across, NodeOrder::morton);
    settle_on_host<Tetrahedron, HostTiles<Tetrahedron>>(across, NodeOrder::morton);
  }
}

}  // namespace fem
