/// Exact sums on a device, to which the kernels of many steps add.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "check.hpp"
#include "exact_sum.hpp"
#include "setup/primitives.cuh"
#include "solver/host_arrays.cuh"

namespace phyxel::cuda {

/// What a kernel adds to: words of exact sums, shape [sums, words, accumulators].
struct SumWords {
  unsigned long long* words = nullptr;
  /// Accumulators of each sum, among which terms are dealt out so that few threads add to the same
  /// word at once.
  unsigned accumulators = 0;

  /// Adds a term to a sum. @param k number of the point that it is of
  __device__ void add(int sum, int k, double value) const {
    const unsigned own = static_cast<unsigned>(k) % accumulators;
    const unsigned first = static_cast<unsigned>(sum) * ExactSum::words;
    ExactSum::split(value, [&](int word, std::int64_t number) {
      if (number == 0) return;
      atomicAdd(words + (first + static_cast<unsigned>(word)) * accumulators + own,
                static_cast<unsigned long long>(number));
    });
  }
  /// The same for all threads of a warp at once, which add their terms up before one of them adds
  /// the sum: atomics to the same words wait for each other. Call it in all threads.
  __device__ void add_of_warp(int sum, int k, double value) const {
    std::int64_t number[3] = {};
    int word = 0, terms = 0;
    ExactSum::split(value, [&](int at, std::int64_t n) {
      if (terms == 0) word = at;
      number[terms++] = n;
    });
    // Threads whose terms have the same words, and go to the same sum, go together.
    const int own = sum * ExactSum::words + word;
    const bool counts = value != 0;
    for (unsigned left = __ballot_sync(all_threads, counts); left != 0;) {
      const int leader = __ffs(static_cast<int>(left)) - 1;
      const int leading = __shfl_sync(all_threads, own, leader);  // by all, whether they go or not
      const bool goes = counts && own == leading;
      const unsigned together = __ballot_sync(all_threads, goes);
      left &= ~together;
      if (!goes) continue;
      const bool leads = static_cast<int>(threadIdx.x % 32) == leader;
      for (int n = 0; n < 3; ++n) {
        const std::int64_t all = sum_of(together, number[n]);
        if (!leads || all == 0) continue;
        atomicAdd(words + static_cast<unsigned>(own + n) * accumulators +
                      static_cast<unsigned>(k) / 32 % accumulators,
                  static_cast<unsigned long long>(all));
      }
    }
  }

 private:
  static constexpr unsigned all_threads = 0xFFFF'FFFF;

  __device__ static int add_up(unsigned mask, int number) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
    return __reduce_add_sync(mask, number);
#else
    int sum = 0;
    for (int k = 0; k < 32; ++k) sum += mask >> k & 1 ? __shfl_sync(mask, number, k) : 0;
    return sum;
#endif
  }
  /// The sum over the threads of a mask, exact for numbers below 2^48.
  __device__ static std::int64_t sum_of(unsigned mask, std::int64_t number) {
    std::int64_t sum = 0;
    for (int part = 2; part >= 0; --part) {
      // The highest part has the sign; the others are 16 bits each.
      const int bits = part == 2 ? static_cast<int>(number >> 32)
                                 : static_cast<int>(number >> 16 * part & 0xFFFF);
      sum = (sum << 16) + add_up(mask, bits);
    }
    return sum;
  }
};

/// Exact sums whose words are on a device.
class DeviceSums {
 public:
  DeviceSums() = default;
  /// @param what the sums' name, for messages
  DeviceSums(int sums, unsigned accumulators, const std::string& what)
      : accumulators_(accumulators),
        earlier_(static_cast<std::size_t>(sums)),
        words_(earlier_.size() * ExactSum::words * accumulators_, what) {
    words_.clear();
  }

  bool empty() const { return earlier_.empty(); }
  std::size_t bytes() const { return words_.bytes(); }
  /// What kernels add to.
  SumWords pointer() const { return {words_.data(), accumulators_}; }
  /// Makes room for `times` terms more of each of `points`. @param wait waits for kernels in
  /// progress
  template <class Wait>
  void prepare(std::size_t points, int times, Wait&& wait) {
    constexpr std::int64_t most_terms = std::int64_t{1} << 29;  // half of what words hold
    constexpr std::int64_t of_warp = 32;
    terms_ += times * (static_cast<std::int64_t>(points) / accumulators_ + of_warp);
    if (terms_ < most_terms) return;
    wait();
    set(sums());
  }
  /// Replaces the sums. Launches that a graph has recorded go on to add to them.
  void set(std::vector<ExactSum> sums) {
    earlier_ = std::move(sums);
    words_.clear();
    terms_ = 0;
  }
  /// The sums so far. Call when no kernel is in progress.
  std::vector<ExactSum> sums() const {
    std::vector<ExactSum> all = earlier_;
    if (empty()) return all;
    const std::vector<unsigned long long> words = fetched(words_);
    for (std::size_t s = 0; s < all.size(); ++s) {
      for (unsigned a = 0; a < accumulators_; ++a) {
        // Words of carried sums are so small that those of one accumulator can be added.
        const std::span<std::int64_t> into = all[s].ready();
        for (std::size_t w = 0; w < into.size(); ++w) {
          into[w] += static_cast<std::int64_t>(words[(s * into.size() + w) * accumulators_ + a]);
        }
      }
      all[s].ready();
    }
    return all;
  }

 private:
  unsigned accumulators_ = 1;
  std::vector<ExactSum> earlier_;  // of steps before the words were last cleared
  DeviceArray<unsigned long long> words_;
  std::int64_t terms_ = 0;  // largest number of terms in an accumulator
};

}  // namespace phyxel::cuda
