#pragma once

#include <memory>
#include <variant>

#include "bus/service.h"
#include "classifier/classifier.h"
#include "common/inlet.h"
#include "common/pose_feedback.h"
#include "common/side_output.h"
#include "dataset/track_files.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Reads one robot's local maps and the fleet's poses of the previous frame. Publishes one sample of objects
/// per frame.
class ClassifierService : public bus::Service {
 public:
  ClassifierService(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  std::vector<bus::Expectation> expectations() const override { return {out_.expectation()}; }
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override;
  std::optional<bus::Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    return merger_.waitingFor(now);
  }

 private:
  using Payload = std::variant<std::monostate, LocalMap, PoseEstimate>;

  bool pull();
  void process();
  void assumeInitialPoses(TimeNs now_ns);

  bus::ServiceContext context_;
  bus::TimeMerger<Payload> merger_;
  bus::TimeMerger<Payload>::Batch batch_;
  RunEnds ends_;
  adapters::RunClock clock_;
  Inlet<v1::LocalMap, Payload> local_maps_;
  PoseFeedback<Payload> poses_;
  Outlet<v1::Objects> out_;
  classifier::Classifier classifier_;
  std::vector<PoseEstimate> initial_poses_;   ///< used for the first local map
  SideOutput<dataset::TracksWriter> tracks_;  ///< input of `evaluate` for the classification score
  v1::Objects sample_;
  bool ended_ = false;
};

std::unique_ptr<bus::Service> makeClassifier(const bus::ServiceContext& context);

}  // namespace omnifleet::services
