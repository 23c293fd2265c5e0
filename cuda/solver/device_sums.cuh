/// Exact sums on a device, to which the kernels of many steps add.
#pragma once

#include <cstdint>
#include <string>
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
};

/// Exact sums whose words are on a device.
class DeviceSums {
 public:
  DeviceSums() = default;
  /// @param what the sums' name, for messages
  DeviceSums(int sums, unsigned accumulators, const std::string& what)
      : accumulators_(accumulators),
        what_(what),
        earlier_(static_cast<std::size_t>(sums)),
        words_(sent(zeros(), what)) {}

  bool empty() const { return earlier_.empty(); }
  std::size_t bytes() const { return words_.bytes(); }
  /// What kernels add to.
  SumWords pointer() const { return {words_.data(), accumulators_}; }
  /// Makes room for `times` terms more of each of `points`. @param wait waits for kernels in
  /// progress
  template <class Wait>
  void prepare(std::size_t points, int times, Wait&& wait) {
    constexpr std::int64_t most_terms = std::int64_t{1} << 29;  // half of what words hold
    terms_ += times * (static_cast<std::int64_t>(points) / accumulators_ + 1);
    if (terms_ < most_terms) return;
    wait();
    earlier_ = sums();
    words_ = sent(zeros(), what_);
    terms_ = 0;
  }
  /// The sums so far. Call when no kernel is in progress.
  std::vector<ExactSum> sums() const {
    std::vector<ExactSum> all = earlier_;
    if (empty()) return all;
    const std::vector<unsigned long long> words = fetched(words_);
    for (std::size_t s = 0; s < all.size(); ++s) {
      for (unsigned a = 0; a < accumulators_; ++a) {
        ExactSum one;
        const std::span<std::int64_t> into = one.ready();
        for (std::size_t w = 0; w < into.size(); ++w) {
          into[w] = static_cast<std::int64_t>(words[(s * into.size() + w) * accumulators_ + a]);
        }
        all[s].add(one);
      }
    }
    return all;
  }

 private:
  std::vector<unsigned long long> zeros() const {
    return std::vector<unsigned long long>(earlier_.size() * ExactSum::words * accumulators_);
  }

  unsigned accumulators_ = 1;
  std::string what_;
  std::vector<ExactSum> earlier_;  // of steps before the words were last cleared
  DeviceArray<unsigned long long> words_;
  std::int64_t terms_ = 0;  // largest number of terms in an accumulator
};

}  // namespace phyxel::cuda
