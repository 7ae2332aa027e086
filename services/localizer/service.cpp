#include "localizer/service.h"

#include <cmath>

#include "localizer/ceiling_service.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr std::uint32_t kTerm = 1;  // of the only estimator; mergers' own first guesses have term 0

std::vector<estimation::RobotSetup> setups(const fleet::Fleet& fleet) {
  std::vector<estimation::RobotSetup> all;
  for (const fleet::RobotSpec& robot : fleet.robots)
    all.push_back({robot.name, robot.body, robot.initial_pose});
  return all;
}

}  // namespace

LocalizerService::LocalizerService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      ends_(context),
      estimator_(setups(fleet),
                 estimation::EstimatorOptions::read(fleet.service("localizer").child("estimator"))) {
  const auto mode = streamMode(context.options);
  for (const std::string& robot : fleet.mappingRobots()) {
    objects_.push_back(std::make_unique<Inlet<v1::Objects, Payload>>(
        context.bus.reader(context.topics.objects, robot), merger_, ends_,
        bus::StreamSpec{"objects " + robot, robot, 0, bus::StreamRole::kInput, mode}));
    outputs_.emplace(robot, RobotOutputs{{context.bus.writer(context.topics.pose, robot), "pose " + robot,
                                          fleet::expectedReaders(fleet, "pose", robot)},
                                         {context.bus.writer(context.topics.map_keyframe_pose, robot),
                                          "map/keyframe_pose localizer " + robot,
                                          fleet::expectedReaders(fleet, "map/keyframe_pose", robot)}});
  }
  for (const std::string& camera : fleet.ceilingCameras()) {
    measurements_.push_back(std::make_unique<Inlet<v1::Measurement, Payload>>(
        context.bus.reader(context.topics.measurement, camera), merger_, ends_,
        bus::StreamSpec{"measurement " + camera, camera, 1, bus::StreamRole::kInput, mode, false}));
  }
}

std::vector<bus::Expectation> LocalizerService::expectations() const {
  std::vector<bus::Expectation> all;
  for (const auto& [robot, outputs] : outputs_) {
    all.push_back(outputs.pose.expectation());
    all.push_back(outputs.correction.expectation());
  }
  return all;
}

bool LocalizerService::pull() {
  bool any = ends_.poll();
  for (auto& inlet : objects_) {
    any |= inlet->pull(status(), [](const v1::Objects& wire, Payload& payload) {
      return adapters::fromWire(wire, payload.emplace<Objects>());
    }) > 0;
  }
  for (auto& inlet : measurements_) {
    any |= inlet->pull(status(), [](const v1::Measurement& wire, Payload& payload) {
      return adapters::fromWire(wire, payload.emplace<Measurements>().values);
    }) > 0;
  }
  return any;
}

bool LocalizerService::spin() {
  bool any = pull();
  while (merger_.nextBatch(batch_)) {
    process();
    any = true;
  }
  if (!ended_ && merger_.finished()) {
    publishCorrections(estimator_.finish());
    finish("");
    ended_ = any = true;
  }
  return any;
}

void LocalizerService::process() {
  const auto begun = steady_clock::now();
  frames_.clear();
  values_.clear();
  for (const auto& item : batch_.inputs) {
    if (const auto* objects = std::get_if<Objects>(&item.payload)) frames_.push_back(objects);
    if (const auto* measured = std::get_if<Measurements>(&item.payload)) {
      for (const Measurement& value : measured->values) values_.push_back(&value);
    }
  }
  const std::uint64_t rejected = estimator_.rejectedMeasurements() + estimator_.rejectedFrames();
  publishPoses(estimator_.process(batch_.time, frames_, values_));
  status().dropped(estimator_.rejectedMeasurements() + estimator_.rejectedFrames() - rejected);
  status().processed(steady_clock::now() - begun);
}

void LocalizerService::publishPoses(const std::vector<PoseEstimate>& poses) {
  for (const PoseEstimate& pose : poses) {
    adapters::toWire(pose, runClock(context_.options), kTerm, sample_);
    outputs_.at(pose.robot).pose.write(sample_, status());
    const std::string text = estimator_.status(pose.robot);
    if (!text.empty()) status().error(pose.robot + ": " + text);
  }
}

void LocalizerService::publishCorrections(const std::vector<PoseEstimate>& poses) {
  ++revision_;
  v1::KeyframePose wire;
  for (const PoseEstimate& pose : poses) {
    if (!pose.valid) continue;
    adapters::toWire(occupancy::makeKeyframePose(pose, kTerm, revision_), runClock(context_.options), wire);
    outputs_.at(pose.robot).correction.write(wire, status());
  }
}

void LocalizerService::finish(const std::string& reason) {
  for (auto& [robot, outputs] : outputs_) {
    outputs.pose.end(ends_, reason);
    outputs.correction.end(ends_, reason);
  }
}

void LocalizerService::drain() {
  finish(ended_ ? "" : "stopped");
}

std::unique_ptr<bus::Service> makeLocalizer(const bus::ServiceContext& context) {
  const auto& o = context.options;
  const fleet::Fleet fleet = fleet::Fleet::load(o.fleet, o.dataset, o.configs);
  if (!o.camera.empty()) return std::make_unique<CeilingService>(context, fleet);
  return std::make_unique<LocalizerService>(context, fleet);
}

}  // namespace omnifleet::services
