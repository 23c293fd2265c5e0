/// Sums that do not depend on order.
#include "exact_sum.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace phyxel {
namespace {

double sum_of(const std::vector<double>& terms) {
  ExactSum sum;
  for (const double t : terms) sum.add(t);
  return sum.value();
}

TEST(ExactSum, OfOneTermIsTheTerm) {
  for (const double t : {0.0, 1.0, -1.0, 0.1, -3.7e-5, 1e300, -1e-300, 4.9e-324, -4.9e-324,
                         2.2250738585072014e-308, std::numeric_limits<double>::max(),
                         -std::numeric_limits<double>::max(), 123456789.123456789}) {
    EXPECT_EQ(sum_of({t}), t);
  }
}

TEST(ExactSum, CancelsWithoutATrace) {
  EXPECT_EQ(sum_of({1e300, 1, -1e300}), 1);
  EXPECT_EQ(sum_of({1e300, -1e-300, -1e300}), -1e-300);
  EXPECT_EQ(sum_of({0.1, 0.2, -0.3}), 0x1p-55);  // of the doubles nearest to them
  EXPECT_EQ(sum_of({1e16, 1, 1, -1e16}), 2);
  EXPECT_EQ(sum_of({-5, 3}), -2);
}

TEST(ExactSum, IsRoundedOnceToTheNearest) {
  EXPECT_EQ(sum_of({1, 0x1p-53}), 1);  // half way: to the even one
  EXPECT_EQ(sum_of({1, 0x1p-53, 0x1p-140}), 1 + 0x1p-52);
  EXPECT_EQ(sum_of({-1, -0x1p-53, -0x1p-300}), -1 - 0x1p-52);
  EXPECT_EQ(sum_of({1 + 0x1p-52, 0x1p-53, -0x1p-200}), 1 + 0x1p-52);
}

/// Of numbers over a hundred powers of ten, against sums of integers.
TEST(ExactSum, IsTheSameInAnyOrderAndInParts) {
  std::mt19937_64 engine(4);
  std::vector<double> terms;
  for (int k = 0; k < 20000; ++k) {
    const auto mantissa = static_cast<double>(static_cast<std::int64_t>(engine()));
    terms.push_back(std::ldexp(mantissa, static_cast<int>(engine() % 700) - 400));
  }
  const double whole = sum_of(terms);
  ExactSum parts[3];
  for (std::size_t k = 0; k < terms.size(); ++k) parts[engine() % 3].add(terms[k]);
  std::shuffle(terms.begin(), terms.end(), engine);
  EXPECT_EQ(sum_of(terms), whole);
  ExactSum words;  // as ranks do it
  for (ExactSum& part : parts) {
    const auto from = part.ready(), to = words.ready();
    for (std::size_t w = 0; w < to.size(); ++w) to[w] += from[w];
  }
  EXPECT_EQ(words.value(), whole);
  ExactSum added;
  for (const ExactSum& part : parts) added.add(part);
  EXPECT_EQ(added.value(), whole);
}

TEST(ExactSum, OfIntegersIsTheIntegers) {
  std::mt19937_64 engine(9);
  ExactSum sum;
  std::int64_t expected = 0;
  for (int k = 0; k < 100000; ++k) {
    const auto term = static_cast<std::int64_t>(engine() >> 24) - (std::int64_t{1} << 39);
    expected += term;
    sum.add(static_cast<double>(term));
  }
  EXPECT_EQ(sum.value(), static_cast<double>(expected));
}

TEST(ExactSum, TellsWhatIsNotFinite) {
  EXPECT_TRUE(std::isnan(sum_of({1, std::nan(""), 2})));
  EXPECT_TRUE(std::isnan(sum_of({1, std::numeric_limits<double>::infinity()})));
}

}  // namespace
}  // namespace phyxel
