#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "estimation/estimator.h"
#include "estimation/fleet_state.h"
#include "estimation/measurements.h"
#include "estimation/scan_source.h"

namespace omnifleet::estimation {

/// The steps of the estimator over one fleet state.
class FleetEstimator::Impl {
 public:
  Impl(std::vector<RobotSetup> robots, const EstimatorOptions& options)
      : fleet(std::move(robots), options), scans_(options.scan, options.match) {}

  std::vector<PoseEstimate> process(TimeNs time, const std::vector<const Objects*>& frames,
                                    const std::vector<const Measurement*>& measurements);
  void refine();
  bool refineDue() const;
  std::vector<PoseEstimate> smoothed() const;
  void settle(int rounds);
  void followPaths(double moved_m, double moved_rad);
  void learnAppearance(RobotNode& robot);

  RobotNode& node(const std::string& robot) {
    RobotNode* found = fleet.find(robot);
    if (found == nullptr) throw std::runtime_error("estimator: unknown robot '" + robot + "'");
    return *found;
  }

  FleetState fleet;

 private:
  using Frame = RobotFrame;

  std::vector<Frame> admit(const std::vector<const Objects*>& frames);
  void locate(std::vector<Frame>& frames, TimeNs time);
  void startAtFix(const Frame& frame);
  void placeInitially(RobotNode& robot, const Objects& frame);
  void associate(std::vector<Frame>& frames);
  void associateOne(Frame& frame);
  void reweight();
  void reweight(RobotNode& robot, Step& step);
  void solveNewest(std::vector<Frame>& frames);
  void checkViews(std::vector<Frame>& frames);
  void checkSteps(std::vector<Frame>& frames);
  double solvedMisfit(RobotNode& robot, std::vector<Frame>& frames);
  void doubtStep(Frame& frame, std::vector<Frame>& frames);
  void condense();
  std::vector<PoseEstimate> report(const std::vector<Frame>& frames);

  MeasurementQueue queue_;
  ScanSource scans_;
  bool settled_ = false;        ///< at the end of a run
  std::uint32_t followed_ = 0;  ///< revision of the keyframes that the published paths follow
  bool whole_ = false;          ///< the newest frames went through a solve of the whole window already
};

}  // namespace omnifleet::estimation
