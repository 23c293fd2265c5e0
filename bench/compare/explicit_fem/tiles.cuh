/// Tiles: parts of a mesh, each of which a block of threads advances in its shared memory.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "mesh.cuh"

namespace fem {

constexpr int usual_tile = 256;  ///< Nodes that a tile owns, unless measured otherwise.

/// Where a tile's data begin, and how many there are.
struct alignas(16) TileHead {
  int first_near, near;         ///< Nodes of its elements that it does not own.
  int first_element, elements;  ///< Elements at a node that it owns.
};

/// All tiles of a mesh. A tile owns consecutive nodes, which come first among its nodes; an element
/// is in every tile that owns a node of it.
struct Tiles {
  int own = 0, count = 0, most_nodes = 0, most_elements = 0;
  std::vector<TileHead> head;
  std::vector<int> first_item;        ///< Of each tile.
  std::vector<int> near;              ///< Nodes in the mesh.
  std::vector<std::uint16_t> corner;  ///< Nodes in the tile: the first one of each element first.
  std::vector<std::uint16_t> row;     ///< Where a node's items begin; own + 1 numbers a tile.
  std::vector<std::uint16_t> items;   ///< Places of a node's forces among those of the tile.
  std::vector<float> numbers;         ///< Numbers of elements: the first one of each first.
  double redundancy = 0;              ///< Elements of all tiles over those of the mesh.
};

/// A tile while tiles are made.
struct TilePart {
  std::vector<int> elements, near;
  std::vector<std::uint16_t> corner, row, items;
};

/// Makes tiles one after the other. Each thread has its own.
template <class Element>
class TileMaker {
 public:
  TileMaker(const Mesh& mesh, const CornersAtNodes& at, int own)
      : mesh_(mesh), at_(at), own_(own), place_(mesh.nodes, -1), rows_(own) {}

  TilePart part(int tile) {
    TilePart part;
    const std::int64_t begin = std::int64_t(tile) * own_;
    const std::int64_t end = std::min(mesh_.nodes, begin + own_);
    for (int i = at_.first[begin]; i < at_.first[end]; ++i) {
      part.elements.push_back(at_.items[i] / Element::nodes);
    }
    std::sort(part.elements.begin(), part.elements.end());
    part.elements.erase(std::unique(part.elements.begin(), part.elements.end()),
                        part.elements.end());
    for (std::int64_t a = begin; a < end; ++a) place_[a] = int(a - begin);
    put_corners(part, int(end - begin));
    for (std::int64_t a = begin; a < end; ++a) place_[a] = -1;
    for (const int a : part.near) place_[a] = -1;
    return part;
  }

 private:
  /// @param own nodes that the tile owns
  void put_corners(TilePart& part, int own) {
    const int elements = int(part.elements.size());
    part.corner.resize(std::size_t(elements) * Element::nodes);
    for (auto& row : rows_) row.clear();
    int nodes = own;
    for (int i = 0; i < elements; ++i) {
      for (int c = 0; c < Element::nodes; ++c) {
        const int a = mesh_.corners[std::int64_t(part.elements[i]) * Element::nodes + c];
        if (place_[a] < 0) {
          place_[a] = nodes++;
          part.near.push_back(a);
        }
        part.corner[c * elements + i] = std::uint16_t(place_[a]);
        if (place_[a] < own) rows_[place_[a]].push_back(std::uint16_t(c * elements + i));
      }
    }
    part.row.push_back(0);
    for (const auto& row : rows_) {
      part.items.insert(part.items.end(), row.begin(), row.end());
      part.row.push_back(std::uint16_t(part.items.size()));
    }
  }

