#include "global_merger/service.h"

#include <algorithm>

#include "global_merger/messages.h"
#include "global_merger/warning_report.h"
#include "lens/camera.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::seconds kSavePeriod{10};

constexpr std::size_t kCorrectedAtOnce = 8;  // contributions per slice: 2 ms
constexpr std::size_t kMaxWaiting = 64;      // frames whose objects or pose may still arrive (live)

std::string contributionStream(const std::string& robot) {
  return "map/contribution " + robot;
}
std::string poseStream(const std::string& robot) {
  return "map/keyframe_pose " + robot;
}
std::string correctionStream(const std::string& robot) {
  return "map/keyframe_pose localizer " + robot;
}

bool seesAboveHorizon(const lens::CameraModel& model) {
  constexpr double kRows_px = 8.0;  // that the local mapper checks there (distance_vector.walk.check_px)
  return !lens::Camera(model).floorFromPixel({model.principal_point_px.x(), kRows_px});
}

global_merger::Merger emptyMap(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                               const std::string& frame) {
  const options::Section section = fleet.service("global_merger");
  global_merger::Merger map(global_merger::MergerOptions::read(section.child("outlines")),
                            occupancy::OccupancyOptions::read(section.child("occupancy")), fleet.bodies(),
                            frame);
  map.setLenses(fleet.lensSpreads());
  if (context.options.mode == bus::RunMode::kLive) map.correctLater();
  return map;
}

/// Of a robot whose map comes from a forward camera, neighbouring edges share most of their error, and what
/// looks like floor to the end of the view is floor.
global_merger::KeyframeOptions keyframeOptions(const fleet::Fleet& fleet, const std::string& robot) {
  auto options = global_merger::KeyframeOptions::read(fleet.service("global_merger").child("keyframes"));
  const fleet::CameraSpec* front = fleet.frontOf(robot);
  if (front == nullptr || fleet.mapCameraOf(robot) != front) return options;
  options.rays.shared_share = options.rays.front_shared_share;
  if (seesAboveHorizon(front->model)) options.rays.room_share = options.rays.front_room_share;
  return options;
}

}  // namespace

GlobalMergerService::GlobalMergerService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      clock_(runClock(context.options, fleet)),
      robot_(fleet.robot(context.options.robot).name),
      saves_(fleet.savingReplica(context.options.host) == robot_),
      ends_(context, clock_),
      contributions_(context.bus.reader(context.topics.map_contribution)),
      keyframe_poses_(context.bus.reader(context.topics.map_keyframe_pose)),
      contribution_out_(context.bus.writer(context.topics.map_contribution, robot_),
                        contributionStream(robot_),
                        fleet::expectedReaders(fleet, "map/contribution", robot_)),
      pose_out_(context.bus.writer(context.topics.map_keyframe_pose, robot_), poseStream(robot_),
                fleet::expectedReaders(fleet, "map/keyframe_pose", robot_)),
      publisher_(context, fleet.name, robot_, clock_),
      maker_(keyframeOptions(fleet, robot_)),
      replica_(emptyMap(context, fleet, "")),
      own_maps_(saves_ ? fleet.locatedRobots() : std::vector<std::string>{},
                [context, fleet](const std::string& robot) { return emptyMap(context, fleet, robot); }),
      alignments_(context, fleet, saves_, ends_),
      places_(context, fleet, saves_, ends_),
      saver_(context.options.out, fleet) {
  if (fleet.maps(robot_) || fleet.robot(robot_).has_observations) {
    objects_.emplace(context.bus.reader(context.topics.objects, robot_), merger_, ends_,
                     bus::StreamSpec{"objects " + robot_, robot_, 0, bus::StreamRole::kInput,
                                     streamMode(context.options)});
  }
  const auto replication =
      occupancy::ReconcilerOptions::read(fleet.service("global_merger").child("replication"));
  if (context.options.mode == bus::RunMode::kLive) {
    replication_.emplace(context_, clock_, robot_, fleet.locatedRobots(), replication);
  }
  const std::vector<std::string> replicas = fleet.replicas();
  if (context.options.mode == bus::RunMode::kLive && replicas.size() > 1) {
    office_.emplace(context, "map", replicas, robot_, steady_clock::now());
  } else if (replicas.front() == robot_) {
    publisher_.speak(1);
  }
  // Replicas write to each other. A replica that stopped reading while it waits would block the others.
  contribution_out_.whileFull([this] { pullSets(); });
  pose_out_.whileFull([this] { pullSets(); });
  for (const std::string& robot : fleet.locatedRobots()) {
    poses_.push_back(std::make_unique<Inlet<v1::Pose, Payload>>(
        context.bus.reader(context.topics.pose, robot), merger_, ends_,
        bus::StreamSpec{"pose " + robot, robot, 1, bus::StreamRole::kInput, streamMode(context.options),
                        false}));
    stream_of_pose_[robot] = poses_.back()->stream();
    const bool is_replica = std::find(replicas.begin(), replicas.end(), robot) != replicas.end();
    if (robot != robot_ && is_replica) {
      listenTo(contributionStream(robot));
      listenTo(poseStream(robot));
    }
    listenTo(correctionStream(robot));
  }
}

