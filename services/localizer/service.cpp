#include "localizer/service.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "localizer/ceiling_service.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr std::size_t kRevisedAtOnce = 20;
constexpr std::chrono::seconds kListening{2};  // for what the replicas know: they answer within milliseconds

std::vector<estimation::RobotSetup> setups(const fleet::Fleet& fleet) {
  std::vector<estimation::RobotSetup> all;
  std::map<std::string, lens::Spread> lenses = fleet.lensSpreads();
  bool tied = !fleet.ceilingCameras().empty() || !fleet.landmarks.empty();
  for (const fleet::RobotSpec& robot : fleet.robots) {
    all.push_back({robot.name, robot.body, robot.initial_pose, false, lenses[robot.name]});
    tied = tied || robot.initial_pose;
  }
  // Nothing says where `map` is: it is the first robot's first base_link.
  const std::vector<std::string> located = fleet.locatedRobots();
  for (auto& setup : all) {
    if (!tied && !located.empty() && setup.name == located.front()) {
      setup.initial_pose = Pose2{};
      setup.founds_map = true;
    }
  }
  return all;
}

std::set<std::string> asSet(const std::vector<std::string>& names) {
  return {names.begin(), names.end()};
}

std::vector<Measurement> surveyed(const fleet::Fleet& fleet) {
  std::vector<Measurement> all;
  for (const dataset::Landmark& landmark : fleet.landmarks) {
    Measurement m;
    m.source = "landmarks";
    m.kind = MeasurementKind::kPosition;
    m.to = landmark.name;
    m.value << landmark.position_m, 0.0;
    m.covariance = landmark.sigma_m * landmark.sigma_m * Eigen::Matrix3d::Identity();
    all.push_back(std::move(m));
  }
  return all;
}

}  // namespace

LocalizerService::LocalizerService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      ends_(context),
      estimator_options_(estimation::EstimatorOptions::read(fleet.service("localizer").child("estimator"))),
      term_(static_cast<std::uint32_t>(context.options.life)),
      estimator_(setups(fleet), estimator_options_),
      observation_frames_(
          asSet(fleet.observingRobots()),
          localizer::ObservationOptions::read(fleet.service("localizer").child("observations"))),
      surveyed_(surveyed(fleet)) {
  for (const fleet::RobotSpec& robot : fleet.robots) names_.insert(robot.name);
  readCameras(fleet);
  readMeasurements(fleet);
  readObservers(fleet);
  if (context.options.life == 1) return;
  succession_.emplace(setups(fleet), estimator_options_,
                      static_cast<std::uint32_t>(context_.topics.objects_kept.qos.depth),
                      asSet(fleet.mappingRobots()));
  keyframe_poses_ = context_.bus.reader(context_.topics.map_keyframe_pose);
}

void LocalizerService::start() {
  status().state(bus::ServiceState::kRunning);
  if (succession_) listen_until_ = steady_clock::now() + kListening;
}

void LocalizerService::addOutputs(const fleet::Fleet& fleet, const std::string& robot) {
  const auto readers = [&](const char* topic) { return fleet::expectedReaders(fleet, topic, robot); };
  RobotOutputs outputs{{context_.bus.writer(context_.topics.pose, robot), "pose " + robot, readers("pose")},
                       {context_.bus.writer(context_.topics.map_keyframe_pose, robot),
                        "map/keyframe_pose localizer " + robot, readers("map/keyframe_pose")},
                       {},
                       {}};
  if (!fleet.maps(robot)) {
    outputs.objects.emplace(context_.bus.writer(context_.topics.objects, robot), "objects " + robot,
                            readers("objects"));
  }
  outputs_.emplace(robot, std::move(outputs));
  last_ns_[robot] = RunEnds::kNothing;
}

