#pragma once

#include <fstream>
#include <memory>
#include <string>

#include "adapters/adapters.h"
#include "bus/bus.h"
#include "bus/topics.h"

namespace omnifleet::test {

/// Plays classifier and localizer for the global mergers of config/fleets/small.yaml (robots r1 and r2) on
/// any bus.
class MergerFeed {
 public:
  static constexpr TimeNs kStepNs = 200'000'000;  ///< of data time; the test decides about real time

  explicit MergerFeed(bus::Bus& bus) {
    const bus::Topics topics(bus::RunMode::kLive);
    for (Robot* robot : {&r1_, &r2_}) {
      robot->objects = bus.writer(topics.objects, robot->name);
      robot->pose = bus.writer(topics.pose, robot->name);
    }
  }

  /// A config overlay in which every frame is a keyframe. `replication`: options, in YAML.
  static void writeOverlay(const std::string& path, const std::string& replication) {
    std::ofstream(path) << "services:\n  global_merger:\n"
                        << "    keyframes: {distance_m: 0, interval_s: 0, min_interval_s: 0}\n"
                        << "    replication: {" << replication << "}\n";
  }

  /// The next frame of all robots. Frames of r1 alone have objects, so each becomes one contribution of r1.
  bool frame() {
    ++step_;
    return write(objects(), *r1_.objects) && pose(r1_, 0.0) && pose(r2_, 1.0);
  }
  /// Poses without objects: time passes, and the set of contributions stays as it is.
  bool idleFrame() {
    ++step_;
    return pose(r1_, 0.0) && pose(r2_, 1.0);
  }
  /// Readers of the own frames of r1 and of the poses of r1 and r2.
  bool waitForReaders(int objects, int poses, std::chrono::nanoseconds timeout) {
    return r1_.objects->waitForReaders(objects, timeout) && r1_.pose->waitForReaders(poses, timeout) &&
           r2_.pose->waitForReaders(poses, timeout);
  }

  /// Processes that read the frames of r1 now.
  int objectReaders() const { return r1_.objects->matched(); }

 private:
  struct Robot {
    std::string name;
    std::unique_ptr<bus::Writer<v1::Objects>> objects = {};
    std::unique_ptr<bus::Writer<v1::Pose>> pose = {};
  };
  Objects objects() const {
    Objects seen;
    seen.robot = "r1";
    seen.acquired_ns = step_ * kStepNs;
    seen.sequence = static_cast<std::uint32_t>(step_);
    seen.scan.range_m.assign(360, 1.5F);
    seen.scan.sigma_m.assign(360, 0.01F);
    seen.scan.label.assign(360, RayLabel::kObstacle);
    seen.scan.object.assign(360, 0);
    return seen;
  }
  bool write(const Objects& seen, bus::Writer<v1::Objects>& writer) {
    v1::Objects wire;
    adapters::toWire(seen, adapters::RunClock::kSystem, wire);
    return writer.write(wire);
  }
  bool pose(Robot& robot, double y_m) {
    PoseEstimate estimate;
    estimate.robot = robot.name;
    estimate.acquired_ns = step_ * kStepNs;
    estimate.sequence = static_cast<std::uint32_t>(step_);
    estimate.valid = true;
    estimate.map_from_base = {0.01 * static_cast<double>(step_ % 100), y_m, 0.0};
    estimate.covariance = Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal();
    v1::Pose wire;
    adapters::toWire(estimate, adapters::RunClock::kSystem, 0, wire);
    return robot.pose->write(wire);
  }

  Robot r1_{"r1"}, r2_{"r2"};
  TimeNs step_ = 0;
};

}  // namespace omnifleet::test
