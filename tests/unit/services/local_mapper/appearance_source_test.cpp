// Turns, differences and the choice of places, on fisheye images of a room in closed form. Turns on the spot
// are known exactly; differences and signatures are compared with the sums that define them.

#include "local_mapper/appearance_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "tests/unit/services/local_mapper/room_images.h"

namespace omnifleet::local_mapper {
namespace {

using appearance::KeyframeRule;
using ::testing::ElementsAre;

constexpr TimeNs kViewPeriod_ns = 200'000'000;
constexpr double kTurnDegree = M_PI / 180.0;

double turnErrorDeg(const Appearance& found, double truth_rad) {
  return std::abs(wrapAngle(found.turn_rad - truth_rad)) / kTurnDegree;
}

AppearanceOptions placesBy(KeyframeRule rule) {
  AppearanceOptions options;
  options.places.rule = rule;
  return options;
}

/// A camera with its source, and the wheels between its frames. Frames come every kViewPeriod_ns.
class Views {
 public:
  explicit Views(unsigned room = 1, const AppearanceOptions& options = {})
      : room_(room), source_(lens::Camera(test::roomCamera()), options) {}

  /// Wheels measure the motion since the frame before.
  Appearance wheeledTo(const Pose2& pose) {
    Motion wheels;
    wheels.valid = now_ns_ > 0;
    wheels.since_ns = now_ns_;
    wheels.previous_from_current = pose_.inverse() * pose;
    return show(pose, wheels);
  }
  Appearance seenAt(const Pose2& pose) { return show(pose, {}); }
  Appearance show(const Pose2& pose, const Motion& wheels) {
    pose_ = pose;
    return show(test::roomImage(room_, pose), wheels);
  }
  Appearance show(const cv::Mat& image, const Motion& wheels = {}) {
    now_ns_ += kViewPeriod_ns;
    return source_.process(now_ns_, image, wheels);
  }
  Appearance invalidFrame() {
    now_ns_ += kViewPeriod_ns;
    return source_.skip();
  }

  TimeNs now() const { return now_ns_; }
  const test::TexturedRoom& room() const { return room_; }
  AppearanceSource& source() { return source_; }

