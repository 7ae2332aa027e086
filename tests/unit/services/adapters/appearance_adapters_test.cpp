// Appearance, places and alignments survive the conversion to IDL types and back. Malformed ones are
// rejected.

#include <gtest/gtest.h>

#include "adapters/adapters.h"
#include "tests/unit/services/adapters/samples.h"

namespace omnifleet::adapters {
namespace {

using test::Counter;
using test::someFrame;

SignatureFormat someFormat() {
  return {64, 512, 2, 3, 1, -0.25f, 0.5f, "equidistant 1280x960"};
}
StoredSignature someSignature() {
  return {{1, 2, 3, 4, 255, 254, 253, 252}, {0.5f, 2.0f}};
}

TEST(Adapters, PreservesAppearance) {
  Counter n;
  auto from = someFrame<Objects>(n);
  from.state = FrameState::kOk;
  Appearance& seen = from.appearance;
  seen.since_ns = 5, seen.turn_rad = 0.25, seen.turn_sigma_rad = 0.125;
  seen.confidence = 0.5f, seen.difference = 0.75f;
  seen.format = someFormat();
  seen.signature = someSignature();
  v1::Objects wire;
  toWire(from, RunClock::kDataset, wire);
  Objects back;
  ASSERT_TRUE(fromWire(wire, back));
  EXPECT_EQ(back.appearance.since_ns, 5);
  EXPECT_EQ(back.appearance.turn_rad, 0.25);
  EXPECT_EQ(back.appearance.turn_sigma_rad, 0.125);
  EXPECT_EQ(back.appearance.confidence, 0.5f);
  EXPECT_EQ(back.appearance.difference, 0.75f);
  EXPECT_TRUE(back.appearance.format == seen.format);
  EXPECT_EQ(back.appearance.signature.bytes, seen.signature.bytes);
  EXPECT_EQ(back.appearance.signature.scale, seen.signature.scale);
}

TEST(Adapters, RefusesSignatureThatDoesNotFitItsFormat) {
  Counter n;
  auto from = someFrame<Objects>(n);
  from.state = FrameState::kOk;
  from.appearance.format = someFormat();
  from.appearance.signature = someSignature();
  v1::Objects wire;
  toWire(from, RunClock::kDataset, wire);
  Objects back;
  ASSERT_TRUE(fromWire(wire, back));
  wire.appearance().signature().pop_back();
  EXPECT_FALSE(fromWire(wire, back));
  EXPECT_EQ(back.acquired_ns, from.acquired_ns);  // the frame keeps its place in the stream
}

TEST(Adapters, PreservesPlace) {
  Counter n;
  Place from;
  from.robot = "r1", from.index = 4, from.acquired_ns = 9, from.sequence = 8, from.frame = "r1";
  from.frame_from_base = n.pose();
  from.covariance = n.matrix<3>();
  from.metric = false;
  from.format = someFormat();
  from.signature = someSignature();
  from.links = {{false, "r1", 3, n.pose(), n.matrix<3>()}, {true, "r2", 17, n.pose(), n.matrix<3>()}};
  v1::Place wire;
  toWire(from, RunClock::kDataset, wire);
  Place back;
  ASSERT_TRUE(fromWire(wire, back));
  EXPECT_EQ(back.index, 4u);
  EXPECT_EQ(back.frame, "r1");
  EXPECT_EQ(back.frame_from_base.vector(), from.frame_from_base.vector());
  EXPECT_EQ(back.covariance, from.covariance);
  EXPECT_FALSE(back.metric);
  EXPECT_EQ(back.signature.bytes, from.signature.bytes);
  ASSERT_EQ(back.links.size(), 2u);
  EXPECT_TRUE(back.links[1].closes_loop);
  EXPECT_EQ(back.links[1].robot, "r2");
  EXPECT_EQ(back.links[1].index, 17u);
  EXPECT_EQ(back.links[1].this_from_other.vector(), from.links[1].this_from_other.vector());
  EXPECT_EQ(back.links[1].covariance, from.links[1].covariance);
}

TEST(Adapters, PreservesAlignment) {
  Counter n;
  Alignment from;
  from.robot = "r2", from.acquired_ns = 11;
  from.status = AlignmentStatus::kRefused;
  from.frame = "r2", from.reason = "walls agree, furniture does not", from.score = 0.5;
  from.map_from_frame = n.pose();
  from.covariance = n.matrix<3>();
  v1::Alignment wire;
  toWire(from, RunClock::kDataset, wire);
  Alignment back;
  ASSERT_TRUE(fromWire(wire, back));
  EXPECT_EQ(back.robot, "r2");
  EXPECT_EQ(back.status, AlignmentStatus::kRefused);
  EXPECT_EQ(back.frame, "r2");
  EXPECT_EQ(back.reason, from.reason);
  EXPECT_EQ(back.score, 0.5);
  EXPECT_EQ(back.map_from_frame.vector(), from.map_from_frame.vector());
  EXPECT_EQ(back.covariance, from.covariance);
}

}  // namespace
}  // namespace omnifleet::adapters
