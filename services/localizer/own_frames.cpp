#include "localizer/own_frames.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "localizer/messages.h"

namespace omnifleet::localizer {
namespace {

// Sightings may locate a robot whose scans make no map: after so many frames without a scan, or with so few
// keyframes where it has driven so far.
constexpr int kPatience = 10;
constexpr std::size_t kFewScans = 2;
constexpr double kDriven_m = 1.0;
constexpr double kMoved_m = 0.02;  // more than the error of a pose
constexpr const char* kNoScan = "no scan yet";
constexpr double kScoreChanged = 0.02;  // of an alignment that is published again

/// The whole fleet, so that robots have the same numbers everywhere; only one of them ever has frames.
std::vector<estimation::RobotSetup> alone(std::vector<estimation::RobotSetup> robots,
                                          const std::string& robot, const Pose2& first) {
  for (estimation::RobotSetup& setup : robots) {
    setup.initial_pose.reset();
    setup.founds_map = false;
    if (setup.name != robot) continue;
    setup.initial_pose = first;
    setup.founds_map = true;
  }
  return robots;
}

}  // namespace

OwnFrames::OwnFrames(const std::vector<estimation::RobotSetup>& robots,
                     const std::map<std::string, Pose2>& first, const estimation::EstimatorOptions& options) {
  for (const auto& [name, pose] : first) {
    Own own{estimation::FleetEstimator(alone(robots, name, pose), options),
            estimation::MapAlignment(options.alignment, options.match),
            {},
            0,
            0.0,
            pose};
    own_.emplace(name, std::move(own));
    Alignment alignment;
    alignment.robot = alignment.frame = name;
    alignment.reason = kNoScan;
    publish(name, std::move(alignment));
  }
}

void OwnFrames::publish(const std::string& robot, Alignment alignment) {
  const auto own = own_.find(robot);
  if (own != own_.end()) {
    const Alignment& published = own->second.published;
    if (!published.robot.empty() && published.status == alignment.status &&
        published.frame == alignment.frame && std::abs(published.score - alignment.score) < kScoreChanged &&
        published.reason == alignment.reason)
      return;
    own->second.published = alignment;
  }
  changed_.push_back(std::move(alignment));
}

void OwnFrames::inOwnFrame(const std::string& robot, std::vector<PoseEstimate>& poses) const {
  for (PoseEstimate& pose : poses) pose.frame = robot;
}

PoseEstimate OwnFrames::process(TimeNs time, const Objects& frame) {
  Own& own = own_.at(frame.robot);
  std::vector<PoseEstimate> poses = own.estimator.process(time, {&frame}, {});
  ++own.frames;
  if (poses.front().valid) {
    const double moved_m =
        (poses.front().map_from_base.translation() - own.counted_from.translation()).norm();
    if (moved_m > kMoved_m) {
      own.driven_m += moved_m;
      own.counted_from = poses.front().map_from_base;
    }
  }
  inOwnFrame(frame.robot, poses);
  return std::move(poses.front());
}

bool OwnFrames::refineDue() const {
  return std::any_of(own_.begin(), own_.end(),
                     [](const auto& own) { return own.second.estimator.refineDue(); });
}

void OwnFrames::refine(estimation::FleetEstimator& common, TimeNs time) {
  std::vector<std::string> matched;
  for (auto& [robot, own] : own_) {
    if (!own.estimator.refineDue()) continue;
    own.estimator.refine();
    std::vector<PoseEstimate> revised = own.estimator.takeRevised();
    inOwnFrame(robot, revised);
    revised_.insert(revised_.end(), revised.begin(), revised.end());
    for (Message& finding : own.estimator.takeFindings()) findings_.push_back(std::move(finding));
    const std::size_t scans = own.estimator.keyframes().size();
    common.allowSightings(
        robot, own.frames >= kPatience && (scans == 0 || (scans < kFewScans && own.driven_m > kDriven_m)));
    const estimation::MapAlignment::Result& result =
        own.matcher.update({common.keyframes(), common.placeMemories()},
                           {own.estimator.keyframes(), own.estimator.placeMemories()});
    Alignment alignment;
    alignment.robot = robot;
    alignment.acquired_ns = time;
    alignment.status = result.status;
    alignment.reason = !result.reason.empty()                  ? result.reason
                       : own.estimator.keyframes().size() == 0 ? kNoScan
                                                               : "the common map has no scan yet";
    alignment.score = result.score;
    alignment.frame = robot;
    if (result.status == AlignmentStatus::kMatched) {
      alignment.frame.clear();
      alignment.map_from_frame = result.map_from_own;
      alignment.covariance = result.covariance;
      common.join(robot, own.estimator, result.map_from_own, result.covariance);
      findings_.push_back(robotMatched(robot, alignment));
      matched.push_back(robot);
    }
    publish(robot, std::move(alignment));
  }
  for (const std::string& robot : matched) own_.erase(robot);
}

void OwnFrames::giveUp(const std::string& robot, estimation::FleetEstimator& common, TimeNs time) {
  const auto own = own_.find(robot);
  if (own == own_.end()) return;
  const auto relation = common.adoptPath(robot, own->second.estimator);
  Alignment alignment;
  alignment.robot = robot;
  alignment.acquired_ns = time;
  alignment.status = AlignmentStatus::kMatched;
  alignment.reason = "other robots and obstacles that both see";
  alignment.score = 1.0;
  if (relation) {
    alignment.map_from_frame = relation->map_from_own;
    alignment.covariance = relation->covariance;
  }
  publish(robot, std::move(alignment));
  own_.erase(own);
}

std::vector<PoseEstimate> OwnFrames::finish() {
  std::vector<PoseEstimate> all;
  for (auto& [robot, own] : own_) {
    std::vector<PoseEstimate> last = own.estimator.finish();
    std::vector<PoseEstimate> revised = own.estimator.takeRevised();
    inOwnFrame(robot, last);
    inOwnFrame(robot, revised);
    revised_.insert(revised_.end(), revised.begin(), revised.end());
    all.insert(all.end(), last.begin(), last.end());
    findings_.push_back(robotNotMatched(robot, own.published));
  }
  return all;
}

std::vector<PoseEstimate> OwnFrames::takeRevised() {
  return std::exchange(revised_, {});
}

std::vector<Message> OwnFrames::takeFindings() {
  return std::exchange(findings_, {});
}

std::vector<Place> OwnFrames::takePlaces() {
  std::vector<Place> all;
  for (auto& [robot, own] : own_) {
    for (Place& place : own.estimator.takePlaces()) {
      place.frame = robot;
      all.push_back(std::move(place));
    }
  }
  return all;
}

std::vector<Alignment> OwnFrames::takeAlignments() {
  return std::exchange(changed_, {});
}

}  // namespace omnifleet::localizer