void GlobalMergerService::listenTo(const std::string& stream) {
  SetStream& set = sets_[stream];
  ends_.listen(stream, [&set](TimeNs, std::uint64_t samples) {
    set.announced = samples;
    set.announced_at = steady_clock::now();
  });
}

std::vector<bus::Expectation> GlobalMergerService::expectations() const {
  return {contribution_out_.expectation(), pose_out_.expectation()};
}

bool GlobalMergerService::pull() {
  bool any = ends_.poll();
  if (objects_) {
    any |= objects_->pull(status(), [](const v1::Objects& wire, Payload& payload) {
      return orInvalid(adapters::fromWire(wire, payload.emplace<Objects>()));
    }) > 0;
  }
  for (auto& inlet : poses_) {
    any |= inlet->pull(status(), [this, &inlet](const v1::Pose& wire, Payload& payload) {
      if (!pose_term_.accepts(inlet->stream(), wire.term(), wire.header().acquired_ns()))
        return Validity::kIgnored;
      promise(wire);
      return orInvalid(adapters::fromWire(wire, payload.emplace<PoseEstimate>()));
    }) > 0;
  }
  any |= alignments_.pull(status());
  any |= places_.pull(status());
  return pullSets() || any;
}

/// A robot without data for minutes must not delay the others. Each pose lists the last published times of
/// the other robots: they have no poses and no objects between that time and the time of the pose (every
/// frame of objects has a pose).
void GlobalMergerService::promise(const v1::Pose& pose) {
  for (const v1::PublishedPose& other : pose.published()) {
    const auto stream = stream_of_pose_.find(other.robot().to_string());
    if (stream == stream_of_pose_.end()) continue;
    merger_.promise(stream->second, other.last_ns(), pose.header().acquired_ns());
    if (stream->first == robot_ && objects_)
      merger_.promise(objects_->stream(), other.last_ns(), pose.header().acquired_ns());
  }
}

bool GlobalMergerService::pullSets() {
  bool any = false;
  occupancy::Contribution contribution;
  while (contributions_->take(contribution_)) {
    any = true;
    const std::string robot = contribution_.robot().to_string();
    ++sets_[contributionStream(robot)].arrived;
    // Already added when it was made. Live, another process may have made it: an earlier incarnation, or the
    // owner of this robot's name.
    if (robot == robot_ && !replication_) continue;
    if (adapters::fromWire(contribution_, contribution)) {
      add(contribution);
    } else {
      status().dropped();
      status().report(global_merger::contributionRejected(robot));
    }
  }
  occupancy::KeyframePose pose;
  while (keyframe_poses_->take(keyframe_pose_)) {
    any = true;
    const std::string robot = keyframe_pose_.robot().to_string();
    ++sets_[keyframe_pose_.term() == 0 ? poseStream(robot) : correctionStream(robot)].arrived;
    if (adapters::fromWire(keyframe_pose_, pose)) add(pose);
  }
  return any;
}

void GlobalMergerService::add(const occupancy::Contribution& contribution) {
  if (!replica_.add(contribution)) return;
  own_maps_.add(contribution);
  if (replication_) replication_->added(replica_.map().store(), contribution, steady_clock::now());
}

