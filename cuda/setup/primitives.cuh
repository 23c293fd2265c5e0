/// Sorting, scans and reductions on the device, with phyxel's messages where memory runs out.
#pragma once

#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include <bit>
#include <cstdint>
#include <cub/cub.cuh>
#include <string>
#include <vector>

#include "check.hpp"
#include "model/box.hpp"

namespace phyxel::cuda {

inline constexpr int setup_threads = 256;

/// Calls body(i) for i in [0, count), one thread each.
template <class Body>
__global__ void for_each_kernel(std::int64_t count, Body body) {
  const std::int64_t i = static_cast<std::int64_t>(blockIdx.x) * setup_threads +
                         static_cast<std::int64_t>(threadIdx.x);
  if (i < count) body(i);
}
template <class Body>
void for_each(const char* kernel, std::int64_t count, const Body& body) {
  if (count <= 0) return;
  const auto blocks = static_cast<unsigned>((count + setup_threads - 1) / setup_threads);
  for_each_kernel<<<blocks, setup_threads, 0, work_stream()>>>(count, body);
  check_launch({kernel, blocks, setup_threads, std::to_string(count) + " at once"});
}

/// Runs a CUB algorithm with temporary memory on the stream `work_stream()`, which `algorithm`
/// passes on: its first call returns the size of the memory.
template <class Algorithm>
void with_temporary(Algorithm&& algorithm) {
  std::size_t bytes = 0;
  PHYXEL_CUDA(algorithm(nullptr, bytes));
  const DeviceArray<char> temporary(std::max<std::size_t>(bytes, 1), "set-up");
  PHYXEL_CUDA(algorithm(static_cast<void*>(temporary.data()), bytes));
}

/// The number of bits that hold numbers below `end`.
inline int bits_below(std::uint64_t end) {
  return std::max(1, static_cast<int>(std::bit_width(end - (end > 0))));
}

/// Stable sort of pairs by key, in place. @param bits number of low bits of the keys to compare;
/// higher bits are zero
template <class Key, class Value>
void sort_pairs(DeviceArray<Key>& keys, DeviceArray<Value>& values, int bits = 8 * sizeof(Key)) {
  const auto count = static_cast<std::int64_t>(keys.size());
  DeviceArray<Key> sorted_keys(keys.size(), "set-up");
  DeviceArray<Value> sorted_values(values.size(), "set-up");
  with_temporary([&](void* memory, std::size_t& bytes) {
    return cub::DeviceRadixSort::SortPairs(memory, bytes, keys.data(), sorted_keys.data(),
                                           values.data(), sorted_values.data(), count, 0, bits,
                                           work_stream());
  });
  keys = std::move(sorted_keys);
  values = std::move(sorted_values);
}

template <class T>
void sort_values(DeviceArray<T>& values, int bits = 8 * sizeof(T)) {
  DeviceArray<T> sorted(values.size(), "set-up");
  with_temporary([&](void* memory, std::size_t& bytes) {
    return cub::DeviceRadixSort::SortKeys(memory, bytes, values.data(), sorted.data(),
                                          static_cast<std::int64_t>(values.size()), 0, bits,
                                          work_stream());
  });
  values = std::move(sorted);
}

/// Reduces `values` in an unspecified order; `combine` must be associative and commutative.
/// @param result on the device
template <class In, class T, class Combine>
void reduce_into(T* result, In values, std::int64_t count, T start, Combine combine) {
  with_temporary([&](void* memory, std::size_t& bytes) {
    return cub::DeviceReduce::Reduce(memory, bytes, values, result, count, combine, start,
                                     work_stream());
  });
}
/// Reduces them, and waits for the result.
template <class In, class T, class Combine>
T reduce(In values, std::int64_t count, T start, Combine combine) {
  const DeviceArray<T> result(1, "set-up");
  reduce_into(result.data(), values, count, start, combine);
  T out;
  result.download(&out);
  return out;
}

struct Plus {
  template <class T>
  __host__ __device__ T operator()(T a, T b) const {
    return a + b;
  }
};
struct Larger {
  template <class T>
  __host__ __device__ T operator()(T a, T b) const {
    return a > b ? a : b;
  }
};
struct Smaller {
  template <class T>
  __host__ __device__ T operator()(T a, T b) const {
    return a < b ? a : b;
  }
};

/// Exclusive prefix sums with the total at the end: sums[k] = values[0] + ... + values[k-1], shape
/// [values + 1].
template <class T>
DeviceArray<T> running_sums(const DeviceArray<T>& values) {
  DeviceArray<T> sums(values.size() + 1, "set-up");
  PHYXEL_CUDA(cudaMemsetAsync(sums.data(), 0, sizeof(T), work_stream()));
  if (values.size() == 0) return sums;
  with_temporary([&](void* memory, std::size_t& bytes) {
    return cub::DeviceScan::InclusiveSum(memory, bytes, values.data(), sums.data() + 1,
                                         static_cast<std::int64_t>(values.size()), work_stream());
  });
  return sums;
}

/// The values with a flag, in their order, at the front of an array with room for all. Does not
/// wait. @param flags of the values, 0 or 1, of type char
/// @param count receives the number of flagged values on the device, if there are flags
template <class In, class T>
DeviceArray<T> flagged_of(In values, const DeviceArray<char>& flags, std::int64_t* count) {
  DeviceArray<T> chosen(flags.size(), "set-up");
  if (flags.size() == 0) return chosen;
  with_temporary([&](void* memory, std::size_t& bytes) {
    return cub::DeviceSelect::Flagged(memory, bytes, values, flags.data(), chosen.data(), count,
                                      static_cast<std::int64_t>(flags.size()), work_stream());
  });
  return chosen;
}
/// The values with a flag, in their order. Waits. @param flags as of `flagged_of`
template <class In, class T>
DeviceArray<T> flagged(In values, const DeviceArray<char>& flags) {
  const DeviceArray<std::int64_t> count(1, "set-up");
  const DeviceArray<T> chosen = flagged_of<In, T>(values, flags, count.data());
  if (flags.size() == 0) return {};
  std::int64_t number = 0;
  count.download(&number);
  DeviceArray<T> kept(static_cast<std::size_t>(number), "set-up");
  if (number > 0) {
    PHYXEL_CUDA(cudaMemcpyAsync(kept.data(), chosen.data(), kept.bytes(), cudaMemcpyDeviceToDevice,
                                work_stream()));
  }
  return kept;
}
/// The numbers of the flags that are 1.
inline DeviceArray<Index> flagged_numbers(const DeviceArray<char>& flags) {
  return flagged<thrust::counting_iterator<Index>, Index>(thrust::counting_iterator<Index>(0),
                                                          flags);
}

template <class T>
T last_of(const DeviceArray<T>& array) {
  T value;
  array.download(&value, array.size() - 1, 1);
  return value;
}

template <class T>
DeviceArray<T> sent(const std::vector<T>& values, const std::string& what) {
  DeviceArray<T> array(values.size(), what);
  array.upload(values.data());
  return array;
}
template <class T>
std::vector<T> fetched(const DeviceArray<T>& array, std::size_t first, std::size_t count) {
  std::vector<T> values(count);
  array.download(values.data(), first, count);
  return values;
}
template <class T>
std::vector<T> fetched(const DeviceArray<T>& array) {
  return fetched(array, 0, array.size());
}

/// Writes the starts of lists; see `starts_of`.
template <class Start, class List>
struct StartLists {
  const List* list;
  std::size_t entries, lists;
  Start* start;
  __device__ void operator()(std::int64_t e) const {
    const auto entry = static_cast<std::size_t>(e);
    const std::size_t end = entry < entries ? static_cast<std::size_t>(list[entry]) : lists;
    const std::size_t begin = entry > 0 ? static_cast<std::size_t>(list[entry - 1]) + 1 : 0;
    for (std::size_t l = begin; l <= end; ++l) start[l] = static_cast<Start>(entry);
  }
};
/// The first entry of each list, and the number of entries at the end, shape [lists + 1].
/// @param list of each entry, ascending
template <class Start, class List>
DeviceArray<Start> starts_of(const DeviceArray<List>& list, std::size_t lists,
                             const std::string& what) {
  DeviceArray<Start> starts(lists + 1, what);
  for_each("start_lists", static_cast<std::int64_t>(list.size()) + 1,
           StartLists<Start, List>{list.data(), list.size(), lists, starts.data()});
  return starts;
}

struct AroundBoth {
  __host__ __device__ Box operator()(const Box& a, const Box& b) const {
    return {{fmin(a.low.x, b.low.x), fmin(a.low.y, b.low.y), fmin(a.low.z, b.low.z)},
            {fmax(a.high.x, b.high.x), fmax(a.high.y, b.high.y), fmax(a.high.z, b.high.z)}};
  }
};
struct AroundPoint {
  __host__ __device__ Box operator()(const Vec3<double>& p) const { return {p, p}; }
};

}  // namespace phyxel::cuda
