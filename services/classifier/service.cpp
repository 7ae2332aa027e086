#include "classifier/service.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

std::string ownRobot(const bus::ServiceContext& context, const fleet::Fleet& fleet) {
  return fleet.robot(context.options.robot).name;
}

/// Initial poses of the fleet file. Their σ is small enough to identify the robots among the objects.
std::vector<PoseEstimate> initialPosesOf(const fleet::Fleet& fleet) {
  constexpr double kSigma_m = 0.05, kSigma_rad = 0.05;
  std::vector<PoseEstimate> initial_poses;
  for (const auto& robot : fleet.robots) {
    if (!robot.initial_pose) continue;
    PoseEstimate pose;
    pose.robot = robot.name;
    pose.valid = true;
    pose.map_from_base = *robot.initial_pose;
    pose.covariance.diagonal() << kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad;
    initial_poses.push_back(pose);
  }
  return initial_poses;
}

}  // namespace

ClassifierService::ClassifierService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      ends_(context, runClock(context.options, fleet)),
      clock_(runClock(context.options, fleet)),
      local_maps_(context.bus.reader(context.topics.local_map, context.options.robot), merger_, ends_,
                  {"local_map " + context.options.robot, context.options.robot, 0, bus::StreamRole::kInput,
                   streamMode(context.options)}),
      poses_(context, fleet, merger_, ends_),
      out_(context.bus.writer(context.topics.objects_kept, context.options.robot),
           "objects " + context.options.robot,
           fleet::expectedReaders(fleet, "objects", context.options.robot)),
      classifier_(classifier::Classifier::Options::read(fleet.service("classifier")),
                  ownRobot(context, fleet), fleet.bodies()),
      initial_poses_(context.options.incarnation == 1 ? initialPosesOf(fleet) : std::vector<PoseEstimate>{}) {
  if (!context.options.out.empty()) tracks_.open(status(), context.options.out, context.options.robot);
}

bool ClassifierService::pull() {
  bool any = ends_.poll();
  any |= local_maps_.pull(status(), [](const v1::LocalMap& wire, Payload& payload) {
    return orInvalid(adapters::fromWire(wire, payload.emplace<LocalMap>()));
  }) > 0;
  any |= poses_.pull(status());
  return any;
}

bool ClassifierService::spin() {
  bool any = pull();
  while (merger_.nextBatch(batch_)) {
    process();
    any = true;
  }
  if (!ended_ && merger_.finished()) {
    out_.end(ends_);
    ended_ = any = true;
  }
  return any;
}

void ClassifierService::process() {
  const auto begun = steady_clock::now();
  const std::vector<PoseEstimate>& known = poses_.take(batch_.feedback);
  const auto& local_map = std::get<LocalMap>(batch_.inputs.front().payload);
  if (!initial_poses_.empty()) assumeInitialPoses(local_map.acquired_ns);
  const Objects& objects = classifier_.process(local_map, known);
  adapters::toWire(objects, clock_, sample_);
  out_.write(sample_, status());
  tracks_.write(status(), [&](dataset::TracksWriter& tracks) { tracks.write(objects); });
  status().processed(steady_clock::now() - begun, objects.state == FrameState::kOk);
}

void ClassifierService::assumeInitialPoses(TimeNs now_ns) {
  for (PoseEstimate& pose : initial_poses_) pose.acquired_ns = now_ns;
  classifier_.setInitialPoses(initial_poses_);
  initial_poses_.clear();
}

void ClassifierService::drain() {
  out_.end(ends_, ended_ ? "" : "stopped");
}

std::unique_ptr<bus::Service> makeClassifier(const bus::ServiceContext& context) {
  const auto& o = context.options;
  return std::make_unique<ClassifierService>(context, fleet::Fleet::load(o.fleet, o.dataset, o.configs));
}

}  // namespace omnifleet::services
