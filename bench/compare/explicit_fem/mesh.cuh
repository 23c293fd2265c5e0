/// Meshes of the bar.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "elements.cuh"

namespace fem {

/// A mesh of the bar, of one kind of element.
struct Mesh {
  int across = 0, along = 0;  ///< Cells across and along the bar.
  double cell = 0;            ///< Width of a cell [m].
  std::int64_t nodes = 0, elements = 0;
  std::vector<double> positions;    ///< At rest [m], three a node.
  std::vector<int> corners;         ///< Nodes of elements, element by element.
  std::vector<float4> rest;         ///< Displacement, zero, and the inverse mass, zero where held.
  std::vector<double> end_weights;  ///< Weights of nodes in the mean over the end of the bar.
};

/// The order of nodes: that of the lattice with z fastest, or along a Morton curve.
enum class NodeOrder { lattice, morton };

/// Returns a number with two zero bits after each bit of a coordinate.
inline std::uint64_t spread(std::uint64_t coordinate) {
  std::uint64_t spread = 0;
  for (int bit = 0; bit < 16; ++bit) spread |= (coordinate >> bit & 1) << (3 * bit);
  return spread;
}

/// Returns the nodes of the lattice in the order that the mesh has them.
inline std::vector<int> ordered_nodes(const Mesh& mesh, NodeOrder order) {
  std::vector<int> nodes(mesh.nodes);
  std::iota(nodes.begin(), nodes.end(), 0);
  if (order == NodeOrder::lattice) return nodes;
  const int row = mesh.across + 1, layer = row * row;
  std::vector<std::uint64_t> keys(mesh.nodes);
  for (const int a : nodes) {
    keys[a] = spread(a / layer) | spread(a % layer / row) << 1 | spread(a % row) << 2;
  }
  std::sort(nodes.begin(), nodes.end(), [&](int a, int b) { return keys[a] < keys[b]; });
  return nodes;
}

/// Appends the element or the five tetrahedra of a cell. @param corner nodes at the cell's corners
/// @param odd whether the sum of the cell's coordinates is odd: tetrahedra are mirrored there
template <class Element>
void add_cell(Mesh& mesh, const int corner[8], bool odd) {
  if (Element::nodes == 8) {
    mesh.corners.insert(mesh.corners.end(), corner, corner + 8);
    return;
  }
  constexpr int even[5][4] = {{1, 2, 4, 7}, {0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}};
  for (const auto& tetrahedron : even) {
    for (const int a : tetrahedron) mesh.corners.push_back(corner[odd ? a ^ 1 : a]);
  }
}

/// Returns lumped masses of nodes [kg], and turns tetrahedra so that their volumes are positive.
template <class Element>
std::vector<double> masses_of(Mesh& mesh) {
  std::vector<double> mass(mesh.nodes, 0);
  if constexpr (Element::nodes == 8) {
    for (const int a : mesh.corners) mass[a] += density * mesh.cell * mesh.cell * mesh.cell / 8;
  } else {
    for (std::int64_t e = 0; e < mesh.elements; ++e) {
      int* corner = &mesh.corners[4 * e];
      const auto position = [&](int a) { return &mesh.positions[3 * std::int64_t(corner[a])]; };
      double J[3][3], inverse[3][3];
      for (int a = 0; a < 3; ++a) {
        for (int j = 0; j < 3; ++j) J[a][j] = position(a + 1)[j] - position(0)[j];
      }
      const double det = invert(J, inverse);
      if (det < 0) std::swap(corner[2], corner[3]);
      for (int a = 0; a < 4; ++a) mass[corner[a]] += density * std::fabs(det) / 24;
    }
  }
  return mass;
}

/// Returns the mesh with so many cells across. Elements are in the order of their first corner.
template <class Element>
Mesh make_mesh(int across, NodeOrder order) {
  Mesh mesh;
  mesh.across = across;
  mesh.along = cells_along * across;
  mesh.cell = width / across;
  const int row = across + 1, layer = row * row;
  mesh.nodes = std::int64_t(mesh.along + 1) * layer;
  mesh.elements = std::int64_t(mesh.along) * across * across * (Element::nodes == 4 ? 5 : 1);
  const std::vector<int> nodes = ordered_nodes(mesh, order);
  std::vector<int> place(mesh.nodes);
  for (std::int64_t a = 0; a < mesh.nodes; ++a) place[nodes[a]] = int(a);

  mesh.positions.resize(3 * mesh.nodes);
  mesh.end_weights.assign(mesh.nodes, 0);
  mesh.corners.reserve(mesh.elements * Element::nodes);
  const auto share = [&](int k) { return k == 0 || k == across ? 0.5 : 1.0; };
  for (std::int64_t a = 0; a < mesh.nodes; ++a) {
    const int node = nodes[a], i = node / layer, j = node % layer / row, k = node % row;
    mesh.positions[3 * a] = i * mesh.cell;
    mesh.positions[3 * a + 1] = (j - 0.5 * across) * mesh.cell;
    mesh.positions[3 * a + 2] = (k - 0.5 * across) * mesh.cell;
    if (i == mesh.along) mesh.end_weights[a] = share(j) * share(k) / (double(across) * across);
    if (i == mesh.along || j == across || k == across) continue;
    int corner[8];
    for (int b = 0; b < 8; ++b) {
      corner[b] = place[node + (b & 1) * layer + (b >> 1 & 1) * row + (b >> 2 & 1)];
    }
    add_cell<Element>(mesh, corner, (i + j + k) % 2);
  }
  const std::vector<double> mass = masses_of<Element>(mesh);
  mesh.rest.resize(mesh.nodes);
  for (std::int64_t a = 0; a < mesh.nodes; ++a) {
    mesh.rest[a] = {0, 0, 0, mesh.positions[3 * a] == 0 ? 0.f : float(1 / mass[a])};
  }
  return mesh;
}

/// Computes the numbers of an element.
template <class Element>
void prepare(const Mesh& mesh, std::int64_t element, float* numbers) {
  double X[Element::nodes][3];
  for (int a = 0; a < Element::nodes; ++a) {
    const std::int64_t node = mesh.corners[element * Element::nodes + a];
    for (int j = 0; j < 3; ++j) X[a][j] = mesh.positions[3 * node + j];
  }
  Element::prepare(X, numbers);
}

/// The corners of elements at each node: those at node a are `items[first[a]]` up to
/// `items[first[a + 1]]`, as places in `Mesh::corners`.
struct CornersAtNodes {
  std::vector<int> first, items;
};

inline CornersAtNodes corners_at_nodes(const Mesh& mesh) {
  CornersAtNodes at;
  at.first.assign(mesh.nodes + 1, 0);
  for (const int a : mesh.corners) ++at.first[a + 1];
  std::partial_sum(at.first.begin(), at.first.end(), at.first.begin());
  std::vector<int> next(at.first.begin(), at.first.end() - 1);
  at.items.resize(mesh.corners.size());
  for (std::size_t i = 0; i < mesh.corners.size(); ++i) at.items[next[mesh.corners[i]]++] = int(i);
  return at;
}

/// Returns a time step a little below the largest stable one [s].
template <class Element>
double time_step_of(const Mesh& mesh) {
  return 0.95 * Element::courant * mesh.cell / std::sqrt((lame_lambda + 2. * lame_mu) / density);
}

/// Returns by how much the end of the bar has sunk [m].
inline double deflection_of(const Mesh& mesh, const std::vector<float4>& displacements) {
  double z = 0;
  for (std::int64_t a = 0; a < mesh.nodes; ++a) {
    if (mesh.end_weights[a] > 0) z += mesh.end_weights[a] * displacements[a].z;
  }
  return -z;
}

}  // namespace fem
