// Images that show only sky: no part of a smooth gradient ends a floor.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "tests/unit/distance_vector/measure.h"

namespace omnifleet::test {
namespace {

using distance_vector::DistanceVector;
using Fault = DistanceVector::Fault;

struct Gradient {
  std::string name;
  std::function<double(double)> share;  ///< of the horizon's colour; 0: zenith, 1: horizon
};

const std::vector<Gradient>& gradients() {
  static const std::vector<Gradient> all{
      {"linear", [](double x) { return x; }},
      {"quadratic", [](double x) { return x * x; }},
      {"cubic", [](double x) { return x * x * x; }},
      {"root", [](double x) { return std::sqrt(x); }},
      {"exponential", [](double x) { return (std::exp(4.0 * x) - 1.0) / (std::exp(4.0) - 1.0); }},
      {"steep exponential", [](double x) { return (std::exp(10.0 * x) - 1.0) / (std::exp(10.0) - 1.0); }},
      {"sigmoid", [](double x) { return 1.0 / (1.0 + std::exp(-8.0 * (x - 0.5))); }}};
  return all;
}

struct Colours {
  cv::Vec3d zenith, horizon;
};
const Colours kSkies[] = {{{230, 150, 90}, {245, 225, 205}},    // clear
                          {{215, 180, 150}, {235, 215, 200}},   // haze
                          {{225, 205, 190}, {230, 222, 215}},   // thin cloud
                          {{140, 90, 60}, {120, 160, 225}},     // evening
                          {{150, 150, 150}, {220, 220, 220}}};  // overcast

enum class Direction { kDown, kUp, kRight, kDiagonal };

/// @param noise σ of a pixel, grey levels
cv::Mat sky(const Gradient& gradient, const Colours& colours, Direction direction, double noise, bool cloudy,
            int seed) {
  cv::Mat image(240, 320, CV_8UC3), deviations(240, 320, CV_32FC3);
  cv::RNG random(static_cast<std::uint64_t>(seed) + 1);
  struct Cloud {
    double u, v, radius, share;
  };
  std::vector<Cloud> clouds;
  for (int i = 0; cloudy && i < 6; ++i)
    clouds.push_back({random.uniform(0.0, 320.0), random.uniform(0.0, 240.0), random.uniform(30.0, 90.0),
                      random.uniform(0.1, 0.4)});
  random.fill(deviations, cv::RNG::NORMAL, 0.0, noise);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u) {
      const double down = (v + 0.5) / image.rows, right = (u + 0.5) / image.cols;
      const double x = direction == Direction::kDown    ? down
                       : direction == Direction::kUp    ? 1.0 - down
                       : direction == Direction::kRight ? right
                                                        : 0.5 * (down + right);
      cv::Vec3d bgr = colours.zenith + gradient.share(x) * (colours.horizon - colours.zenith);
      for (const Cloud& c : clouds) {
        const double d2 = ((u - c.u) * (u - c.u) + 4.0 * (v - c.v) * (v - c.v)) / (c.radius * c.radius);
        bgr += c.share * std::exp(-d2) * (cv::Vec3d(235, 235, 235) - bgr);
      }
      cv::Vec3b& pixel = image.at<cv::Vec3b>(v, u);
      const cv::Vec3f& deviation = deviations.at<cv::Vec3f>(v, u);
      for (int k = 0; k < 3; ++k)
        pixel[k] = cv::saturate_cast<std::uint8_t>(bgr[k] + static_cast<double>(deviation[k]));
    }
  return image;
}

int claims(const DistanceVector& vector) {
  const auto& label = vector.scan().label;
  const auto invalid = std::count(label.begin(), label.end(), RayLabel::kInvalid);
  const auto& edges = vector.boundary().sigma;
  return static_cast<int>(label.size()) - static_cast<int>(invalid) +
         static_cast<int>(std::count_if(edges.begin(), edges.end(), [](float s) { return s != 0.0f; }));
}

// Each gradient in each sky, clear and with soft clouds, at three noises; directions in turn.
TEST(DistanceVectorSky, ClaimsNothingInASmoothGradient) {
  const lens::Camera camera{forwardCamera()};
  int n = 0;
  for (const Gradient& gradient : gradients())
    for (const Colours& colours : kSkies)
      for (const double noise : {0.0, 2.0, 5.0})
        for (const bool cloudy : {false, true}) {
          DistanceVector vector(camera, {});  // it has never seen a floor
          vector.process(sky(gradient, colours, static_cast<Direction>(n++ % 4), noise, cloudy, 7));
          const std::string where = gradient.name + " image " + std::to_string(n);
          EXPECT_EQ(vector.fault(), Fault::kNoFloor) << where;
          EXPECT_EQ(claims(vector), 0) << where;
        }
}

// The robot is lifted, or tips over: it has seen the floor before.
TEST(DistanceVectorSky, ClaimsNothingInASmoothGradientAfterAFloor) {
  const lens::Camera camera{forwardCamera()};
  const RayCaster caster(camera);
  World world;
  world.blocks.push_back({{0.6, 0.0}, {0.05, 2.0}, 0.0, 0.4, {60, 60, 170}});
  const cv::Mat floor = caster.render(world, {});
  for (const Gradient& gradient : gradients())
    for (const Colours& colours : kSkies) {
      DistanceVector vector(camera, {});
      vector.process(floor);
      ASSERT_EQ(vector.fault(), Fault::kNone);
      for (int frame = 0; frame < 6; ++frame) {  // after five frames another colour may count as floor
        vector.process(sky(gradient, colours, Direction::kDown, 2.0, false, frame));
        EXPECT_NE(vector.fault(), Fault::kNone) << gradient.name << " frame " << frame;
        EXPECT_EQ(claims(vector), 0) << gradient.name << " frame " << frame;
      }
    }
}

}  // namespace
}  // namespace omnifleet::test
