/// A body on the GPU, and the launches of its steps.
#pragma once

#include <cstdint>
#include <vector>

#include "device.cuh"
#include "kernels.cuh"

namespace fem {

/// Ways to advance a body.
enum class Path {
  atomics,   ///< A thread an element adds its forces to nodes; then a thread a node moves it.
  gather,    ///< A thread an element writes its forces; then a thread a node sums and moves.
  tiles,     ///< One launch: a block a tile computes all elements at its nodes.
  lattice,   ///< One launch, of bricks in the order of the lattice, without index or element data.
  resident,  ///< One launch for many steps: the body is in the shared memory of one block.
};

inline const char* name_of(Path path) {
  switch (path) {
    case Path::atomics:
      return "atomics";
    case Path::gather:
      return "gather";
    case Path::tiles:
      return "tiles";
    case Path::lattice:
      return "lattice";
    default:
      return "resident";
  }
}

/// Returns whether one block holds a mesh, as the path `resident` needs.
template <class Element>
bool fits_one_block(const Mesh& mesh) {
  return mesh.nodes <= Element::resident_threads &&
         mesh.elements <= Element::resident_threads * Element::resident_elements;
}

template <class Element>
class Body {
 public:
  /// @param mesh must outlive this. @param tile nodes that a tile owns, of the path `tiles`
  Body(const Mesh& mesh, Path path, int tile = usual_tile)
      : mesh_(mesh),
        path_(path),
        displacements_{DeviceArray<float4>(mesh.rest), DeviceArray<float4>(mesh.rest)},
        velocities_(zeros()) {
    switch (path) {
      case Path::atomics:
        put_elements();
        forces_ = DeviceArray<float4>(zeros());
        break;
      case Path::gather: {
        put_elements();
        forces_ = DeviceArray<float4>(mesh.corners.size());
        const CornersAtNodes at = corners_at_nodes(mesh);
        first_ = DeviceArray<int>(at.first);
        items_ = DeviceArray<int>(at.items);
        break;
      }
      case Path::tiles:
        put_tiles(tile);
        allow_shared(step_tiles<Element>);
        break;
      case Path::resident:
        put_tiles(int(mesh.nodes));
        allow_shared(resident_kernel);
        break;
      case Path::lattice:
        lattice_ = make_lattice(mesh);
        shared_ = Lattice::shared_floats * sizeof(float);
        allow_shared(step_lattice);
        break;
    }
  }

  const Mesh& mesh() const { return mesh_; }
  Path path() const { return path_; }
  const Stream& stream() const { return stream_; }

  /// Returns a graph of steps, an even number of them. This must outlive it.
  Graph graph(Step step, int steps) const {
    return Graph(stream_, [&] {
      if (path_ == Path::resident) {
        launch_resident(step, steps);
      } else {
        for (int k = 0; k < steps; ++k) launch(k, step);
      }
    });
  }
  /// Puts the body back to rest.
  void reset() {
    for (auto& displacements : displacements_) displacements.copy(mesh_.rest);
    velocities_.copy(zeros());
  }
  /// Returns displacements after an even number of steps [m]. @param begin, end range of nodes
  std::vector<float4> displacements(std::int64_t begin, std::int64_t end) const {
    std::vector<float4> values(end - begin);
    stream_.wait();
    FEM_CUDA(cudaMemcpy(values.data(), displacements_[0].data() + begin,
                        values.size() * sizeof(float4), cudaMemcpyDeviceToHost));
    return values;
  }
  std::vector<float4> displacements() const { return displacements(0, mesh_.nodes); }

 private:
  static constexpr auto resident_kernel =
      step_resident<Element, Element::resident_threads, Element::resident_elements>;

