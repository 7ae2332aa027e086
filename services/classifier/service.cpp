#include "classifier/service.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

std::string ownRobot(const bus::ServiceContext& context, const fleet::Fleet& fleet) {
  return fleet.robot(context.options.robot).name;
}

/// As the fleet file tells them: near enough to say which of the things around is whom.
std::vector<PoseEstimate> startsOf(const fleet::Fleet& fleet) {
  constexpr double kSigma_m = 0.05, kSigma_rad = 0.05;
  std::vector<PoseEstimate> starts;
  for (const auto& robot : fleet.robots) {
    if (!robot.initial_pose) continue;
    PoseEstimate start;
    start.robot = robot.name;
    start.valid = true;
    start.map_from_base = *robot.initial_pose;
    start.covariance.diagonal() << kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad;
    starts.push_back(start);
  }
  return starts;
}

}  // namespace

ClassifierService::ClassifierService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      ends_(context),
      local_maps_(context.bus.reader(context.topics.local_map, context.options.robot), merger_, ends_,
                  {"local_map " + context.options.robot, context.options.robot, 0, bus::StreamRole::kInput,
                   streamMode(context.options)}),
      poses_(context, fleet, merger_, ends_),
      out_(context.bus.writer(context.topics.objects_kept, context.options.robot),
           "objects " + context.options.robot,
           fleet::expectedReaders(fleet, "objects", context.options.robot)),
      classifier_(classifier::Classifier::Options::read(fleet.service("classifier")),
                  ownRobot(context, fleet), fleet.bodies()),
      starts_(context.options.life == 1 ? startsOf(fleet) : std::vector<PoseEstimate>{}) {
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
  if (!starts_.empty()) assumeStarts(local_map.acquired_ns);
  const Objects& objects = classifier_.process(local_map, known);
  adapters::toWire(objects, runClock(context_.options), sample_);
  out_.write(sample_, status());
  tracks_.write(status(), [&](dataset::TracksWriter& tracks) { tracks.write(objects); });
  status().processed(steady_clock::now() - begun, objects.state == FrameState::kOk);
}

void ClassifierService::assumeStarts(TimeNs now_ns) {
  for (PoseEstimate& start : starts_) start.acquired_ns = now_ns;
  classifier_.assume(starts_);
  starts_.clear();
}

void ClassifierService::drain() {
  out_.end(ends_, ended_ ? "" : "stopped");
}

std::unique_ptr<bus::Service> makeClassifier(const bus::ServiceContext& context) {
  const auto& o = context.options;
  return std::make_unique<ClassifierService>(context, fleet::Fleet::load(o.fleet, o.dataset, o.configs));
}

}  // namespace omnifleet::services