void GlobalMergerService::add(const occupancy::KeyframePose& pose) {
  if (!replica_.add(pose)) return;
  own_maps_.add(pose, replica_);
  if (replication_) replication_->added(replica_.map().store(), pose, steady_clock::now());
}

/// Live: takes what other replicas re-send, and re-sends what they lack.
bool GlobalMergerService::exchange() {
  if (!replication_) return false;
  const bool any = replication_->pull(
      status(), [this](const occupancy::Contribution& contribution) { add(contribution); },
      [this](const occupancy::KeyframePose& pose) { add(pose); });
  replication_->send(replica_.map().store(), steady_clock::now(), status());
  return any;
}

/// Live: waits until all replicas hold the same, so that each saves the same map. Other replicas may not stop
/// at this time, so the wait is short.
void GlobalMergerService::exchangeFinally() {
  if (!replication_) return;
  constexpr std::chrono::milliseconds kSlice{10};
  const auto end = steady_clock::now() + replication_->longestEnd();
  replication_->end();
  while (steady_clock::now() < end && !replication_->isComplete(steady_clock::now())) {
    if (!receiveAndProcess()) context_.bus.wait(kSlice);
  }
}

std::optional<steady_clock::time_point> GlobalMergerService::wakeAt() const {
  if (!replication_) return std::nullopt;
  const auto election = office_ ? office_->wakeAt() : std::nullopt;
  return election ? std::min(*election, replication_->wakeAt()) : replication_->wakeAt();
}

/// Live: the replicas elect the one that publishes the map. Returns whether this has changed.
bool GlobalMergerService::speak() {
  if (!office_ || !office_->update(steady_clock::now())) return false;
  context_.log->info(office_->term() > 0 ? "publishes the map from now on (term {})"
                                         : "another replica publishes the map from now on",
                     office_->term());
  publisher_.speak(office_->term());
  has_new_batches_ = has_new_batches_ || !replica_.map().store().robots().empty();
  return true;
}

/// Receives and processes everything that is available.
bool GlobalMergerService::receiveAndProcess() {
  bool any = pull();
  any |= exchange();
  any |= speak();
  while (merger_.nextBatch(batch_)) {
    process();
    any = true;
  }
  return any;
}

bool GlobalMergerService::spin() {
  bool any = receiveAndProcess();
  if (!contributed_all_ && merger_.finished()) {
    contribution_out_.end(ends_);
    pose_out_.end(ends_);
    contributed_all_ = any = true;
  }
  if (contributed_all_ && !ended_ && setsComplete()) {
    exchangeFinally();
    finishMaps();
    publisher_.update(replica_, batch_.time, true, status());
    saveFinally();
    if (office_) office_->leave(true);
    ended_ = any = true;
  }
  return any;
}

/// Live, samples may have been lost; the exchange replaces them.
bool GlobalMergerService::setsComplete() const {
  constexpr std::chrono::seconds kOnTheWay{1};  // samples that run/end has overtaken
  const auto now = steady_clock::now();
  for (const auto& [stream, set] : sets_) {
    if (stream == contributionStream(robot_) || stream == poseStream(robot_)) continue;
    const bool has_waited = replication_ && set.announced && now - set.announced_at >= kOnTheWay;
    if (!set.complete() && !has_waited) return false;
  }
  return replication_ || (alignments_.complete() && places_.complete());
}

void GlobalMergerService::process() {
  const auto begun = steady_clock::now();
  bool own_frame = false, valid = true;
  for (auto& item : batch_.inputs) {
    if (auto* objects = std::get_if<Objects>(&item.payload)) {
      own_frame = true;
      valid = objects->state == FrameState::kOk;
      ++frames_;
      if (valid) ++usable_frames_;
      waiting_objects_.push_back(std::move(*objects));
    } else if (auto* pose = std::get_if<PoseEstimate>(&item.payload)) {
      replica_.addTrajectory(*pose);
      own_maps_.addTrajectory(*pose, replica_);
      if (pose->robot == robot_) waiting_poses_.push_back(std::move(*pose));
    }
  }
  contribute();
  has_new_batches_ = true;
  if (own_frame) status().processed(steady_clock::now() - begun, valid);
  if (bus::isDeterministic(context_.options.mode)) publisher_.update(replica_, batch_.time, false, status());
}