 private:
  test::TexturedRoom room_;
  AppearanceSource source_;
  Pose2 pose_;
  TimeNs now_ns_ = 0;
};

bool isPlace(const Appearance& found) {
  return !found.signature.bytes.empty();
}

void expectComparedWithNone(const Appearance& found) {
  EXPECT_EQ(found.since_ns, 0);
  EXPECT_EQ(found.turn_rad, 0.0);
  EXPECT_EQ(found.turn_sigma_rad, 0.0);
  EXPECT_EQ(found.confidence, 0.0f);
  EXPECT_EQ(found.difference, 0.0f);
}

TEST(AppearanceSource, FirstFrameIsAPlaceWithoutTurn) {
  Views views;
  const Appearance first = views.wheeledTo({0.2, 0.3, 0.4});
  expectComparedWithNone(first);
  EXPECT_EQ(first.format.rows, 64);
  EXPECT_EQ(first.format.columns, 512);
  EXPECT_EQ(first.format.camera, "equidistant 480x480");
  EXPECT_NEAR(first.format.least_elevation_rad, -12.0 * kTurnDegree, 1e-6);
  EXPECT_NEAR(first.format.most_elevation_rad, 2.5 * kTurnDegree, 1e-6);
  EXPECT_EQ(first.signature.bytes.size(), 8u * (128 + 64));
  EXPECT_EQ(first.signature.scale.size(), 8u);
}

TEST(AppearanceSource, PanoramaShowsTheRoomByBearing) {
  Views views(3);
  const Pose2 pose{0.3, -0.4, 1.1};
  views.seenAt(pose);
  const cv::Mat1b truth = views.room().panorama(pose, {});
  // A pixel spans 0.4°, the panorama's columns 0.7°; patterns are 3° wide and more. The edge of the floor is
  // sharp.
  EXPECT_LT(cv::norm(views.source().panorama(), truth, cv::NORM_L1) / static_cast<double>(truth.total()),
            4.0);
}

void expectTransformOf(const cv::Mat1b& panorama, const StoredSignature& signature) {
  const test::DirectTransform truth = test::transformRows(panorama, 8, 128);
  ASSERT_EQ(signature.bytes.size(), 8u * (128 + 64));
  std::size_t at = 0;
  for (int row = 0; row < 8; ++row) {
    double largest = 0.0;
    cv::minMaxLoc(truth.modules.row(row), nullptr, &largest);
    EXPECT_NEAR(signature.scale[static_cast<std::size_t>(row)], largest, 1e-4 * largest);
    for (int k = 0; k < 128; ++k)  // rounded to whole units
      EXPECT_NEAR(signature.bytes[at++], 255.0 * truth.modules(row, k) / largest, 0.51) << row << " " << k;
    for (int k = 0; k < 64; ++k, ++at) {
      if (truth.modules(row, k) < 0.01 * largest) continue;  // single precision
      const double unit = 2.0 * M_PI / 256.0, off = signature.bytes[at] * unit - truth.phases(row, k);
      EXPECT_LT(std::abs(wrapAngle(off)), 0.55 * unit) << row << " " << k;
    }
  }
}

TEST(AppearanceSource, SignatureIsTheTransformOfThePanorama) {
  Views views(2, placesBy(KeyframeRule::kEveryImage));
  for (const Pose2& pose : {Pose2{-0.5, 0.1, 0.7}, Pose2{0.4, 0.3, -0.2}}) {
    const Appearance found = views.seenAt(pose);
    expectTransformOf(views.source().panorama(), found.signature);
  }
}

TEST(AppearanceSource, FindsTurnsOnTheSpot) {
  for (unsigned room = 1; room <= 3; ++room) {
    Views views(room);
    double heading = 0.1;
    views.wheeledTo({0.4, -0.2, heading});
    for (const double turn : {0.003, 0.05, 0.4, 1.234, -2.5}) {
      const TimeNs before_ns = views.now();
      heading += turn;
      const Appearance found = views.wheeledTo({0.4, -0.2, heading});
      EXPECT_EQ(found.since_ns, before_ns);
      // As the compass on panoramas in closed form; a pixel of the image is 0.25° wide at the horizon.
      EXPECT_LT(turnErrorDeg(found, turn), 0.15) << room << " " << turn;
      EXPECT_GT(found.turn_sigma_rad, 0.0);
      EXPECT_LT(found.turn_sigma_rad, 0.02 + 0.5 * std::abs(turn));
      EXPECT_GT(found.confidence, 0.9f);
      EXPECT_LT(found.difference, 0.1f) << "modules do not depend on the heading";
    }
  }
}

/// Whole images turned by right angles: no pixel is interpolated.
TEST(AppearanceSource, FindsRightAnglesOfTurnedImages) {
  Views views(4);
  const cv::Mat1b image = test::roomImage(views.room(), {0.2, 0.1, 0.0});
  views.show(image);
  cv::Mat1b turned;
  // Bearings grow counter-clockwise in the image, so a robot that turns left sees the room turn clockwise.
  cv::rotate(image, turned, cv::ROTATE_90_CLOCKWISE);
  EXPECT_LT(turnErrorDeg(views.show(turned), 0.5 * M_PI), 0.05);
  EXPECT_LT(turnErrorDeg(views.show(image), -0.5 * M_PI), 0.05);
  cv::rotate(image, turned, cv::ROTATE_180);
  EXPECT_LT(turnErrorDeg(views.show(turned), M_PI), 0.05);
}

TEST(AppearanceSource, DifferenceIsThatOfEquation2) {
  Views views(5);
  views.wheeledTo({0.0, 0.0, 0.0});
  cv::Mat1b before = views.source().panorama().clone();
  for (const double x : {0.02, 0.10, 0.35}) {
    const Appearance found = views.wheeledTo({x, 0.05, 0.2});
    const cv::Mat1b now = views.source().panorama().clone();
    EXPECT_NEAR(found.difference, test::directDifference(before, now), 1e-4) << "with the frame before";
    before = now;
  }
}

/// The second of two frames, with the motion of the wheels in between.
Appearance secondOf(const cv::Mat1b& first, const cv::Mat1b& second, Motion wheels, TimeNs since_off_ns = 0) {
  Views views;
  views.show(first);
  wheels.since_ns = views.now() + since_off_ns;
  return views.show(second, wheels);
}

TEST(AppearanceSource, TakesDirectionOfTravelFromTheWheels) {
  // The robot drives and then turns on the spot, so the displacement has not the direction of the mean
  // heading. The second step is sideways.
  for (const Pose2& step : {Pose2{0.15, 0.0, 1.0}, Pose2{0.0, 0.15, 0.3}}) {
    for (unsigned seed = 1; seed <= 4; ++seed) {
      const test::TexturedRoom room(seed);
      const Pose2 start{0.3, -0.2, 0.4};
      const cv::Mat1b before = test::roomImage(room, start), after = test::roomImage(room, start * step);
      Motion wheels;
      wheels.valid = true;
      wheels.previous_from_current = step;
      const Appearance right = secondOf(before, after, wheels), without = secondOf(before, after, {});
      EXPECT_LT(turnErrorDeg(right, step.theta_rad), 0.3) << seed;
      // Otherwise the direction is a share of the turn uncertain, 0.4 rad in the first case.
      EXPECT_LT(right.turn_sigma_rad, 0.25 * kTurnDegree) << seed;
      EXPECT_GT(turnErrorDeg(without, step.theta_rad), 0.6) << seed << ": the direction matters here";
      // A motion over another interval says nothing about these two frames.
      const Appearance ignored = secondOf(before, after, wheels, -1);
      EXPECT_EQ(ignored.turn_rad, without.turn_rad);
      EXPECT_EQ(ignored.turn_sigma_rad, without.turn_sigma_rad);
    }
  }
}

/// Numbers of the frames that are places, of `frames` alike. The wheels measure `step_m` between them.
std::vector<int> placesOfOneView(const AppearanceOptions& options, int frames, double step_m) {
  static const cv::Mat1b kImage = test::roomImage(test::TexturedRoom(1), {0.0, 0.1, 0.0});
  Views views(1, options);
  std::vector<int> places;
  for (int i = 0; i < frames; ++i) {
    Motion wheels;
    wheels.valid = i > 0;
    wheels.since_ns = views.now();
    wheels.previous_from_current = {step_m, 0.0, 0.0};
    if (isPlace(views.show(kImage, wheels))) places.push_back(i);
  }
  return places;
}

TEST(AppearanceSource, SelectsPlacesByNumber) {
  EXPECT_THAT(placesOfOneView(placesBy(KeyframeRule::kEveryImage), 4, 0.0), ElementsAre(0, 1, 2, 3));
  AppearanceOptions options = placesBy(KeyframeRule::kEveryNth);
  options.places.every = 3;
  EXPECT_THAT(placesOfOneView(options, 8, 0.0), ElementsAre(0, 3, 6));
}

TEST(AppearanceSource, SelectsPlacesByDistanceOfTheWheels) {
  const AppearanceOptions options;  // every 0.1 m
  EXPECT_THAT(placesOfOneView(options, 12, 0.03), ElementsAre(0, 4, 8));
  EXPECT_THAT(placesOfOneView(options, 12, -0.03), ElementsAre(0, 4, 8)) << "backwards";
  EXPECT_THAT(placesOfOneView(options, 12, 0.0), ElementsAre(0));
}

constexpr int kDriven = 9;
Pose2 drivenTo(int frame) {
  return {0.03 * frame, 0.1, 0.0};
}

/// Places of a straight line by the difference to the place before, from the panoramas.
std::vector<int> placesByDifference(double limit) {
  Views views(6, placesBy(KeyframeRule::kEveryImage));
  std::vector<int> places;
  cv::Mat1b last;
  for (int i = 0; i < kDriven; ++i) {
    views.seenAt(drivenTo(i));
    const double difference = last.empty() ? 2.0 : test::directDifference(last, views.source().panorama());
    EXPECT_GT(std::abs(difference - limit), 1e-3) << "the test needs a clear decision";
    if (difference < limit) continue;
    places.push_back(i);
    last = views.source().panorama().clone();
  }
  return places;
}

TEST(AppearanceSource, SelectsPlacesByDifferenceToTheLastPlace) {
  constexpr double kLimit = 0.3;
  const std::vector<int> truth = placesByDifference(kLimit);
  ASSERT_GT(truth.size(), 2u);
  ASSERT_GT(truth[1], 1) << "single steps must stay below the limit";
  AppearanceOptions by_difference = placesBy(KeyframeRule::kDifference), by_distance;
  by_difference.places.difference = by_distance.places.difference = kLimit;
  Views with_wheels(6, by_difference), without(6, by_difference), no_distance(6, by_distance);
  std::vector<int> found[3];
  for (int i = 0; i < kDriven; ++i) {
    if (isPlace(with_wheels.wheeledTo(drivenTo(i)))) found[0].push_back(i);
    if (isPlace(without.seenAt(drivenTo(i)))) found[1].push_back(i);
    if (isPlace(no_distance.seenAt(drivenTo(i)))) found[2].push_back(i);
  }
  EXPECT_EQ(found[0], truth);
  EXPECT_EQ(found[1], truth);
  EXPECT_EQ(found[2], truth) << "without wheels there is no distance";
}

/// Paints a sector of 60°, fixed to the camera, black.
cv::Mat1b occluded(cv::Mat1b image) {
  const double centre = 0.5 * (image.cols - 1);
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      const double bearing = std::atan2(centre - column, centre - row);
      if (bearing > 0.5 && bearing < 0.5 + M_PI / 3.0) image(row, column) = 2;
    }
  }
  return image;
}

