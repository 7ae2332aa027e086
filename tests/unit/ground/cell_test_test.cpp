// Compares the tolerances of many cells at once with those of single cells (FloorTolerance::testFor).

#include <gtest/gtest.h>

#include <cmath>

#include "ground/cell_test.h"
#include "ground/region_growing.h"

namespace omnifleet::ground {
namespace {

TEST(CellLimits, MatchSingleCellTolerances) {
  constexpr int kCells = 37;  // no multiple of a vector's length
  const FloorTolerance tolerance{0.11, 0.035, 3.0};
  const FloorNoise noise{2.4, 0.9};
  CellLimits limits(kCells);
  std::vector<cv::Vec3f> floor;
  for (int round = 0; round < 2; ++round) {  // the second row must not depend on the first
    limits.clear();
    floor.clear();
    for (int x = 0; x < kCells - round; ++x) {
      const auto level = static_cast<float>(7 * x + round);
      floor.emplace_back(level, 0.9f * level, 255.0f - level);
      if (x == 5) floor.back() = {0.0f, 0.0f, 0.0f};  // black
      limits.add(3 * x, &floor.back()[0]);
    }
    limits.settle({0.11f, 0.035f, 3.0f, 2.4f, 0.9f});
    ASSERT_EQ(limits.size(), floor.size());
    for (std::size_t i = 0; i < limits.size(); ++i) {
      const FloorTest one = tolerance.testFor(floor[i], noise);
      EXPECT_EQ(limits.x(i), 3 * static_cast<int>(i));
      EXPECT_FLOAT_EQ(limits.along2(i), one.along2);
      EXPECT_FLOAT_EQ(limits.across2(i), one.across2);
      const float squared = std::max(1.0f, floor[i].dot(floor[i]));
      EXPECT_FLOAT_EQ(limits.squared(i), squared);
      EXPECT_FLOAT_EQ(limits.length(i), std::sqrt(squared));
    }
  }
}

}  // namespace
}  // namespace omnifleet::ground
