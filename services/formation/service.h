#pragma once

#include <map>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "bus/service.h"
#include "common/inlet.h"
#include "common/pose_feedback.h"
#include "fleet/fleet.h"
#include "formation/formation.h"

namespace omnifleet::services {

/// Input: one robot's objects, the poses of the fleet and the states of the other formation services. Output:
/// one wheel command per frame. The only writer of wheels/command.
class FormationService : public bus::Service {
 public:
  FormationService(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  std::vector<bus::Expectation> expectations() const override {
    return {command_out_.expectation(), state_out_.expectation()};
  }
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override;
  std::optional<bus::Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    return merger_.waitingFor(now);
  }

 private:
  using Payload = std::variant<std::monostate, Objects, PoseEstimate, motion::FormationState>;

  bool pull();
  void process();
  void answer(const Objects& objects, const std::vector<PoseEstimate>& known);
  void updateStandstill(const formation::Formation::Output& output, TimeNs now_ns);
  void reportStandstill();
  void reportSkipped();

  bus::ServiceContext context_;
  std::string robot_;
  bus::TimeMerger<Payload> merger_;
  bus::TimeMerger<Payload>::Batch batch_;
  adapters::RunClock clock_;
  RunEnds ends_;
  Inlet<v1::Objects, Payload> objects_;
  PoseFeedback<Payload> poses_;
  std::vector<std::unique_ptr<Inlet<v1::FormationState, Payload>>> states_;
  std::unique_ptr<bus::Reader<v1::FormationCommand>> command_in_;
  Outlet<v1::WheelCommand> command_out_;
  std::unique_ptr<bus::Writer<v1::FormationCommand>> command_repeat_;
  Outlet<v1::FormationState> state_out_;
  formation::Formation formation_;
  std::vector<motion::FormationState> received_states_;
  v1::FormationCommand command_;
  v1::WheelCommand speeds_;
  v1::FormationState state_;
  std::optional<TimeNs> standing_since_ns_;  ///< as a leader that has not arrived
  double left_m_ = 0.0;                      ///< distance to the waypoint that it heads for
  bool reported_standstill_ = false;
  std::vector<motion::SkippedFrontier> skipped_;  ///< of the frame before
  std::vector<Eigen::Vector2d> reported_m_;       ///< map; skipped frontiers that have been reported
  bool ended_ = false;
};

std::unique_ptr<bus::Service> makeFormation(const bus::ServiceContext& context);

}  // namespace omnifleet::services