  std::vector<float4> zeros() const { return std::vector<float4>(mesh_.nodes, float4{0, 0, 0, 0}); }
  /// Allows the shared memory of a kernel's blocks. @throws std::runtime_error if it is too much
  template <class Kernel>
  void allow_shared(Kernel* kernel) {
    FEM_CUDA(
        cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, int(shared_)));
  }
  void put_elements() {
    corners_ = DeviceArray<int>(mesh_.corners);
    std::vector<float> all(mesh_.elements * Element::numbers);
#pragma omp parallel for
    for (std::int64_t e = 0; e < mesh_.elements; ++e) {
      float numbers[Element::numbers];
      prepare<Element>(mesh_, e, numbers);
      for (int i = 0; i < Element::numbers; ++i) all[i * mesh_.elements + e] = numbers[i];
    }
    numbers_ = DeviceArray<float>(all);
  }
  void put_tiles(int own) {
    const Tiles tiles = make_tiles<Element>(mesh_, own);
    head_ = DeviceArray<TileHead>(tiles.head);
    first_ = DeviceArray<int>(tiles.first_item);
    near_ = DeviceArray<int>(tiles.near);
    tile_corners_ = DeviceArray<std::uint16_t>(tiles.corner);
    tile_rows_ = DeviceArray<std::uint16_t>(tiles.row);
    tile_items_ = DeviceArray<std::uint16_t>(tiles.items);
    numbers_ = DeviceArray<float>(tiles.numbers);
    tiles_ = {int(mesh_.nodes),  own,
              head_.data(),      first_.data(),
              near_.data(),      tile_corners_.data(),
              tile_rows_.data(), tile_items_.data(),
              numbers_.data()};
    strides_ = strides_of<Element>(tiles);
    shared_ = shared_bytes(strides_);
    tile_count_ = tiles.count;
  }

  /// Returns the blocks of a kernel with a thread for each of `count` items.
  static int blocks_of(std::int64_t count) {
    return int((count + block_threads - 1) / block_threads);
  }
  /// Launches step k, of any path but `resident`.
  void launch(int k, Step step) const {
    float4* const v = velocities_.data();
    float4 *const now = displacements_[k % 2].data(), *const next =
                                                          displacements_[1 - k % 2].data();
    float4* const u = displacements_[0].data();  // of paths that overwrite displacements
    const int nodes = int(mesh_.nodes), elements = int(mesh_.elements);
    const cudaStream_t stream = stream_.get();
    if (path_ == Path::atomics) {
      add_forces<Element><<<blocks_of(elements), block_threads, 0, stream>>>(
          elements, corners_.data(), numbers_.data(), u, forces_.data());
      move_nodes<<<blocks_of(nodes), block_threads, 0, stream>>>(nodes, u, v, forces_.data(), step);
    } else if (path_ == Path::gather) {
      write_forces<Element><<<blocks_of(elements), block_threads, 0, stream>>>(
          elements, corners_.data(), numbers_.data(), u, forces_.data());
      gather_forces<<<blocks_of(nodes), block_threads, 0, stream>>>(
          nodes, first_.data(), items_.data(), forces_.data(), u, v, step);
    } else if (path_ == Path::tiles) {
      step_tiles<Element><<<tile_count_, block_threads, shared_, stream>>>(
          tiles_, strides_.nodes, strides_.forces, now, next, v, step);
    } else {
      using L = Lattice;
      const dim3 blocks((mesh_.across + L::block_z) / L::block_z,
                        (mesh_.across + L::block_y) / L::block_y,
                        (mesh_.along + L::block_x) / L::block_x);
      step_lattice<<<blocks, L::block, shared_, stream>>>(lattice_, now, next, v, step);
    }
    FEM_CUDA(cudaGetLastError());
  }
  void launch_resident(Step step, int steps) const {
    resident_kernel<<<1, Element::resident_threads, shared_, stream_.get()>>>(
        tiles_, strides_.nodes, strides_.forces, displacements_[0].data(), velocities_.data(), step,
        steps);
    FEM_CUDA(cudaGetLastError());
  }

  const Mesh& mesh_;
  Path path_;
  Stream stream_;
  DeviceArray<float4> displacements_[2], velocities_;
  DeviceArray<float4> forces_;  // at nodes; of the path `gather`, at the corners of elements
  DeviceArray<int> corners_, first_, items_, near_;
  DeviceArray<std::uint16_t> tile_corners_, tile_rows_, tile_items_;
  DeviceArray<TileHead> head_;
  DeviceArray<float> numbers_;
  TileView tiles_{};
  TileStrides strides_{};
  int tile_count_ = 0;
  std::size_t shared_ = 0;  // of a block [bytes]
  Lattice lattice_{};
};

}  // namespace fem