TEST(AppearanceSource, FindsTurnWithOccludedSector) {
  for (unsigned room = 1; room <= 4; ++room) {
    Views views(room);
    views.show(occluded(test::roomImage(views.room(), {0.0, 0.0, 0.0})));
    const Appearance found = views.show(occluded(test::roomImage(views.room(), {0.0, 0.0, 0.5})));
    // Taken for part of the room, the sector that turns with the camera would pull the turn towards 0.
    EXPECT_LT(turnErrorDeg(found, 0.5), 0.5) << room;
    EXPECT_GT(found.confidence, 0.5f);
  }
}

TEST(AppearanceSource, BlackImageGivesNoTurn) {
  Views views;
  views.seenAt({0.0, 0.0, 0.0});
  const cv::Mat1b black(480, 480, std::uint8_t{3});
  const Appearance first = views.show(black), second = views.show(black),
                   bright = views.seenAt({0.0, 0.0, 0.2});
  for (const Appearance* found : {&first, &second, &bright}) {
    EXPECT_GT(found->since_ns, 0);
    EXPECT_LE(found->turn_sigma_rad, 0.0);
    EXPECT_EQ(found->confidence, 0.0f);
  }
  // The modules of a black image are 0: the distance is the norm of the other one, twice the mean.
  EXPECT_NEAR(first.difference, 2.0, 1e-6);
  EXPECT_EQ(second.difference, 0.0f);
  EXPECT_NEAR(bright.difference, 2.0, 1e-6);
  EXPECT_LT(turnErrorDeg(views.seenAt({0.0, 0.0, 0.5}), 0.3), 0.15);
}

