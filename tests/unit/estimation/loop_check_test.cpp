// Whether two places close a loop, by exact scans and by signatures of a textured room.
#include "estimation/loop_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <utility>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"
#include "estimation/compass_evidence.h"
#include "tests/unit/appearance/textured_room.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

using scan::testing::Scene;

constexpr double kInverseRangeSigma = 0.003;  // 1/m, as of a camera

/// The walls of furnishedRoom() with other furniture.
Scene otherFurniture() {
  Scene room = scan::testing::furnishedRoom();
  room.outlines.resize(1);
  room.outlines.push_back({{-2.5, -2.0}, {-1.6, -2.0}, {-1.6, -0.9}, {-2.5, -0.9}});
  room.outlines.push_back({{0.7, -2.0}, {1.9, -2.0}, {1.9, -1.4}, {0.7, -1.4}});
  room.outlines.push_back({{-0.9, 0.9}, {-0.4, 0.9}, {-0.4, 1.4}, {-0.9, 1.4}});
  return room;
}

Scene bareRoom() {
  Scene room = scan::testing::furnishedRoom();
  room.outlines.resize(1);
  return room;
}

/// Scan and signature at a pose.
struct PlaceSeen {
  scan::LineScan scan;
  SignatureFormat format;
  StoredSignature signature;

  PlaceSeen(const Scene& scene, const Pose2& pose, std::uint32_t seed) {
    std::mt19937 random(seed);
    scan.fit(scene.scan(pose, kInverseRangeSigma, random));
  }
  /// @param texture of the walls
  PlaceSeen& with(unsigned texture, const Pose2& pose) {
    const appearance::PanoramaOptions options;
    appearance::SignatureMaker maker(test::roomUnwrapper(options), {});
    const appearance::Signature seen = maker.compute(test::TexturedRoom(texture).panorama(pose, options));
    format = maker.format();
    signature = appearance::store(seen);
    return *this;
  }
  LoopPlace place() const {
    LoopPlace place;
    place.scan = &scan;
    place.format = &format;
    place.signature = signature.bytes.empty() ? nullptr : &signature;
    return place;
  }
};

// 0.54 m and 115° apart.
const Pose2 kHere{-0.4, 0.1, 0.3}, kThere{0.1, -0.1, 2.3};

TEST(LoopCheck, ClosesOnOnePlaceSeenAtTwoHeadings) {
  const PlaceSeen from = PlaceSeen(scan::testing::furnishedRoom(), kHere, 1).with(5, kHere),
                  to = PlaceSeen(scan::testing::furnishedRoom(), kThere, 2).with(5, kThere);
  const LoopCheck::Result result = LoopCheck().check(from.place(), to.place());
  EXPECT_TRUE(result.closed) << result.reason;
  const Eigen::Vector3d off = (result.from_to.inverse() * (kHere.inverse() * kThere)).vector();
  // Scans without systematic errors: within 4 σ of each coordinate, and the σ are those of a scan match.
  for (int i = 0; i < 3; ++i) EXPECT_LT(std::abs(off(i)), 4.0 * std::sqrt(result.covariance(i, i)));
  EXPECT_LT(std::sqrt(result.covariance(0, 0)), 0.02);
  EXPECT_GT(result.score, 0.98);
  EXPECT_GT(result.compass.evidence, 0.0);
  ASSERT_TRUE(result.difference.has_value());
}

TEST(LoopCheck, StaysOpenInARoomWithEqualWallsAndOtherFurniture) {
  const PlaceSeen from(scan::testing::furnishedRoom(), kHere, 1), to(otherFurniture(), kThere, 2);
  EXPECT_FALSE(LoopCheck().check(from.place(), to.place()).closed);
  // Even if both rooms have the same wallpaper, so that the compass agrees with the walls.
  PlaceSeen papered_from = from, papered_to = to;
  papered_from.with(5, kHere);
  papered_to.with(5, kThere);
  const LoopCheck::Result result = LoopCheck().check(papered_from.place(), papered_to.place());
  EXPECT_FALSE(result.closed);
  EXPECT_NE(result.reason.find("contradict"), std::string::npos) << result.reason;
  LoopCheckOptions walls;
  walls.most_contradict = 1.0;
  walls.surfaces.missed_share = walls.surfaces.other_share;
  walls.least_evidence = walls.rival_evidence = 0.0;
  EXPECT_TRUE(LoopCheck(walls).check(papered_from.place(), papered_to.place()).closed)
      << "it is the surfaces that contradict which keep the loop open";
}