  const Mesh& mesh_;
  const CornersAtNodes& at_;
  int own_;
  std::vector<int> place_;  // of nodes of the mesh in the tile, or -1
  std::vector<std::vector<std::uint16_t>> rows_;
};

/// Sets the heads and sizes of tiles.
template <class Element>
void put_heads(const Mesh& mesh, const std::vector<TilePart>& parts, Tiles& tiles) {
  std::int64_t near = 0, elements = 0, items = 0;
  for (int tile = 0; tile < tiles.count; ++tile) {
    const TilePart& part = parts[tile];
    const std::int64_t owned =
        std::min<std::int64_t>(tiles.own, mesh.nodes - std::int64_t(tile) * tiles.own);
    tiles.head.push_back(
        {int(near), int(part.near.size()), int(elements), int(part.elements.size())});
    tiles.first_item.push_back(int(items));
    near += part.near.size();
    elements += part.elements.size();
    items += part.items.size();
    tiles.most_nodes = std::max(tiles.most_nodes, int(owned + part.near.size()));
    tiles.most_elements = std::max(tiles.most_elements, int(part.elements.size()));
  }
  tiles.near.resize(near);
  tiles.corner.resize(elements * Element::nodes);
  tiles.numbers.resize(elements * Element::numbers);
  tiles.row.resize(std::int64_t(tiles.count) * (tiles.own + 1));
  tiles.items.resize(items);
  tiles.redundancy = double(elements) / mesh.elements;
}

/// Divides a mesh into tiles. @param own nodes that a tile owns
template <class Element>
Tiles make_tiles(const Mesh& mesh, int own) {
  Tiles tiles;
  tiles.own = own;
  tiles.count = int((mesh.nodes + own - 1) / own);
  const CornersAtNodes at = corners_at_nodes(mesh);
  std::vector<TilePart> parts(tiles.count);
#pragma omp parallel
  {
    TileMaker<Element> maker(mesh, at, own);
#pragma omp for schedule(dynamic, 16)
    for (int tile = 0; tile < tiles.count; ++tile) parts[tile] = maker.part(tile);
  }
  put_heads<Element>(mesh, parts, tiles);
#pragma omp parallel for schedule(dynamic, 16)
  for (int tile = 0; tile < tiles.count; ++tile) {
    const TilePart& part = parts[tile];
    const TileHead& head = tiles.head[tile];
    const std::int64_t first = head.first_element;
    std::copy(part.near.begin(), part.near.end(), tiles.near.begin() + head.first_near);
    std::copy(part.corner.begin(), part.corner.end(),
              tiles.corner.begin() + first * Element::nodes);
    std::copy(part.row.begin(), part.row.end(), tiles.row.begin() + std::int64_t(tile) * (own + 1));
    std::copy(part.items.begin(), part.items.end(), tiles.items.begin() + tiles.first_item[tile]);
    float *all = &tiles.numbers[first * Element::numbers], numbers[Element::numbers];
    for (int i = 0; i < head.elements; ++i) {
      prepare<Element>(mesh, part.elements[i], numbers);
      for (int q = 0; q < Element::numbers; ++q) all[q * head.elements + i] = numbers[q];
    }
  }
  return tiles;
}

/// The arrays of tiles in the memory of a GPU or of the host.
struct TileView {
  int nodes, own;
  const TileHead* head;
  const int *first_item, *near;
  const std::uint16_t *corner, *row, *items;
  const float* numbers;
};

/// Distances between components in the shared memory of a tile: odd, against bank conflicts.
struct TileStrides {
  int nodes, forces;
};

template <class Element>
TileStrides strides_of(const Tiles& tiles) {
  return {tiles.most_nodes | 1, (tiles.most_elements * Element::nodes) | 1};
}
/// Returns the shared memory of a tile [bytes].
inline std::size_t shared_bytes(TileStrides strides) {
  return 3 * sizeof(float) * (std::size_t(strides.nodes) + strides.forces);
}

// The phases of a tile's step are loops over the threads of a block, so that a processor can run
// them too, as thread 0 of 1.

/// Copies the displacements u of a tile's nodes to `near`, shape [3, stride].
template <class Element>
FEM_HD void load_tile(const TileView& tiles, int tile, int thread, int threads, const float4* u,
                      float* near, int stride) {
  const TileHead head = tiles.head[tile];
  const int begin = tile * tiles.own;
  const int owned = tiles.nodes - begin < tiles.own ? tiles.nodes - begin : tiles.own;
  for (int s = thread; s < owned + head.near; s += threads) {
    const float4 x = u[s < owned ? begin + s : tiles.near[head.first_near + s - owned]];
    near[s] = x.x;
    near[stride + s] = x.y;
    near[2 * stride + s] = x.z;
  }
}

/// Computes the forces of a tile's elements, shape [3, force_stride].
template <class Element>
FEM_HD void compute_tile(const TileView& tiles, int tile, int thread, int threads,
                         const float* near, int stride, float* forces, int force_stride) {
  const TileHead head = tiles.head[tile];
  const std::uint16_t* corner = tiles.corner + std::int64_t(head.first_element) * Element::nodes;
  const float* numbers = tiles.numbers + std::int64_t(head.first_element) * Element::numbers;
  for (int e = thread; e < head.elements; e += threads) {
    float u[Element::nodes][3], f[Element::nodes][3], d[Element::numbers];
    for (int i = 0; i < Element::numbers; ++i) d[i] = numbers[i * head.elements + e];
    for (int a = 0; a < Element::nodes; ++a) {
      const int s = corner[a * head.elements + e];
      u[a][0] = near[s];
      u[a][1] = near[stride + s];
      u[a][2] = near[2 * stride + s];
    }
    Element::forces(u, d, f);
    for (int a = 0; a < Element::nodes; ++a) {
      for (int i = 0; i < 3; ++i) forces[i * force_stride + a * head.elements + e] = f[a][i];
    }
  }
}

/// Sums the forces at a node of a tile.
FEM_HD void sum_tile(const TileView& tiles, int tile, int node, const float* forces,
                     int force_stride, float sum[3]) {
  const std::uint16_t* row = tiles.row + std::int64_t(tile) * (tiles.own + 1);
  const std::uint16_t* items = tiles.items + tiles.first_item[tile];
  sum[0] = sum[1] = sum[2] = 0;
  for (int i = row[node]; i < row[node + 1]; ++i) {
    const int k = items[i];
    sum[0] += forces[k];
    sum[1] += forces[force_stride + k];
    sum[2] += forces[2 * force_stride + k];
  }
}

}  // namespace fem