void LocalizerService::readCameras(const fleet::Fleet& fleet) {
  // Only a successor asks for what was kept: in its first life it takes a classifier that keeps nothing, too.
  const auto& topic = context_.options.life == 1 ? context_.topics.objects : context_.topics.objects_kept;
  for (const std::string& robot : fleet.mappingRobots()) {
    objects_.push_back(std::make_unique<Inlet<v1::Objects, Payload>>(
        context_.bus.reader(topic, robot), merger_, ends_,
        bus::StreamSpec{"objects " + robot, robot, 0, bus::StreamRole::kInput,
                        streamMode(context_.options)}));
    addOutputs(fleet, robot);
  }
}

void LocalizerService::readMeasurements(const fleet::Fleet& fleet) {
  std::vector<std::string> sources = fleet.ceilingCameras();
  for (const std::string& robot : fleet.mappingRobots()) {
    if (fleet.robot(robot).has_observations) sources.push_back("observations/" + robot);
  }
  for (const std::string& source : sources) {
    measurements_.push_back(std::make_unique<Inlet<v1::Measurement, Payload>>(
        context_.bus.reader(context_.topics.measurement, source), merger_, ends_,
        bus::StreamSpec{"measurement " + source, source, 1, bus::StreamRole::kInput,
                        streamMode(context_.options), false}));
  }
}

void LocalizerService::readObservers(const fleet::Fleet& fleet) {
  const auto mode = streamMode(context_.options);
  for (const std::string& robot : fleet.observingRobots()) {
    const std::string source = "observations/" + robot;
    reports_.push_back(std::make_unique<Inlet<v1::Measurement, Payload>>(
        context_.bus.reader(context_.topics.measurement, source), merger_, ends_,
        bus::StreamSpec{"measurement " + source, robot, 0, bus::StreamRole::kInput, mode}));
    if (fleet.robot(robot).has_wheels) {
      wheels_.push_back(std::make_unique<Inlet<v1::WheelOdometry, Payload>>(
          context_.bus.reader(context_.topics.wheels_odometry, robot), merger_, ends_,
          bus::StreamSpec{"wheels/odometry " + robot, robot, 2, bus::StreamRole::kSide, mode}));
      robot_of_wheels_[wheels_.back()->stream()] = robot;
    }
    addOutputs(fleet, robot);
  }
}

std::vector<bus::Expectation> LocalizerService::expectations() const {
  std::vector<bus::Expectation> all;
  for (const auto& [robot, outputs] : outputs_) {
    all.push_back(outputs.pose.expectation());
    all.push_back(outputs.correction.expectation());
    if (outputs.objects) all.push_back(outputs.objects->expectation());
  }
  return all;
}

bool LocalizerService::pull() {
  bool any = ends_.poll();
  for (auto& inlet : objects_) {
    any |= inlet->pull(status(), [this](const v1::Objects& wire, Payload& payload) {
      Objects& objects = payload.emplace<Objects>();
      const auto read = orInvalid(adapters::fromWire(wire, objects));
      if (succession_) succession_->hear(objects);
      return read;
    }) > 0;
  }
  for (auto& inlet : measurements_) {
    any |= inlet->pull(status(), [](const v1::Measurement& wire, Payload& payload) {
      return adapters::fromWire(wire, payload.emplace<Measurements>().values);
    }) > 0;
  }
  for (auto& inlet : reports_) {
    any |= inlet->pull(status(), [](const v1::Measurement& wire, Payload& payload) {
      Report& report = payload.emplace<Report>();
      const std::string source = wire.source().to_string();
      report.robot = source.substr(source.find('/') + 1);
      report.sequence = wire.header().sequence_number();
      return adapters::fromWire(wire, report.values);
    }) > 0;
  }
  for (auto& inlet : wheels_) {
    any |= inlet->pull(status(), [](const v1::WheelOdometry& wire, Payload& payload) {
      return adapters::fromWire(wire, payload.emplace<dataset::WheelRow>());
    }) > 0;
  }
  return any;
}

