#include "global_merger/service.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "global_merger/map_doubts.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::seconds kSavePeriod{10};

constexpr std::size_t kCorrectedAtOnce = 8;  // contributions: 2 ms
constexpr std::size_t kMaxWaiting = 64;      // frames whose other half may still come (live)

std::string contributionStream(const std::string& robot) {
  return "map/contribution " + robot;
}
std::string poseStream(const std::string& robot) {
  return "map/keyframe_pose " + robot;
}
std::string correctionStream(const std::string& robot) {
  return "map/keyframe_pose localizer " + robot;
}

}  // namespace

GlobalMergerService::GlobalMergerService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      robot_(fleet.robot(context.options.robot).name),
      speaks_(fleet.locatedRobots().front() == robot_),
      ends_(context),
      objects_(context.bus.reader(context.topics.objects, robot_), merger_, ends_,
               {"objects " + robot_, robot_, 0, bus::StreamRole::kInput, streamMode(context.options)}),
      contributions_(context.bus.reader(context.topics.map_contribution)),
      keyframe_poses_(context.bus.reader(context.topics.map_keyframe_pose)),
      contribution_out_(context.bus.writer(context.topics.map_contribution, robot_),
                        contributionStream(robot_),
                        fleet::expectedReaders(fleet, "map/contribution", robot_)),
      pose_out_(context.bus.writer(context.topics.map_keyframe_pose, robot_), poseStream(robot_),
                fleet::expectedReaders(fleet, "map/keyframe_pose", robot_)),
      publisher_(context, fleet.name, robot_, speaks_),
      maker_(global_merger::KeyframeOptions::read(fleet.service("global_merger").child("keyframes"))),
      replica_(global_merger::MergerOptions::read(fleet.service("global_merger").child("outlines")),
               occupancy::OccupancyOptions::read(fleet.service("global_merger").child("occupancy")),
               fleet.bodies()) {
  replica_.setLenses(fleet.lensSpreads());
  // Replicas write to one another: one that stopped reading while it waits would keep the others waiting.
  if (context.options.mode == bus::RunMode::kLive) replica_.correctLater();
  contribution_out_.whileFull([this] { pullSets(); });
  pose_out_.whileFull([this] { pullSets(); });
  for (const std::string& robot : fleet.locatedRobots()) {
    poses_.push_back(std::make_unique<Inlet<v1::Pose, Payload>>(
        context.bus.reader(context.topics.pose, robot), merger_, ends_,
        bus::StreamSpec{"pose " + robot, robot, 1, bus::StreamRole::kInput, streamMode(context.options),
                        false}));
    stream_of_pose_[robot] = poses_.back()->stream();
    if (robot != robot_) {
      listenTo(contributionStream(robot));
      listenTo(poseStream(robot));
    }
    listenTo(correctionStream(robot));
  }
}

void GlobalMergerService::listenTo(const std::string& stream) {
  SetStream& set = sets_[stream];
  ends_.listen(stream, [&set](TimeNs, std::uint64_t samples) { set.announced = samples; });
}

std::vector<bus::Expectation> GlobalMergerService::expectations() const {
  return {contribution_out_.expectation(), pose_out_.expectation()};
}

bool GlobalMergerService::pull() {
  bool any = ends_.poll();
  any |= objects_.pull(status(), [](const v1::Objects& wire, Payload& payload) {
    return orInvalid(adapters::fromWire(wire, payload.emplace<Objects>()));
  }) > 0;
  for (auto& inlet : poses_) {
    any |= inlet->pull(status(), [this](const v1::Pose& wire, Payload& payload) {
      promise(wire);
      return orInvalid(adapters::fromWire(wire, payload.emplace<PoseEstimate>()));
    }) > 0;
  }
  return pullSets() || any;
}

/// A robot that has nothing to tell for minutes holds nobody up: neither poses nor objects of it will come
/// that a pose of another one says are not to come (every frame of objects has a pose).
void GlobalMergerService::promise(const v1::Pose& pose) {
  for (const v1::PublishedPose& other : pose.published()) {
    const auto stream = stream_of_pose_.find(other.robot().to_string());
    if (stream == stream_of_pose_.end()) continue;
    merger_.promise(stream->second, other.last_ns(), pose.header().acquired_ns());
    if (stream->first == robot_)
      merger_.promise(objects_.stream(), other.last_ns(), pose.header().acquired_ns());
  }
}

