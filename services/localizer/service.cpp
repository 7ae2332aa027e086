#include "localizer/service.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "localizer/ceiling_service.h"
#include "localizer/elected_localizer.h"
#include "localizer/fleet_setup.h"
#include "localizer/messages.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr std::size_t kRevisedAtOnce = 20;
constexpr std::chrono::seconds kRecoveryTimeout{
    2};  // to receive the state that the replicas hold; they answer within milliseconds
// For the first frame of a robot that can be reached, if the process knows all participants already.
constexpr std::chrono::milliseconds kTakeoverTimeout{300};

std::set<std::string> asSet(const std::vector<std::string>& names) {
  return {names.begin(), names.end()};
}

}  // namespace

LocalizerService::LocalizerService(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                                   const std::optional<Takeover>& takeover)
    : context_(context),
      ends_(context, runClock(context.options, fleet)),
      clock_(runClock(context.options, fleet)),
      live_times_(context, fleet),
      estimator_options_(estimation::EstimatorOptions::read(fleet.service("localizer").child("estimator"))),
      term_(static_cast<std::uint32_t>(context.options.incarnation)),
      own_frames_(ownFrames(fleet, estimator_options_)),
      estimator_(setups(fleet, estimator_options_), estimator_options_, own_frames_),
      observation_frames_(
          asSet(fleet.observingRobots()),
          localizer::ObservationOptions::read(fleet.service("localizer").child("observations"))),
      marked_robots_(asSet(fleet.markedRobots()),
                     localizer::MarkedOptions::read(fleet.service("localizer").child("marked"))),
      agreement_(localizer::AgreementOptions::read(fleet.service("localizer").child("agreement"))),
      surveyed_(surveyed(fleet)) {
  for (const fleet::RobotSpec& robot : fleet.robots) names_.insert(robot.name);
  readCameras(fleet);
  readMeasurements(fleet);
  readObservers(fleet);
  for (const std::string& robot : marked_robots_.names()) addOutputs(fleet, robot);
  const auto wait = localizer::CeilingWaitOptions::read(fleet.service("localizer").child("ceiling_wait"));
  const auto robots = fleet.mappingRobots();
  const bool is_blind = std::any_of(robots.begin(), robots.end(),
                                    [&](const std::string& robot) { return !fleet.robot(robot).has_wheels; });
  ceiling_cameras_ = fleet.ceilingCameras().size();
  if (!bus::isDeterministic(context.options.mode) && is_blind && ceiling_cameras_ > 0)
    ceiling_wait_.emplace(wait);
  const auto gaps = localizer::PoseGapOptions::read(fleet.service("localizer").child("pose_gaps"));
  if (!bus::isDeterministic(context.options.mode)) gaps_.emplace(gaps);
  if (context.options.incarnation == 1) return;
  state_recovery_.emplace(setups(fleet, estimator_options_), estimator_options_,
                          static_cast<std::uint32_t>(context_.topics.objects_kept.qos.depth),
                          asSet(fleet.mappingRobots()));
  keyframe_poses_ = context_.bus.reader(context_.topics.map_keyframe_pose);
  takes_over_ = takeover.has_value();
  if (!takeover) return;
  for (const auto& [robot, pose] : takeover->latest) state_recovery_->receive(pose);
}

void LocalizerService::start() {
  status().state(bus::ServiceState::kRunning);
  if (!state_recovery_) return;
  recovery_deadline_ = steady_clock::now() + kRecoveryTimeout;
  heard_deadline_ = takes_over_ ? steady_clock::now() + kTakeoverTimeout : *recovery_deadline_;
}

void LocalizerService::addOutputs(const fleet::Fleet& fleet, const std::string& robot) {
  const auto readers = [&](const char* topic) { return fleet::expectedReaders(fleet, topic, robot); };
  RobotOutputs outputs{
      {context_.bus.writer(context_.topics.pose, robot), "pose " + robot, readers("pose")},
      {context_.bus.writer(context_.topics.map_keyframe_pose, robot), "map/keyframe_pose localizer " + robot,
       readers("map/keyframe_pose")},
      {context_.bus.writer(context_.topics.alignment, robot), "alignment " + robot, readers("alignment")},
      {context_.bus.writer(context_.topics.place, robot), "place " + robot, readers("place")},
      {},
      {}};
  if (!fleet.maps(robot) && marked_robots_.names().count(robot) == 0) {
    outputs.objects.emplace(context_.bus.writer(context_.topics.objects, robot), "objects " + robot,
                            readers("objects"));
  }
  outputs_.emplace(robot, std::move(outputs));
  last_ns_[robot] = RunEnds::kNothing;
}