// A relation that something else has found: the walls of both rooms match there.
TEST(LoopCheck, ContradictsAGivenRelationInAnotherRoomOrAtAnotherHeading) {
  const Pose2 relation = kHere.inverse() * kThere;
  const PlaceSeen from(scan::testing::furnishedRoom(), kHere, 1),
      to(scan::testing::furnishedRoom(), kThere, 2), other(otherFurniture(), kThere, 2);
  EXPECT_FALSE(LoopCheck().contradicts(from.place(), to.place(), relation, 0.01));
  EXPECT_TRUE(LoopCheck().contradicts(from.place(), other.place(), relation, 0.01));
  // In a symmetric room only the compass distinguishes the heading turned by π.
  const Pose2 near = kHere * Pose2{0.08, 0.06, 0.5}, right = kHere.inverse() * near,
              turned = kHere.inverse() * (Pose2{0.0, 0.0, M_PI} * near);
  PlaceSeen bare_from(bareRoom(), kHere, 1), bare_to(bareRoom(), near, 2);
  EXPECT_FALSE(LoopCheck().contradicts(bare_from.place(), bare_to.place(), turned, 0.01));
  bare_from.with(5, kHere), bare_to.with(5, near);
  EXPECT_FALSE(LoopCheck().contradicts(bare_from.place(), bare_to.place(), right, 0.01));
  EXPECT_TRUE(LoopCheck().contradicts(bare_from.place(), bare_to.place(), turned, 0.01));
  // Another wallpaper: the compass is not sure, so it contradicts nothing. Nor do signatures of other
  // formats.
  PlaceSeen papered(bareRoom(), near, 2), lens = bare_to;
  papered.with(6, near);
  EXPECT_FALSE(LoopCheck().contradicts(bare_from.place(), papered.place(), turned, 0.01));
  lens.format.camera = "another lens";
  EXPECT_FALSE(LoopCheck().contradicts(bare_from.place(), lens.place(), turned, 0.01));
}

// From one corner both rooms look alike. Scans of the robot on its way show that the furniture differs.
TEST(LoopCheck, ScansAroundDistinguishRoomsThatLookAlikeFromOnePlace) {
  const PlaceSeen from(scan::testing::furnishedRoom(), kHere, 1);
  PlaceSeen same(scan::testing::furnishedRoom(), kThere, 2);
  const Pose2 before = kThere * Pose2{-0.9, 0.3, 0.4}, later = kThere * Pose2{-0.5, -0.4, 0.4};
  const PlaceSeen other_before(otherFurniture(), before, 3), other_later(otherFurniture(), later, 4),
      same_before(scan::testing::furnishedRoom(), before, 3),
      same_later(scan::testing::furnishedRoom(), later, 4);
  LoopPlace alone = same.place(), in_other = same.place(), in_same = same.place();
  in_other.around = {{&other_before.scan, kThere.inverse() * before},
                     {&other_later.scan, kThere.inverse() * later}};
  in_same.around = {{&same_before.scan, kThere.inverse() * before},
                    {&same_later.scan, kThere.inverse() * later}};
  EXPECT_TRUE(LoopCheck().check(from.place(), alone).closed);
  EXPECT_TRUE(LoopCheck().check(from.place(), in_same).closed);
  const LoopCheck::Result result = LoopCheck().check(from.place(), in_other);
  EXPECT_FALSE(result.closed);
  EXPECT_NE(result.reason.find("contradict"), std::string::npos) << result.reason;
}

TEST(LoopCheck, StaysOpenInASymmetricRoomWithoutCompass) {
  const PlaceSeen from(bareRoom(), kHere, 1), to(bareRoom(), kThere, 2);
  EXPECT_FALSE(LoopCheck().check(from.place(), to.place()).closed);
  // Even if four bare walls were enough, they fit in two ways.
  LoopCheckOptions options;
  options.least_evidence = 1.0;
  const LoopCheck::Result result = LoopCheck(options).check(from.place(), to.place());
  EXPECT_FALSE(result.closed);
  EXPECT_EQ(result.reason, "another relation fits as well");
}

TEST(LoopCheck, ClosesInASymmetricRoomWhereTheCompassDistinguishesTheHeadings) {
  const PlaceSeen from = PlaceSeen(bareRoom(), kHere, 1).with(5, kHere),
                  to = PlaceSeen(bareRoom(), kThere, 2).with(5, kThere);
  const LoopCheck::Result result = LoopCheck().check(from.place(), to.place());
  EXPECT_TRUE(result.closed) << result.reason;
  EXPECT_NEAR(result.from_to.theta_rad, 2.0, 0.02);  // not 2 − π
}