bool GlobalMergerService::pullSets() {
  bool any = false;
  occupancy::Contribution contribution;
  while (contributions_->take(contribution_)) {
    any = true;
    const std::string robot = contribution_.robot().to_string();
    ++sets_[contributionStream(robot)].arrived;
    if (robot == robot_) continue;  // has it since it made it
    if (adapters::fromWire(contribution_, contribution)) {
      replica_.add(contribution);
    } else {
      status().dropped();
      status().error("a contribution of " + robot + " was rejected: not consistent");
    }
  }
  occupancy::KeyframePose pose;
  while (keyframe_poses_->take(keyframe_pose_)) {
    any = true;
    const std::string robot = keyframe_pose_.robot().to_string();
    ++sets_[keyframe_pose_.term() == 0 ? poseStream(robot) : correctionStream(robot)].arrived;
    if (adapters::fromWire(keyframe_pose_, pose)) replica_.add(pose);
  }
  return any;
}

/// All that has come.
bool GlobalMergerService::takeIn() {
  bool any = pull();
  while (merger_.nextBatch(batch_)) {
    process();
    any = true;
  }
  return any;
}

bool GlobalMergerService::spin() {
  bool any = takeIn();
  if (!contributed_all_ && merger_.finished()) {
    contribution_out_.end(ends_);
    pose_out_.end(ends_);
    contributed_all_ = any = true;
  }
  if (contributed_all_ && !ended_ && setsComplete()) {
    replica_.finish();
    tellDoubts();
    publisher_.update(replica_, batch_.time, true, status());
    save();
    ended_ = any = true;
  }
  return any;
}

bool GlobalMergerService::setsComplete() const {
  for (const auto& [stream, set] : sets_) {
    if (stream == contributionStream(robot_) || stream == poseStream(robot_)) continue;
    if (!set.complete()) return false;
  }
  return true;
}

void GlobalMergerService::process() {
  const auto begun = steady_clock::now();
  bool own_frame = false, valid = true;
  for (auto& item : batch_.inputs) {
    if (auto* objects = std::get_if<Objects>(&item.payload)) {
      own_frame = true;
      valid = objects->state == FrameState::kOk;
      waiting_objects_.push_back(std::move(*objects));
    } else if (auto* pose = std::get_if<PoseEstimate>(&item.payload)) {
      replica_.addTrajectory(*pose);
      if (pose->robot == robot_) waiting_poses_.push_back(std::move(*pose));
    }
  }
  contribute();
  news_ = true;
  if (own_frame) status().processed(steady_clock::now() - begun, valid);
  if (bus::isDeterministic(context_.options.mode)) publisher_.update(replica_, batch_.time, false, status());
}

bool GlobalMergerService::background() {
  if (replica_.correctSome(kCorrectedAtOnce)) return true;
  if (!news_) return false;
  news_ = false;
  publisher_.update(replica_, batch_.time, false, status(), [this] { pause(); });
  saveNowAndThen();
  return true;
}

/// Live, the fits of the outlines hold no frame up.
void GlobalMergerService::pause() {
  bus::awaitLull(context_.bus, lull(), [this] { return takeIn(); });
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
    if (auto made = maker_.make(objects, pose)) {
      replica_.add(made->contribution);
      replica_.add(made->pose);
      adapters::toWire(made->contribution, runClock(context_.options), own_contribution_);
      adapters::toWire(made->pose, runClock(context_.options), own_keyframe_pose_);
      contribution_out_.write(own_contribution_, status());
      pose_out_.write(own_keyframe_pose_, status());
    }
    waiting_objects_.pop_front();
    waiting_poses_.pop_front();
  }
  while (waiting_objects_.size() > kMaxWaiting) waiting_objects_.pop_front();
  while (waiting_poses_.size() > kMaxWaiting) waiting_poses_.pop_front();
}

/// Live, a run may end by a power cut: what was mapped until a little before is on the disk.
void GlobalMergerService::saveNowAndThen() {
  const auto now = steady_clock::now();
  if (now - saved_at_ < kSavePeriod) return;
  saved_at_ = now;
  save(true);
  saved_ = false;
}

void GlobalMergerService::save(bool as_fitted) {
  if (saved_ || !speaks_ || context_.options.out.empty()) return;
  saved_ = true;
  save_failed_ = false;
  const std::string& out = context_.options.out;
  const std::vector<std::string> problems = as_fitted ? replica_.saveAsFitted(out) : replica_.save(out);
  if (problems.empty()) return;
  save_failed_ = true;
  std::string files;
  for (const std::string& problem : problems) {
    status().error(problem, true);
    const std::string path = problem.substr(0, problem.find(": "));
    files += (files.empty() ? "" : ", ") + std::filesystem::path(path).filename().string();
  }
  status().error(
      "not saved: " + files + " (" + problems.front().substr(problems.front().rfind(": ") + 2) + ")", true);
}