TEST(AppearanceSource, GivesNoTurnOfLowConfidence) {
  AppearanceOptions options;
  options.compass.least_confidence = 1.0;
  Views views(1, options);
  views.seenAt({0.0, 0.0, 0.0});
  const Appearance found = views.seenAt({0.0, 0.0, 0.3});
  EXPECT_GT(found.confidence, 0.9f);
  EXPECT_LE(found.turn_sigma_rad, 0.0);
}

TEST(AppearanceSource, ComparesWithNoneAfterInvalidFrame) {
  Views views;
  const Appearance first = views.seenAt({0.0, 0.2, -0.3});
  EXPECT_GT(views.seenAt({0.0, 0.0, 0.0}).difference, 0.0f);
  const Appearance invalid = views.invalidFrame();
  expectComparedWithNone(invalid);
  EXPECT_FALSE(isPlace(invalid));
  EXPECT_TRUE(invalid.format == first.format);
  const Appearance again = views.seenAt({0.0, 0.0, 0.3});
  expectComparedWithNone(again);
  EXPECT_TRUE(isPlace(again)) << "the robot has moved 0.2 m since the place, without wheels";
  EXPECT_LT(turnErrorDeg(views.seenAt({0.0, 0.0, 0.5}), 0.2), 0.15);
}

TEST(AppearanceSource, KeepsDistanceOverInvalidFrame) {
  Views views;
  std::vector<int> places;
  for (int i = 0; i < 6; ++i) {
    if (i == 2) {
      views.invalidFrame();
      continue;
    }
    if (isPlace(views.wheeledTo({0.03 * i, 0.0, 0.0}))) places.push_back(i);
  }
  // The wheels measure 0.03 m to frame 1, then 0.06 m from there to frame 3 and 0.03 m to frame 4.
  EXPECT_THAT(places, ElementsAre(0, 4));
}

