#pragma once

#include <map>
#include <memory>
#include <variant>
#include <vector>

#include "bus/service.h"
#include "common/inlet.h"
#include "fleet/fleet.h"
#include "localizer/estimator_stage.h"

namespace omnifleet::services {

/// The estimator: objects of every robot and measurements of every front end in, one pose per robot and frame
/// out. At the end of a run it publishes the smoothed poses as corrected keyframe poses.
class LocalizerService : public bus::Service {
 public:
  LocalizerService(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  std::vector<bus::Expectation> expectations() const override;
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override;
  std::optional<bus::Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    return merger_.waitingFor(now);
  }

 private:
  struct Measurements {
    std::vector<Measurement> values;
  };
  using Payload = std::variant<std::monostate, Objects, Measurements>;
  struct RobotOutputs {
    Outlet<v1::Pose> pose;
    Outlet<v1::KeyframePose> correction;
  };

  bool pull();
  void process();
  void publishPoses(const std::vector<PoseEstimate>& poses);
  void publishCorrections(const std::vector<PoseEstimate>& poses);
  void finish(const std::string& reason);

  bus::ServiceContext context_;
  bus::TimeMerger<Payload> merger_;
  bus::TimeMerger<Payload>::Batch batch_;
  RunEnds ends_;
  std::vector<std::unique_ptr<Inlet<v1::Objects, Payload>>> objects_;
  std::vector<std::unique_ptr<Inlet<v1::Measurement, Payload>>> measurements_;
  std::map<std::string, RobotOutputs> outputs_;
  localizer::EstimatorStage estimator_;
  std::vector<const Objects*> frames_;
  std::vector<const Measurement*> values_;
  v1::Pose sample_;
  std::uint32_t revision_ = 0;
  bool ended_ = false;
};

/// A front end (with --camera) or the fleet's estimator.
std::unique_ptr<bus::Service> makeLocalizer(const bus::ServiceContext& context);

}  // namespace omnifleet::services