namespace {

/// Places to be told, the first of them one by one.
class Places {
 public:
  void add(const Eigen::Vector2d& at_m) {
    if (count_++ < kNamed)
      named_ += fmt::format("{}({:.2f}, {:.2f})", count_ > 1 ? ", " : "", at_m.x(), at_m.y());
  }
  bool any() const { return count_ > 0; }
  std::size_t count() const { return count_; }
  std::string text() const {
    return named_ + (count_ > kNamed ? fmt::format(" and {} more", count_ - kNamed) : "") + " m";
  }

 private:
  static constexpr std::size_t kNamed = 12;
  std::string named_;
  std::size_t count_ = 0;
};

}  // namespace

void GlobalMergerService::tellDoubts() {
  if (!speaks_) return;
  if (context_.options.life > 1 && !context_.options.out.empty())
    status().error(
        "trajectories/ and covariances/ begin where this merger took the place of one that died; what was "
        "driven "
        "before is in the map alone");
  const std::size_t unmapped =
      tellUnmapped(global_merger::Unmapped::Why::kNoShape, "the views do not agree on what") +
      tellUnmapped(global_merger::Unmapped::Why::kFloorSeen,
                   "the floor was seen there, too (gone, or hardly to be told from the floor)") +
      tellUnmapped(global_merger::Unmapped::Why::kFlat,
                   "they are no higher than marks on the floor, or low and seldom seen") +
      tellUnmapped(
          global_merger::Unmapped::Why::kFloats,
          "they have a height, but mostly the floor was seen there (the tops of things whose sides look like "
          "the floor, half a metre around)");
  const std::vector<dataset::MapObject>& objects = replica_.lastOutlines();
  Places slivers, bare, faint, unclear;
  for (const dataset::MapObject& object : objects)
    if (global_merger::isSliver(object.outline_m)) slivers.add(centroid(object.outline_m));
  for (const Eigen::Vector2d& at_m : global_merger::bareCells(replica_.map().grid(objects), objects))
    bare.add(at_m);
  for (const Eigen::Vector2d& at_m : replica_.faint()) faint.add(at_m);
  for (const Eigen::Vector2d& at_m : replica_.unclear()) unclear.add(at_m);
  if (faint.any())
    status().error(
        "in the map, but hardly to be told from the floor, which was seen there, too; the outline may be "
        "off: " +
        faint.text());
  if (unclear.any())
    status().error(
        "in the map by views that do not agree, or hardly ever show them by themselves and do not quite "
        "agree; place and outline may be off: " +
        unclear.text());
  if (slivers.any())
    status().error(
        "boards, or dark sides of things that else look like the floor, of which the map shows no more: " +
        slivers.text());
  if (bare.any())
    status().error(
        "occupied, but without an outline (hardly seen, or run together with what is beside it): " +
        bare.text());
  // The last line is all that who follows the status sees.
  if (unmapped + slivers.count() + bare.count() + faint.count() + unclear.count() > 0)
    status().error(
        fmt::format("the map may show too little: {} seen but not in it, {} but thin, {} without an outline, "
                    "{} hardly to be told from the floor, {} seen unclearly; where and why: "
                    "the lines before this one in the log",
                    unmapped, slivers.count(), bare.count(), faint.count(), unclear.count()));
}

/// Returns how many.
std::size_t GlobalMergerService::tellUnmapped(global_merger::Unmapped::Why why, const char* reason) {
  Places places;
  for (const global_merger::Unmapped& unmapped : replica_.unmapped())
    if (unmapped.why == why) places.add(unmapped.at_m);
  if (places.any()) status().error(fmt::format("seen but not in the map, for {}: {}", reason, places.text()));
  return places.count();
}

void GlobalMergerService::drain() {
  contribution_out_.end(ends_, ended_ ? "" : "stopped");
  pose_out_.end(ends_, ended_ ? "" : "stopped");
  if (ended_) return;
  pull();
  while (merger_.nextBatch(batch_)) process();
  replica_.finish();
  tellDoubts();
  // Saved before it is told: whoever stops a fleet wants its map above all.
  if (replica_.map().store().robots().empty()) {
    status().error("nothing was mapped, so no map is saved");
  } else {
    save();
  }
  publisher_.update(replica_, batch_.time, true, status());
}

std::unique_ptr<bus::Service> makeGlobalMerger(const bus::ServiceContext& context) {
  const auto& o = context.options;
  return std::make_unique<GlobalMergerService>(context, fleet::Fleet::load(o.fleet, o.dataset, o.configs));
}

}  // namespace omnifleet::services