void LocalizerService::readCameras(const fleet::Fleet& fleet) {
  // Only a restarted localizer requests kept samples. In its first incarnation it also accepts a classifier
  // that keeps none.
  const auto& topic =
      context_.options.incarnation == 1 ? context_.topics.objects : context_.topics.objects_kept;
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
    measurement_checks_.emplace_back("measurement " + source, "frames of the robots",
                                     !bus::isDeterministic(context_.options.mode));
  }
}

void LocalizerService::readObservers(const fleet::Fleet& fleet) {
  const auto mode = streamMode(context_.options);
  for (const std::string& robot : fleet.observingRobots()) {
    const std::string source = "observations/" + robot;
    reports_.push_back(std::make_unique<Inlet<v1::Measurement, Payload>>(
        context_.bus.reader(context_.topics.measurement, source), merger_, ends_,
        bus::StreamSpec{"measurement " + source, robot, 0, bus::StreamRole::kInput, mode}));
    live_times_.follow(*reports_.back(), "measurement " + source);
    if (fleet.robot(robot).has_wheels) {
      wheels_.push_back(std::make_unique<Inlet<v1::WheelOdometry, Payload>>(
          context_.bus.reader(context_.topics.wheels_odometry, robot), merger_, ends_,
          bus::StreamSpec{"wheels/odometry " + robot, robot, 2, bus::StreamRole::kSide, mode}));
      live_times_.follow(*wheels_.back(), "wheels/odometry " + robot);
      robot_of_wheels_[wheels_.back()->stream()] = robot;
      wheel_checks_.emplace(robot, OverlapCheck("wheels/odometry " + robot, "measurement " + source,
                                                !bus::isDeterministic(context_.options.mode)));
    }
    addOutputs(fleet, robot);
  }
}