/// Before a successor knows where the robots are, or that nobody does, their frames wait.
bool LocalizerService::listening() {
  if (!listen_until_) return false;
  occupancy::KeyframePose pose;
  while (keyframe_poses_->take(keyframe_pose_)) {
    if (adapters::fromWire(keyframe_pose_, pose)) succession_->hear(pose);
  }
  if (!succession_->heardOfAll() && steady_clock::now() < *listen_until_) return true;
  listen_until_.reset();
  keyframe_poses_.reset();
  estimator_ = localizer::EstimatorStage(succession_->setups(), estimator_options_);
  return false;
}

bool LocalizerService::spin() {
  bool any = pull();
  if (listening()) return any;
  // One at a time: where a robot tells nothing for minutes, minutes are there at once when it does, and
  // neither who writes nor who watches is to wait for all of them.
  if (merger_.nextBatch(batch_)) {
    process();
    any = true;
  }
  if (!ended_ && merger_.finished()) {
    const std::vector<PoseEstimate> last = estimator_.finish();
    tellFindings(std::numeric_limits<std::size_t>::max());
    publishCorrections(last);
    finish("");
    ended_ = any = true;
    tellNeverLocated();
  }
  return any;
}

void LocalizerService::takeWheels() {
  for (const auto& item : batch_.side) {
    const auto& row = std::get<dataset::WheelRow>(item.payload);
    estimator_.addWheels(robot_of_wheels_.at(item.stream), row.time_ns, row.left_mps, row.right_mps);
  }
}

void LocalizerService::process() {
  const auto begun = steady_clock::now();
  takeWheels();
  frames_.clear();
  values_.clear();
  reported_.clear();
  for (const Measurement& landmark : surveyed_) values_.push_back(&landmark);
  for (const auto& item : batch_.inputs) {
    const auto* measured = std::get_if<Measurements>(&item.payload);
    const auto* report = std::get_if<Report>(&item.payload);
    const auto* objects = std::get_if<Objects>(&item.payload);
    if (objects != nullptr && !isPast(objects->robot)) frames_.push_back(objects);
    if (report != nullptr && !isPast(report->robot)) reported_.push_back(report);
    if (measured == nullptr && report == nullptr) continue;
    for (const Measurement& value : measured != nullptr ? measured->values : report->values)
      values_.push_back(&value);
  }
  const std::size_t published = frames_.size() + reported_.size();
  for (const Objects& frame : observation_frames_.framesAt(batch_.time, reported_)) frames_.push_back(&frame);
  if (succession_) placeAll();
  const std::uint64_t rejected = estimator_.rejectedMeasurements() + estimator_.rejectedFrames();
  const std::vector<PoseEstimate> poses = estimator_.process(batch_.time, frames_, values_);
  tellPublished(published, poses);
  // Frames beyond these are of robots that were seen but reported nothing themselves.
  for (std::size_t i = 0; i < published; ++i) publishPose(poses[i]);
  for (const Report* report : reported_) publishObjects(*report);
  surveyed_.clear();
  status().dropped(estimator_.rejectedMeasurements() + estimator_.rejectedFrames() - rejected);
  status().processed(steady_clock::now() - begun);
  if (bus::isDeterministic(context_.options.mode)) refine();
  tellFindings(kRevisedAtOnce);
}

bool LocalizerService::isPast(const std::string& robot) const {
  return succession_ && succession_->isPast(robot, batch_.time);
}

/// Tells the estimator where the robots are of which a successor gets the first frames.
void LocalizerService::placeAll() {
  placings_.clear();
  for (const Objects* frame : frames_) {
    if (auto placing = succession_->place(*frame)) placings_.push_back(std::move(*placing));
  }
  for (const Measurement& placing : placings_) values_.push_back(&placing);
  for (const std::string& robot : succession_->takeUnknown())
    status().error(robot +
                   ": started again, and no replica of the map knows where it is; it has no pose until "
                   "a camera or another robot that has one sees it");
}