bool GlobalMergerService::background() {
  if (replica_.correctSome(kCorrectedAtOnce) || own_maps_.correctSome(kCorrectedAtOnce)) return true;
  if (!has_new_batches_) return false;
  has_new_batches_ = false;
  publisher_.update(replica_, batch_.time, false, status(), [this] { pause(); });
  savePeriodically();
  return true;
}

/// Live: the fits of the outlines must not delay frames.
void GlobalMergerService::pause() {
  bus::awaitIdleWindow(context_.bus, idleWindow(), [this] { return receiveAndProcess(); });
}

void GlobalMergerService::contribute() {
  while (!waiting_objects_.empty() && !waiting_poses_.empty()) {
    const Objects& objects = waiting_objects_.front();
    const PoseEstimate& pose = waiting_poses_.front();
    if (objects.acquired_ns < pose.acquired_ns) {
      waiting_objects_.pop_front();
      continue;
    }
    if (pose.acquired_ns < objects.acquired_ns) {
      waiting_poses_.pop_front();
      continue;
    }
    // The frames of a robot whose name another process owns may be those of another robot.
    const bool is_owner = context_.bus.rival().empty();
    if (auto made = is_owner ? maker_.make(objects, pose) : std::nullopt) {
      add(made->contribution);
      add(made->pose);
      adapters::toWire(made->contribution, clock_, own_contribution_);
      adapters::toWire(made->pose, clock_, own_keyframe_pose_);
      contribution_out_.write(own_contribution_, status());
      pose_out_.write(own_keyframe_pose_, status());
    }
    waiting_objects_.pop_front();
    waiting_poses_.pop_front();
  }
  while (waiting_objects_.size() > kMaxWaiting) waiting_objects_.pop_front();
  while (waiting_poses_.size() > kMaxWaiting) waiting_poses_.pop_front();
}

/// Live: a run may end by a power failure, so the map is saved periodically.
void GlobalMergerService::savePeriodically() {
  const auto now = steady_clock::now();
  if (!saves_ || context_.options.out.empty() || now - saved_at_ < kSavePeriod) return;
  saved_at_ = now;
  own_maps_.fit([this] { pause(); });
  saver_.save(replica_, own_maps_, alignments_.latest(), places_.files(), status());
}

void GlobalMergerService::saveFinally() {
  if (!saves_) return;
  const occupancy::ContributionStore& store = replica_.map().store();
  const bool is_live = replication_.has_value();
  // A robot that does not map (ceiling cameras follow its marker) has poses only.
  const bool is_empty = objects_ ? store.contributions() == 0 : store.robots().empty();
  const bool is_blind = objects_ && usable_frames_ == 0;
  lacks_map_ = is_empty && (is_live || (contributed_all_ && is_blind));
  if (is_empty && (is_live || is_blind || !contributed_all_)) {
    status().report(is_blind ? global_merger::noUsableFrame(robot_, frames_) : global_merger::mapEmpty());
    if (is_blind || store.robots().empty()) return;  // otherwise there are paths to save
  }
  alignments_.pull(status());
  places_.pull(status());
  replica_.outlines();
  saver_.save(replica_, own_maps_, alignments_.latest(), places_.files(), status());
}

/// The set is complete: decides what is still undecided.
void GlobalMergerService::finishMaps() {
  replica_.finish();
  own_maps_.finish();
  if (!saves_) return;
  if (context_.options.incarnation > 1 && !context_.options.out.empty())
    status().report(global_merger::trajectoryIncomplete());
  reportMapWarnings(replica_, status());
}

void GlobalMergerService::drain() {
  contribution_out_.end(ends_, ended_ ? "" : "stopped");
  pose_out_.end(ends_, ended_ ? "" : "stopped");
  if (ended_) return;
  pull();
  while (merger_.nextBatch(batch_)) process();
  exchangeFinally();
  finishMaps();
  // Saves before publishing: the map matters most when a fleet is stopped.
  saveFinally();
  if (office_) office_->leave(false);
  publisher_.update(replica_, batch_.time, true, status());
}

std::unique_ptr<bus::Service> makeGlobalMerger(const bus::ServiceContext& context) {
  const auto& o = context.options;
  return std::make_unique<GlobalMergerService>(context, fleet::Fleet::load(o.fleet, o.dataset, o.configs));
}

}  // namespace omnifleet::services