TEST(LoopCheck, StaysOpenWhereTheCompassContradicts) {
  // 10 cm apart, where the compass is sure.
  const Pose2 near = kHere * Pose2{0.08, 0.06, 0.5}, turned = near * Pose2{0.0, 0.0, 1.2};
  const PlaceSeen from = PlaceSeen(scan::testing::furnishedRoom(), kHere, 1).with(5, kHere),
                  to = PlaceSeen(scan::testing::furnishedRoom(), near, 2).with(5, turned),
                  agreeing = PlaceSeen(scan::testing::furnishedRoom(), near, 2).with(5, near);
  EXPECT_TRUE(LoopCheck().check(from.place(), agreeing.place()).closed);
  const LoopCheck::Result narrow = LoopCheck().check(from.place(), to.place());
  EXPECT_FALSE(narrow.closed);
  EXPECT_NE(narrow.reason.find("compass"), std::string::npos) << narrow.reason;
  LoopCheckOptions everywhere;
  everywhere.narrow_confidence = 1.0;
  const LoopCheck::Result result = LoopCheck(everywhere).check(from.place(), to.place());
  EXPECT_FALSE(result.closed);
  EXPECT_NE(result.reason.find("the compass contradicts"), std::string::npos) << result.reason;
}

TEST(LoopCheck, ClosesWhereTheCompassGivesNoAnswer) {
  // Other wallpaper, as after the light has changed entirely.
  const PlaceSeen from = PlaceSeen(scan::testing::furnishedRoom(), kHere, 1).with(5, kHere),
                  to = PlaceSeen(scan::testing::furnishedRoom(), kThere, 2).with(6, kThere);
  const LoopCheck::Result result = LoopCheck().check(from.place(), to.place());
  EXPECT_LT(result.compass.confidence, 0.5);
  EXPECT_TRUE(result.closed) << result.reason;
}

TEST(LoopCheck, NamesTheFieldWhereFormatsDiffer) {
  const PlaceSeen from = PlaceSeen(scan::testing::furnishedRoom(), kHere, 1).with(5, kHere);
  PlaceSeen to = PlaceSeen(scan::testing::furnishedRoom(), kThere, 2).with(5, kThere);
  to.format.camera = "another lens 640x480";
  const LoopCheck::Result result = LoopCheck().check(from.place(), to.place());
  EXPECT_NE(result.reason.find("another lens 640x480"), std::string::npos) << result.reason;
  EXPECT_FALSE(result.difference.has_value());
  EXPECT_DOUBLE_EQ(result.compass.evidence, 0.0);
}

TEST(LoopCheck, IsTheSameInBothDirections) {
  const PlaceSeen from = PlaceSeen(scan::testing::furnishedRoom(), kHere, 1).with(5, kHere),
                  to = PlaceSeen(scan::testing::furnishedRoom(), kThere, 2).with(5, kThere);
  LoopCheck check;
  const Pose2 there = check.check(from.place(), to.place()).from_to,
              back = check.check(to.place(), from.place()).from_to, both = there * back;
  // Each direction fits the lines of the other scan: some σ of a match, 2 mm and 1 mrad.
  EXPECT_LT(both.translation().norm(), 0.01);
  EXPECT_LT(std::abs(both.theta_rad), 0.005);
}

TEST(CompassEvidence, IsBoundedByTheConfidence) {
  appearance::CompassResult answer;
  answer.valid = true;
  answer.turn_rad = 1.0;
  answer.sigma_rad = 0.01;
  answer.confidence = 0.3;
  // Against: ln(1 − 0.3) and no more. For: about ln(0.3 · √(2π)/0.01).
  EXPECT_NEAR(compassEvidence(answer, -2.0, 0.0, 0.98), std::log(0.7), 1e-9);
  EXPECT_NEAR(compassEvidence(answer, 1.0, 0.0, 0.98), std::log(0.7 + 0.3 * std::sqrt(2.0 * M_PI) / 0.01),
              1e-9);
  answer.confidence = 1.0;
  EXPECT_NEAR(compassEvidence(answer, -2.0, 0.0, 0.98), std::log(0.02), 1e-9);
  answer.valid = false;
  EXPECT_DOUBLE_EQ(compassEvidence(answer, -2.0, 0.0, 0.98), 0.0);
}

}  // namespace
}  // namespace omnifleet::estimation