/// What the new frames teach of the whole window: the next frames are the first to need it.
bool LocalizerService::refine() {
  if (!estimator_.refineDue()) return false;
  estimator_.refine();
  return true;
}

bool LocalizerService::background() {
  const bool refined = refine();
  const bool told = tellFindings(kRevisedAtOnce);
  return refined || told;
}

/// Revised poses go a few at a time: live, a reader holds 64.
/// @return whether any was told
bool LocalizerService::tellFindings(std::size_t at_most) {
  for (const std::string& finding : estimator_.takeFindings()) status().error(finding);
  for (PoseEstimate& pose : estimator_.takeRevised()) revised_.push_back(std::move(pose));
  const std::size_t now = std::min(revised_.size(), at_most);
  if (now == 0) return false;
  const auto end = revised_.begin() + static_cast<std::ptrdiff_t>(now);
  publishCorrections({revised_.begin(), end});
  revised_.erase(revised_.begin(), end);
  return true;
}

/// In order of time nothing else up to this batch will come; whoever needs all poses up to then is told so.
void LocalizerService::tellPublished(std::size_t published, const std::vector<PoseEstimate>& poses) {
  if (!bus::isDeterministic(context_.options.mode)) return;
  for (std::size_t i = 0; i < published; ++i) last_ns_[poses[i].robot] = batch_.time;
  sample_.published().clear();
  for (const auto& [robot, last_ns] : last_ns_) {
    v1::PublishedPose& entry = sample_.published().emplace_back();
    entry.robot(robot);
    entry.last_ns(last_ns);
  }
}

void LocalizerService::publishPose(const PoseEstimate& pose) {
  noteLocated(pose);
  adapters::toWire(pose, runClock(context_.options), term_, sample_);  // leaves `published` as it is
  outputs_.at(pose.robot).pose.write(sample_, status());
  const std::string text = estimator_.status(pose.robot);
  std::string& told = outputs_.at(pose.robot).trouble;
  if (text == told) return;  // once, though other robots have troubles of their own
  told = text;
  if (!text.empty()) status().error(pose.robot + ": " + text);
}

void LocalizerService::noteLocated(const PoseEstimate& pose) {
  bool& is_located = is_located_[pose.robot];
  is_located = is_located || pose.valid;
}

bool LocalizerService::succeeded() const {
  const auto isLocated = [](const auto& robot) { return robot.second; };
  return !ended_ || is_located_.empty() || std::any_of(is_located_.begin(), is_located_.end(), isLocated);
}

void LocalizerService::tellNeverLocated() {
  for (const auto& [robot, is_located] : is_located_)
    if (!is_located) status().error(robot + ": was never located; nothing that it saw is in the map");
  if (!succeeded())
    status().error(
        "no robot was ever located: there is no map. Where none starts at a known place (initial_pose in the "
        "fleet's file), a ceiling camera or surveyed landmarks must tell where one of them is");
}

void LocalizerService::publishObjects(const Report& report) {
  const Objects objects = observation_frames_.objectsOf(report, batch_.time, estimator_.estimator(), names_);
  adapters::toWire(objects, runClock(context_.options), objects_sample_);
  outputs_.at(report.robot).objects->write(objects_sample_, status());
}

void LocalizerService::publishCorrections(const std::vector<PoseEstimate>& poses) {
  ++revision_;
  v1::KeyframePose wire;
  for (const PoseEstimate& pose : poses) {
    adapters::toWire(occupancy::makeKeyframePose(pose, term_, revision_), runClock(context_.options), wire);
    outputs_.at(pose.robot).correction.write(wire, status());
  }
}

void LocalizerService::finish(const std::string& reason) {
  for (auto& [robot, outputs] : outputs_) {
    outputs.pose.end(ends_, reason);
    outputs.correction.end(ends_, reason);
    if (outputs.objects) outputs.objects->end(ends_, reason);
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
