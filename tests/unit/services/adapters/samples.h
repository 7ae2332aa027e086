#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <limits>

#include "observation/observation.h"

namespace omnifleet::test {

// Samples in which every field has its own value, and their comparison.

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
inline constexpr float kNanF = std::numeric_limits<float>::quiet_NaN();

/// Returns a new value at every call, exactly representable as float.
struct Counter {
  double next() { return value_ += 0.25; }
  float nextF() { return static_cast<float>(next()); }
  Eigen::Vector2d point() { return {next(), next()}; }
  Eigen::Vector2f pointF() { return {nextF(), nextF()}; }
  Pose2 pose() { return {next(), next(), 0.001 * next()}; }
  template <int N>
  Eigen::Matrix<double, N, N> matrix() {
    Eigen::Matrix<double, N, N> m;
    for (int r = 0; r < N; ++r) {
      for (int c = 0; c < N; ++c) m(r, c) = next();
    }
    return m;
  }

 private:
  double value_ = 1.0;
};

inline Motion someMotion(Counter& n) {
  Motion m;
  m.valid = true;
  m.since_ns = 123456789012345;
  m.previous_from_current = n.pose();
  m.covariance = n.matrix<3>();
  m.left_m = n.next();
  m.right_m = n.next();
  m.wheels_rejected = true;
  return m;
}

inline FloorMotion someFloorMotion(Counter& n) {
  FloorMotion m;
  m.valid = true;
  m.since_ns = 123456789012346;
  m.previous_from_current = n.pose();
  m.covariance = n.matrix<3>();
  return m;
}

inline Scan someScan(Counter& n) {
  Scan s;
  s.origin_m = n.point();
  s.blind_m = n.next();
  for (int i = 0; i < 5; ++i) {
    s.range_m.push_back(n.nextF());
    s.sigma_m.push_back(n.nextF());
    s.label.push_back(static_cast<RayLabel>(i));
    s.object.push_back(static_cast<std::uint16_t>(100 + i));
  }
  return s;
}

inline ScenePoint somePoint(Counter& n) {
  return {{n.nextF(), n.nextF(), n.nextF()}, n.nextF()};
}

inline SupportFunction someSupports(Counter& n) {
  SupportFunction s;
  for (int i = 0; i < 8; ++i) {
    s.b_m.push_back(n.nextF());
    s.sigma_m.push_back(n.nextF());
  }
  return s;
}

inline ObjectObservation someObservation(Counter& n) {
  ObjectObservation o;
  o.label = 7;
  o.rect_x_px = 11, o.rect_y_px = 12, o.rect_width_px = 13, o.rect_height_px = 14;
  o.hull_m = {n.point(), n.point(), n.point()};
  o.centroid_m = n.point();
  o.contact_m = n.point();
  o.supports = someSupports(n);
  o.solidity = n.next();
  o.truncated = true;
  o.height_m = n.next();
  o.height_sigma_m = n.next();
  o.vectors.push_back({n.pointF(), n.pointF(), n.pointF(), n.pointF(), n.pointF(), somePoint(n)});
  return o;
}

inline Track someTrack(Counter& n) {
  Track t;
  t.id = 4000000000u;
  t.kind = ObjectKind::kRobot;
  t.kind_probability = 0.75;
  t.visible = true;
  t.position_m = n.point();
  t.velocity_mps = n.point();
  t.covariance = n.matrix<2>();
  t.contact_m = n.point();
  t.hull_m = {n.point(), n.point(), n.point(), n.point()};
  t.supports = someSupports(n);
  t.solidity = n.next();
  t.truncated = true;
  t.height_m = n.next();
  t.height_sigma_m = n.next();
  t.points = {somePoint(n), somePoint(n)};
  return t;
}

template <class Frame>
Frame someFrame(Counter& n) {
  Frame f;
  f.robot = "r1";
  f.acquired_ns = 987654321098765;
  f.sequence = 42;
  f.state = FrameState::kDark;
  f.camera_height_m = n.next();
  f.motion = someMotion(n);
  f.floor_motion = someFloorMotion(n);
  f.scan = someScan(n);
  return f;
}

inline void expectEqual(const Motion& a, const Motion& b) {
  EXPECT_EQ(a.valid, b.valid);
  EXPECT_EQ(a.since_ns, b.since_ns);
  EXPECT_EQ(a.previous_from_current.vector(), b.previous_from_current.vector());
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.left_m, b.left_m);
  EXPECT_EQ(a.right_m, b.right_m);
  EXPECT_EQ(a.wheels_rejected, b.wheels_rejected);
}

inline void expectEqual(const FloorMotion& a, const FloorMotion& b) {
  EXPECT_EQ(a.valid, b.valid);
  EXPECT_EQ(a.since_ns, b.since_ns);
  EXPECT_EQ(a.previous_from_current.vector(), b.previous_from_current.vector());
  EXPECT_EQ(a.covariance, b.covariance);
}

inline void expectEqual(const Scan& a, const Scan& b) {
  EXPECT_EQ(a.origin_m, b.origin_m);
  EXPECT_EQ(a.blind_m, b.blind_m);
  EXPECT_EQ(a.range_m, b.range_m);
  EXPECT_EQ(a.sigma_m, b.sigma_m);
  EXPECT_EQ(a.label, b.label);
  EXPECT_EQ(a.object, b.object);
}

inline void expectEqual(const ScenePoint& a, const ScenePoint& b) {
  EXPECT_EQ(a.point_m, b.point_m);
  EXPECT_EQ(a.sigma_m, b.sigma_m);
}

inline void expectEqual(const SupportFunction& a, const SupportFunction& b) {
  EXPECT_EQ(a.b_m, b.b_m);
  EXPECT_EQ(a.sigma_m, b.sigma_m);
}

template <class Frame>
inline void expectEqualFrames(const Frame& a, const Frame& b) {
  EXPECT_EQ(a.robot, b.robot);
  EXPECT_EQ(a.acquired_ns, b.acquired_ns);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.state, b.state);
  EXPECT_EQ(a.camera_height_m, b.camera_height_m);
  expectEqual(a.motion, b.motion);
  expectEqual(a.floor_motion, b.floor_motion);
  expectEqual(a.scan, b.scan);
}

}  // namespace omnifleet::test