std::vector<bus::Expectation> LocalizerService::expectations() const {
  std::vector<bus::Expectation> all;
  for (const auto& [robot, outputs] : outputs_) {
    all.push_back(outputs.pose.expectation());
    all.push_back(outputs.correction.expectation());
    all.push_back(outputs.alignment.expectation());
    all.push_back(outputs.place.expectation());
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
      if (state_recovery_) state_recovery_->receive(objects);
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
  live_times_.report(status());
  return any;
}

/// After a restart, frames wait until the poses of the robots are known, or it is known that no replica holds
/// them.
bool LocalizerService::isRecovering() {
  if (!recovery_deadline_) return false;
  occupancy::KeyframePose pose;
  while (keyframe_poses_->take(keyframe_pose_)) {
    if (adapters::fromWire(keyframe_pose_, pose)) state_recovery_->receive(pose);
  }
  const auto now = steady_clock::now();
  const bool is_known =
      state_recovery_->isComplete() || (now >= heard_deadline_ && state_recovery_->isCompleteForHeard());
  if (!is_known && now < *recovery_deadline_) return true;
  recovery_deadline_.reset();
  keyframe_poses_.reset();
  for (const auto& [robot, latest] : state_recovery_->latest())
    if (gaps_) gaps_->know(robot, latest.acquired_ns, latest.sequence);
  estimator_ = localizer::EstimatorStage(state_recovery_->setups(), estimator_options_,
                                         state_recovery_->ownFrames(own_frames_));
  estimator_.keepAlignments(state_recovery_->inMap());
  return false;
}

bool LocalizerService::waitsForCeiling() {
  if (!ceiling_wait_) return false;
  newest_ns_.clear();
  // The first of them are those of the ceiling cameras (readMeasurements).
  for (std::size_t i = 0; i < ceiling_cameras_; ++i)
    if (const auto& inlet = measurements_[i]; inlet->receivedAny()) newest_ns_.push_back(inlet->lastNs());
  return ceiling_wait_->waits(merger_.nextTime(), newest_ns_, steady_clock::now());
}

bool LocalizerService::spin() {
  bool any = pull();
  if (isRecovering() || waitsForCeiling()) return any;
  // One batch at a time. If a robot sends nothing for minutes, minutes of data become available at once when
  // it does; neither the writers nor the supervisor may wait for all of them.
  if (merger_.nextBatch(batch_)) {
    process();
    any = true;
  }
  if (!ended_ && merger_.finished()) {
    const std::vector<PoseEstimate> last = estimator_.finish();
    reportFindings(std::numeric_limits<std::size_t>::max());
    if (bus::isDeterministic(context_.options.mode)) reportTimes();
    publishCorrections(last);
    finish("");
    ended_ = any = true;
    reportNeverLocalized();
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
  checkTimes();
  const std::uint64_t rejected_poses = agreement_.rejected();
  agreement_.check(batch_.time, values_);
  for (const Message& message : agreement_.takeMessages()) status().report(message);
  status().dropped(agreement_.rejected() - rejected_poses);
  for (const Objects& frame : marked_robots_.framesAt(batch_.time, values_)) frames_.push_back(&frame);
  const std::size_t published = frames_.size() + reported_.size();
  for (const Objects& frame : observation_frames_.framesAt(batch_.time, reported_)) frames_.push_back(&frame);
  if (state_recovery_) addRecoveredPoses();
  const std::uint64_t rejected = estimator_.rejectedMeasurements() + estimator_.rejectedFrames();
  const std::vector<PoseEstimate> poses = estimator_.process(batch_.time, frames_, values_);
  notePublished(published, poses);
  // The remaining frames belong to robots that were seen but reported nothing themselves.
  for (std::size_t i = 0; i < published; ++i) publishPose(poses[i]);
  for (const Report* report : reported_) publishObjects(*report);
  surveyed_.clear();
  status().dropped(estimator_.rejectedMeasurements() + estimator_.rejectedFrames() - rejected);
  status().processed(steady_clock::now() - begun);
  if (bus::isDeterministic(context_.options.mode)) refine();
  reportFindings(kRevisedAtOnce);
}

/// Notices a ceiling camera, observations or wheels on another clock than the frames that they belong to.
void LocalizerService::checkTimes() {
  const auto check = [this](OverlapCheck& overlap, const std::optional<TimeRange>& samples) {
    if (const auto message = overlap.addFrame(batch_.time, samples)) status().report(*message);
  };
  for (std::size_t i = 0; i < measurements_.size() && !frames_.empty(); ++i)
    check(measurement_checks_[i], measurements_[i]->times());
  for (const Report* report : reported_) {
    for (const auto& wheels : wheels_)
      if (robot_of_wheels_.at(wheels->stream()) == report->robot)
        check(wheel_checks_.at(report->robot), wheels->times());
  }
}

/// What only whole streams show.
void LocalizerService::reportTimes() {
  for (OverlapCheck& check : measurement_checks_)
    if (const auto message = check.finish()) status().report(*message);
  for (auto& [robot, check] : wheel_checks_)
    if (const auto message = check.finish()) status().report(*message);
}

bool LocalizerService::isPast(const std::string& robot) const {
  return state_recovery_ && state_recovery_->isPast(robot, batch_.time);
}

/// After a restart: gives the estimator the recovered poses of the robots whose first frames are in this
/// batch.
void LocalizerService::addRecoveredPoses() {
  recovered_poses_.clear();
  for (const Objects* frame : frames_) {
    if (auto recovered_pose = state_recovery_->recoverPose(*frame))
      recovered_poses_.push_back(std::move(*recovered_pose));
  }
  for (const Measurement& recovered_pose : recovered_poses_) values_.push_back(&recovered_pose);
  for (const std::string& robot : state_recovery_->takeUnknownRobots())
    status().report(localizer::restartedWithoutPose(robot));
}

/// Re-estimates the whole window with the new frames. The result is needed by the next frames only.
bool LocalizerService::refine() {
  if (!estimator_.refineDue()) return false;
  estimator_.refine();
  return true;
}

bool LocalizerService::background() {
  const bool refined = refine();
  const bool published = reportFindings(kRevisedAtOnce);
  return refined || published;
}

/// Revised poses are published a few at a time: live, a reader holds 64.
/// @return whether any was published
bool LocalizerService::publishAlignments() {
  const std::vector<Alignment> changed = estimator_.takeAlignments();
  for (const Alignment& alignment : changed) {
    adapters::toWire(alignment, clock_, alignment_sample_);
    outputs_.at(alignment.robot).alignment.write(alignment_sample_, status());
  }
  return !changed.empty();
}

bool LocalizerService::publishPlaces() {
  for (Place& place : estimator_.takePlaces()) places_.push_back(std::move(place));
  const std::size_t now = std::min(places_.size(), kRevisedAtOnce);
  for (std::size_t i = 0; i < now; ++i) {
    adapters::toWire(places_.front(), clock_, place_sample_);
    outputs_.at(places_.front().robot).place.write(place_sample_, status());
    places_.pop_front();
  }
  return now > 0;
}

bool LocalizerService::reportFindings(std::size_t at_most) {
  publishAlignments();
  while (publishPlaces() && at_most > kRevisedAtOnce) continue;
  for (const Message& finding : estimator_.takeFindings()) status().report(finding);
  for (PoseEstimate& pose : estimator_.takeRevised()) revised_.push_back(std::move(pose));
  const std::size_t now = std::min(revised_.size(), at_most);
  if (now == 0) return false;
  const auto end = revised_.begin() + static_cast<std::ptrdiff_t>(now);
  publishCorrections({revised_.begin(), end});
  revised_.erase(revised_.begin(), end);
  return true;
}

/// Poses are published in order of time, so no other pose up to this batch will follow. The message reports
/// this to readers that need all poses up to a time.
void LocalizerService::notePublished(std::size_t published, const std::vector<PoseEstimate>& poses) {
  if (!bus::isDeterministic(context_.options.mode)) return;
  for (std::size_t i = 0; i < published; ++i) last_ns_[poses[i].robot] = batch_.time;
  sample_.published().clear();
  for (const auto& [robot, last_ns] : last_ns_) {
    v1::PublishedPose& entry = sample_.published().emplace_back();
    entry.robot(robot);
    entry.last_ns(last_ns);
  }
}

void LocalizerService::publishPose(PoseEstimate pose) {
  noteLocalized(pose);
  if (const auto gap_s = gaps_ && pose.valid ? gaps_->gapBefore(pose.robot, pose.acquired_ns, pose.sequence)
                                             : std::nullopt) {
    if (pose.event == PoseEvent::kNone) pose.event = PoseEvent::kGap;
    status().report(localizer::poseGap(pose.robot, *gap_s, 1e-9 * static_cast<double>(pose.acquired_ns)));
  }
  adapters::toWire(pose, clock_, term_, sample_);  // does not change `published`
  outputs_.at(pose.robot).pose.write(sample_, status());
  if (marked_robots_.names().count(pose.robot) > 0 && marked_robots_.isDue(pose)) publishCorrections({pose});
  const Message message = estimator_.status(pose.robot);
  Message& reported = outputs_.at(pose.robot).reported;
  if (message == reported) return;  // once, even while other robots report problems of their own
  reported = message;
  if (message.code != ErrorCode::kNone) status().report(localizer::ofRobot(pose, message));
}

void LocalizerService::noteLocalized(const PoseEstimate& pose) {
  bool& is_localized = is_localized_[pose.robot];
  is_localized = is_localized || pose.valid;
}

bool LocalizerService::succeeded() const {
  const auto isLocalized = [](const auto& robot) { return robot.second; };
  return !ended_ || is_localized_.empty() ||
         std::any_of(is_localized_.begin(), is_localized_.end(), isLocalized);
}

void LocalizerService::reportNeverLocalized() {
  for (const auto& [robot, is_localized] : is_localized_)
    if (!is_localized) status().report(localizer::neverLocalized(robot));
  if (!succeeded()) status().report(localizer::noRobotLocalized());
}

void LocalizerService::publishObjects(const Report& report) {
  const Objects objects = observation_frames_.objectsOf(report, batch_.time, estimator_.estimator(), names_);
  adapters::toWire(objects, clock_, objects_sample_);
  outputs_.at(report.robot).objects->write(objects_sample_, status());
}

void LocalizerService::publishCorrections(const std::vector<PoseEstimate>& poses) {
  ++revision_;
  v1::KeyframePose wire;
  for (const PoseEstimate& pose : poses) {
    adapters::toWire(occupancy::makeKeyframePose(pose, term_, revision_), clock_, wire);
    outputs_.at(pose.robot).correction.write(wire, status());
  }
}

void LocalizerService::finish(const std::string& reason) {
  for (auto& [robot, outputs] : outputs_) {
    outputs.pose.end(ends_, reason);
    outputs.place.end(ends_, reason);  // the merger waits for these two until corrections end
    outputs.alignment.end(ends_, reason);
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
  const std::vector<std::string> hosts = fleet.estimatorHosts();
  if (o.mode == bus::RunMode::kLive && hosts.size() > 1 && !o.host.empty())
    return std::make_unique<ElectedLocalizer>(context, fleet);
  return std::make_unique<LocalizerService>(context, fleet);
}

}  // namespace omnifleet::services