TEST(AppearanceSource, RefersToTheFrameBeforeALostOne) {
  Views views;
  views.seenAt({0.0, 0.0, 0.1});
  const TimeNs before_ns = views.now();
  const Motion none;
  const Appearance found = views.source().process(before_ns + 5 * kViewPeriod_ns,
                                                  test::roomImage(views.room(), {0.0, 0.0, 0.9}), none);
  EXPECT_EQ(found.since_ns, before_ns);
  EXPECT_LT(turnErrorDeg(found, 0.8), 0.15);
}

TEST(AppearanceSource, RefusesImageOfAnotherSize) {
  Views views;
  views.seenAt({0.0, 0.0, 0.0});
  EXPECT_THROW(views.show(cv::Mat1b(480, 640, std::uint8_t{100})), std::invalid_argument);
  EXPECT_THROW(views.show(cv::Mat()), std::invalid_argument);
  expectComparedWithNone(views.seenAt({0.0, 0.0, 0.3}));
  EXPECT_LT(turnErrorDeg(views.seenAt({0.0, 0.0, 0.5}), 0.2), 0.15);
}

TEST(AppearanceSource, RefusesBandOutsideOfTheImage) {
  lens::CameraModel model = test::roomCamera();
  model.self_mask_radius_px = 2000.0;
  EXPECT_THROW(AppearanceSource(lens::Camera(model), AppearanceOptions()), options::Error);
}

TEST(AppearanceSource, TakesColourImages) {
  Views grey, colour;
  for (const double heading : {0.0, 0.4}) {
    const cv::Mat1b image = test::roomImage(grey.room(), {0.1, 0.2, heading});
    cv::Mat3b of_grey;
    cv::cvtColor(image, of_grey, cv::COLOR_GRAY2BGR);
    const Appearance a = grey.show(image), b = colour.show(of_grey);
    EXPECT_NEAR(a.turn_rad, b.turn_rad, 0.02 * kTurnDegree);  // rounding of the grey levels
    EXPECT_EQ(isPlace(a), isPlace(b));
  }
}

TEST(AppearanceSource, RepeatsEveryBit) {
  const auto run = [] {
    Views views(7);
    std::vector<Appearance> found;
    for (int i = 0; i < 8; ++i) {
      const Pose2 pose{0.04 * i, 0.01 * i, 0.1 * i};
      found.push_back(i == 4 ? views.invalidFrame() : i < 6 ? views.wheeledTo(pose) : views.seenAt(pose));
    }
    return found;
  };
  const std::vector<Appearance> first = run(), second = run();
  for (std::size_t i = 0; i < first.size(); ++i) {
    const Appearance &a = first[i], &b = second[i];
    EXPECT_EQ(a.since_ns, b.since_ns);
    EXPECT_EQ(a.turn_rad, b.turn_rad);
    EXPECT_EQ(a.turn_sigma_rad, b.turn_sigma_rad);
    EXPECT_EQ(a.confidence, b.confidence);
    EXPECT_EQ(a.difference, b.difference);
    EXPECT_EQ(a.signature.bytes, b.signature.bytes);
    EXPECT_EQ(a.signature.scale, b.signature.scale);
  }
}

TEST(AppearanceSource, ReadsOptions) {
  const auto read = [](const std::string& text) {
    return AppearanceOptions::read(options::Section::parse(text, "test.yaml"));
  };
  EXPECT_TRUE(read("{}").use);
  EXPECT_EQ(read("{}").places.rule, KeyframeRule::kDistance);
  const AppearanceOptions options =
      read("{use: false, places: {rule: every_nth, every: 5}, panorama: {rows: 32}, compass: {k2: 20}}");
  EXPECT_FALSE(options.use);
  EXPECT_EQ(options.places.rule, KeyframeRule::kEveryNth);
  EXPECT_EQ(options.places.every, 5);
  EXPECT_EQ(options.panorama.rows, 32);
  EXPECT_EQ(options.compass.k2, 20);
  EXPECT_THROW(read("places: {rule: sometimes}"), options::Error);
  EXPECT_THROW(read("pace: {rule: distance}"), options::Error);
}

}  // namespace
}  // namespace omnifleet::local_mapper
