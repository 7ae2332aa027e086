#include "ground/hue_window.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::ground {
namespace {

constexpr int kWidth = 61, kHeight = 47;

/// Sum and number of the marked pixels around one pixel, by a loop over all of them.
struct SumsAround {
  cv::Vec3d sum{0, 0, 0};
  int count = 0;
  SumsAround(const cv::Mat3b& image, const cv::Mat1b& marks, int x, int y) {
    constexpr int r = HueWindow::kAround_px;
    for (int v = std::max(0, y - r); v <= std::min(image.rows - 1, y + r); ++v) {
      for (int u = std::max(0, x - r); u <= std::min(image.cols - 1, x + r); ++u) {
        if ((marks(v, u) & HueWindow::kCounts) == 0) continue;
        sum += cv::Vec3d(image(v, u));
        ++count;
      }
    }
  }
};

struct Scene {
  cv::RNG random{7};
  cv::Mat3b image = cv::Mat3b(kHeight, kWidth);
  cv::Mat1b marks = cv::Mat1b(kHeight, kWidth);
  Scene() {
    random.fill(image, cv::RNG::UNIFORM, 0, 256);
    random.fill(marks, cv::RNG::UNIFORM, 0, 4);
  }
  /// Rows of one or two runs; some rows are missing.
  std::vector<Run> region() {
    std::vector<Run> runs;
    for (int y = 0; y < kHeight; ++y) {
      if (random.uniform(0, 6) == 0) continue;
      const int begin = random.uniform(0, kWidth / 2), middle = random.uniform(begin, kWidth / 2) + 1;
      runs.push_back({y, begin, middle});
      if (random.uniform(0, 2) == 0) runs.push_back({y, middle + 3, kWidth});
    }
    return runs;
  }
};

TEST(HueWindow, SumsMarkedPixelsAroundEachPixel) {
  Scene scene;
  HueWindow window(kWidth);
  int seen = 0;
  for (int region = 0; region < 20; ++region) {  // consecutive regions must not influence each other
    scene.random.fill(scene.marks, cv::RNG::UNIFORM, 0, 4);
    window.begin();
    for (const ground::Run& run : scene.region()) {
      int next = run.begin;
      window.slide(run, scene.image, scene.marks, [&](int x, HueWindow::Sum sum) {
        EXPECT_EQ(x, next++);
        const SumsAround expected(scene.image, scene.marks, x, run.row);
        ASSERT_EQ(HueWindow::count(sum), expected.count);
        if (expected.count == 0) return;
        ++seen;
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(HueWindow::mean(sum)[c], expected.sum[c] / expected.count, 1e-4);
      });
      EXPECT_EQ(next, run.end);
    }
  }
  EXPECT_GT(seen, 10000);
}

}  // namespace
}  // namespace omnifleet::ground
