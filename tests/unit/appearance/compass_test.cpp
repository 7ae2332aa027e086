#include "appearance/compass.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "geometry/pose2.h"
#include "tests/unit/appearance/textured_room.h"

namespace omnifleet::appearance {
namespace {

constexpr double kDegree = M_PI / 180.0;

Signature signatureOf(const cv::Mat1b& panorama) {
  static const Unwrapper kUnwrapper = test::roomUnwrapper();
  static SignatureMaker maker(kUnwrapper, {});
  return maker.compute(panorama);
}

cv::Mat1b shifted(const cv::Mat1b& panorama, int columns) {
  cv::Mat1b out(panorama.size());
  for (int c = 0; c < panorama.cols; ++c)
    panorama.col(c).copyTo(out.col((c + columns + panorama.cols) % panorama.cols));
  return out;
}

double errorDeg(const CompassResult& result, double truth_rad) {
  return std::abs(wrapAngle(result.turn_rad - truth_rad)) / kDegree;
}

CompassOptions literal() {
  CompassOptions options;
  options.method = CompassMethod::kLiteral;
  return options;
}

TEST(Compass, LiteralMethodFindsEveryColumnShift) {
  const cv::Mat1b panorama = test::TexturedRoom(1).panorama({0.2, 0.3, 0.0}, {});
  const Signature before = signatureOf(panorama);
  Compass compass(literal());
  for (int q = 0; q < 512; ++q) {
    // A robot that turns counter-clockwise sees everything move clockwise.
    const CompassResult result = compass.compare(before, signatureOf(shifted(panorama, -q)));
    ASSERT_LT(errorDeg(result, wrapAngle(2.0 * M_PI * q / 512)), 1e-6) << q;
    ASSERT_NEAR(result.height, 1.0, 1e-3);
  }
}

TEST(Compass, FindsColumnShiftsWithinAHundredthOfADegree) {
  const cv::Mat1b panorama = test::TexturedRoom(2).panorama({-0.5, 0.1, 0.7}, {});
  const Signature before = signatureOf(panorama);
  Compass compass;
  for (const int q : {0, 1, 2, 5, 40, 127, 256, 300, 510}) {
    const CompassResult result = compass.compare(before, signatureOf(shifted(panorama, -q)));
    EXPECT_LT(errorDeg(result, wrapAngle(2.0 * M_PI * q / 512)), 0.01) << q;
    EXPECT_GT(result.confidence, 0.9);
  }
}

TEST(Compass, FindsRotationOnTheSpotWithinATenthOfADegree) {
  double sum = 0.0, largest = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const test::TexturedRoom room(seed);
    const Signature before = signatureOf(room.panorama({0.4, -0.2, 0.1}, {}));
    Compass compass;
    for (const double turn : {0.003, 0.05, 0.4, 1.234, -2.5}) {
      const CompassResult result =
          compass.compare(before, signatureOf(room.panorama({0.4, -0.2, 0.1 + turn}, {})), {0.0, 0.02, 0.0});
      sum += errorDeg(result, turn);
      largest = std::max(largest, errorDeg(result, turn));
      ++count;
    }
  }
  EXPECT_LT(sum / count, 0.05);
  EXPECT_LT(largest, 0.1);
}

struct Drive {
  double mean_deg = 0.0, literal_deg = 0.0, sum_deg = 0.0, least_confidence = 1.0, nees = 0.0;
};

/// Steps of 5 to 20 cm in an arc through the room, 720° in all.
Drive driveArcs(unsigned seed) {
  const test::TexturedRoom room(seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> length_m(0.05, 0.20);
  Compass compass, literal_compass(literal());
  Drive drive;
  Pose2 pose{0.6, 0.0, M_PI / 2.0};
  Signature before = signatureOf(room.panorama(pose, {}));
  double turned = 0.0, measured = 0.0;
  int count = 0;
  while (turned < 4.0 * M_PI) {
    // Circles of 0.6 m radius around the middle of the room. Each step is an arc, so the displacement has the
    // direction of the mean heading.
    const double chord = length_m(random), turn = 2.0 * std::asin(chord / 1.2);
    pose = pose * Pose2{chord * std::cos(0.5 * turn), chord * std::sin(0.5 * turn), turn};
    const Signature after = signatureOf(room.panorama(pose, {}));
    const CompassResult result = compass.compare(before, after);
    drive.mean_deg += errorDeg(result, turn);
    drive.literal_deg += errorDeg(literal_compass.compare(before, after), turn);
    drive.nees += std::pow(wrapAngle(result.turn_rad - turn) / result.sigma_rad, 2);
    drive.least_confidence = std::min(drive.least_confidence, result.confidence);
    turned += turn;
    measured += result.turn_rad;
    before = after;
    ++count;
  }
  drive.mean_deg /= count;
  drive.literal_deg /= count;
  drive.nees /= count;
  drive.sum_deg = std::abs(measured - turned) / kDegree;
  return drive;
}

TEST(Compass, SeparatesParallaxFromRotation) {
  double nees = 0.0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const Drive drive = driveArcs(seed);
    EXPECT_LT(drive.mean_deg, 0.25) << seed;  // the goal for steps of at most 20 cm
    EXPECT_LT(drive.sum_deg, 5.0) << seed;    // the goal over 720°
    EXPECT_GT(drive.least_confidence, 0.5) << seed;
    nees += drive.nees / 3.0;
    // Without the fit, walls 1.5 to 3 m away cost several times as much.
    EXPECT_GT(drive.literal_deg, 2.0 * drive.mean_deg) << seed;
  }
  // σ is calibrated on rendered rooms with furniture, where the errors are larger.
  EXPECT_LT(nees, 1.5);
  EXPECT_GT(nees, 0.02);
}

TEST(Compass, TakesDirectionOfTravel) {
  const test::TexturedRoom room(5);
  const Signature before = signatureOf(room.panorama({0.0, 0.0, 0.0}, {}));
  const Signature after = signatureOf(room.panorama({0.0, 0.15, 0.3}, {}));  // to the left
  Compass compass;
  EXPECT_LT(errorDeg(compass.compare(before, after, {M_PI / 2.0 - 0.15, 0.02, 0.15}), 0.3), 0.25);
}

TEST(Compass, SigmaCoversUnknownDirectionOfTravel) {
  // The robot drives 15 cm ahead and then turns on the spot, so the displacement is 0.5 rad off the mean
  // heading.
  double known = 0.0, unknown = 0.0;
  constexpr int kRooms = 8;
  for (unsigned seed = 1; seed <= kRooms; ++seed) {
    const test::TexturedRoom room(seed);
    const Signature before = signatureOf(room.panorama({0.3, -0.2, 0.4}, {}));
    const Pose2 after = Pose2{0.3, -0.2, 0.4} * Pose2{0.15, 0.0, 1.0};
    const Signature now = signatureOf(room.panorama(after, {}));
    Compass compass;
    const CompassResult right = compass.compare(before, now, {-0.5, 0.02, -1.0}),
                        wrong = compass.compare(before, now, {0.0, -1.0, -1.0});
    EXPECT_LT(errorDeg(right, 1.0), 0.5) << seed;
    EXPECT_GT(wrong.sigma_rad, right.sigma_rad);
    known += std::pow(wrapAngle(right.turn_rad - 1.0) / right.sigma_rad, 2) / kRooms;
    unknown += std::pow(wrapAngle(wrong.turn_rad - 1.0) / wrong.sigma_rad, 2) / kRooms;
  }
  // NEES of one dimension; the χ² bound of 8 samples at 99.9 % is 3.3.
  EXPECT_LT(known, 3.3);
  EXPECT_LT(unknown, 3.3);
}

TEST(Compass, IgnoresExposure) {
  const test::TexturedRoom room(6);
  const cv::Mat1b before = room.panorama({0.0, 0.0, 0.0}, {}), after = room.panorama({0.1, 0.0, 0.2}, {});
  cv::Mat1b darker;
  after.convertTo(darker, CV_8U, 0.5, 15.0);
  Compass compass;
  const CompassResult same = compass.compare(signatureOf(before), signatureOf(after));
  const CompassResult changed = compass.compare(signatureOf(before), signatureOf(darker));
  EXPECT_NEAR(changed.turn_rad, same.turn_rad, 0.05 * kDegree);  // rounding to half as many grey levels
  EXPECT_GT(changed.confidence, 0.8);
}

/// Worst error, and mean confidences, of steps of 10 cm and 0.1 rad with and without a fault in both
/// panoramas.
struct Fault {
  double worst_deg = 0.0, confidence = 0.0, clean_confidence = 0.0;
};

template <typename Spoil>
Fault withFault(const Spoil& spoil) {
  Fault fault;
  constexpr int kRooms = 6;
  for (unsigned seed = 1; seed <= kRooms; ++seed) {
    const test::TexturedRoom room(seed);
    cv::Mat1b before = room.panorama({0.0, 0.0, 0.0}, {}), after = room.panorama({0.1, 0.005, 0.1}, {});
    Compass compass;
    fault.clean_confidence += compass.compare(signatureOf(before), signatureOf(after)).confidence / kRooms;
    spoil(before, after);
    const CompassResult result = compass.compare(signatureOf(before), signatureOf(after));
    fault.worst_deg = std::max(fault.worst_deg, errorDeg(result, 0.1));
    fault.confidence += result.confidence / kRooms;
  }
  return fault;
}

TEST(Compass, ToleratesBlackSector) {
  const Fault fault = withFault([](cv::Mat1b& before, cv::Mat1b& after) {
    before.colRange(200, 285).setTo(2);  // 60°, fixed to the camera
    after.colRange(200, 285).setTo(2);
  });
  EXPECT_LT(fault.worst_deg, 1.0);
  EXPECT_GT(fault.confidence, 0.6);
}

TEST(Compass, ToleratesGreySector) {
  const Fault fault = withFault([](cv::Mat1b& before, cv::Mat1b& after) {
    before.colRange(200, 285).setTo(90);
    after.colRange(200, 285).setTo(90);
  });
  EXPECT_LT(fault.worst_deg, 1.5);
  EXPECT_LT(fault.confidence, fault.clean_confidence);
}

TEST(Compass, ToleratesRobotInView) {
  const Fault fault = withFault([](cv::Mat1b& before, cv::Mat1b& after) {
    // A dark body 20° wide that moves by 8° against the room.
    before(cv::Rect(60, 10, 28, 54)).setTo(25);
    after(cv::Rect(57, 10, 28, 54)).setTo(25);
  });
  EXPECT_LT(fault.worst_deg, 1.0);
  EXPECT_GT(fault.confidence, 0.5);
}

TEST(Compass, HasLowConfidenceBetweenDifferentRooms) {
  Compass compass;
  std::vector<double> confidences;
  for (unsigned seed = 10; seed < 40; ++seed) {
    const Signature a = signatureOf(test::TexturedRoom(seed).panorama({0.2, 0.1, 0.0}, {}));
    const Signature b = signatureOf(test::TexturedRoom(seed + 100).panorama({-0.1, 0.2, 0.0}, {}));
    confidences.push_back(compass.compare(a, b).confidence);
  }
  std::sort(confidences.begin(), confidences.end());
  // At most one in ten is confident by chance.
  EXPECT_LT(confidences[confidences.size() * 9 / 10], 0.5);
  EXPECT_LT(confidences[confidences.size() / 2], 0.1);
}

TEST(Compass, GivesNoAnswerWithoutContrast) {
  Compass compass;
  const Signature room = signatureOf(test::TexturedRoom(1).panorama({}, {})),
                  grey = signatureOf(cv::Mat1b(64, 512, std::uint8_t{90}));
  EXPECT_FALSE(compass.compare(grey, grey).valid);
  EXPECT_FALSE(compass.compare(room, grey).valid);
  cv::Mat1b noise(64, 512);
  cv::randn(noise, 120, 2);
  EXPECT_FALSE(compass.compare(room, signatureOf(noise)).valid);
}

TEST(Compass, RefusesOtherFormats) {
  PanoramaOptions lower;
  lower.least_elevation_deg = -20.0;
  const cv::Mat1b panorama = test::TexturedRoom(1).panorama({}, {});
  const Signature other = SignatureMaker(test::roomUnwrapper(lower), {}).compute(panorama);
  Compass compass;
  EXPECT_THROW(compass.compare(signatureOf(panorama), other), std::invalid_argument);
  CompassOptions many;
  many.k2 = 200;
  EXPECT_THROW(Compass(many).prepare(other), std::invalid_argument);
}

TEST(Compass, ReadsOptions) {
  const auto section =
      options::Section::parse("{method: literal, k2: 20, parallax: {harmonics: 3}}", "test.yaml");
  const CompassOptions options = CompassOptions::read(section);
  EXPECT_EQ(options.method, CompassMethod::kLiteral);
  EXPECT_EQ(options.k2, 20);
  EXPECT_EQ(options.parallax.harmonics, 3);
  EXPECT_THROW(CompassOptions::read(options::Section::parse("parallax: {harmonics: 9}", "test.yaml")),
               options::Error);
}

}  // namespace
}  // namespace omnifleet::appearance
