#include "local_mapper/front_service.h"

#include <fmt/format.h>

#include "dataset/atomic_file.h"
#include "local_mapper/messages.h"
#include "local_mapper/service.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

const fleet::CameraSpec& frontCamera(const fleet::Fleet& fleet, const std::string& robot) {
  const fleet::CameraSpec* camera = fleet.frontOf(fleet.robot(robot).name);
  if (!camera) throw options::Error("robot '" + robot + "' has no forward camera");
  return *camera;
}

local_mapper::FrontMapper frontMapper(const fleet::CameraSpec& camera, const fleet::Fleet& fleet) {
  try {
    return {lens::Camera(camera.model), frontOptions(fleet)};
  } catch (const options::Error& error) {
    throw options::Error("camera " + camera.id + ": " + error.what());
  }
}

}  // namespace

local_mapper::FrontMapper::Options frontOptions(const fleet::Fleet& fleet) {
  return local_mapper::FrontMapper::Options::read(fleet.service("local_mapper"));
}

FrontMapperService::FrontMapperService(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                                       bool debug_images)
    : context_(context),
      camera_(frontCamera(fleet, context.options.robot)),
      ends_(context, runClock(context.options, fleet)),
      frames_(context, camera_, ends_),
      frame_stream_(merger_.addStream(
          {"camera " + camera_.id, camera_.robot, 0, bus::StreamRole::kInput, streamMode(context.options)})),
      live_times_(context, fleet),
      clock_(runClock(context.options, fleet)),
      out_(context.bus.writer(context.topics.local_map, camera_.robot), "local_map " + camera_.robot,
           fleet::expectedReaders(fleet, "local_map", camera_.robot)),
      integrator_(makeIntegrator(fleet, fleet.robot(camera_.robot))),
      wheel_check_(makeWheelCheck(context, fleet, camera_.robot)),
      mapper_(frontMapper(camera_, fleet)) {
  if (debug_images && !context.options.out.empty()) {
    debug_folder_ = context.options.out + "/debug/" + camera_.robot;
    dataset::makeDirectories(debug_folder_);
  }
  if (camera_.source == fleet::CameraSource::kDevice) live_times_.follow(frames_, "camera " + camera_.id);
  if (!fleet.robot(camera_.robot).has_wheels) return;
  wheels_.emplace(context.bus.reader(context.topics.wheels_odometry, camera_.robot), merger_, ends_,
                  bus::StreamSpec{"wheels/odometry " + camera_.robot, camera_.robot, 1,
                                  bus::StreamRole::kSide, streamMode(context.options)});
  live_times_.follow(*wheels_, "wheels/odometry " + camera_.robot);
}

bool FrontMapperService::pull() {
  bool any = ends_.poll();
  if (wheels_) {
    any |= wheels_->pull(status(), [](const v1::WheelOdometry& wire, Payload& payload) {
      return adapters::fromWire(wire, payload.emplace<dataset::WheelRow>());
    }) > 0;
  }
  if (merger_.wants(frame_stream_)) {
    if (const auto frame = frames_.take(status())) {
      merger_.push(frame_stream_, frame->header.acquired_ns, *frame);
      any = true;
    }
  }
  if (frames_.ended()) merger_.end(frame_stream_, 0);
  live_times_.report(status());
  return any;
}

bool FrontMapperService::spin() {
  bool any = pull();
  while (merger_.nextBatch(batch_)) {
    for (const auto& item : batch_.side) {
      const auto& row = std::get<dataset::WheelRow>(item.payload);
      integrator_.add(row.time_ns, row.left_mps, row.right_mps);
    }
    for (const auto& item : batch_.inputs) {
      if (const auto* view = std::get_if<bus::FrameView>(&item.payload)) process(*view);
    }
    any = true;
    pull();
  }
  if (!ended_ && merger_.finished()) {
    if (wheels_ && integrator_.isInUse())
      if (const auto message = wheel_check_.finish(wheels_->times())) status().report(*message);
    for (const Message& message : faults_.end()) status().report(message);
    out_.end(ends_);
    ended_ = any = true;
  }
  return any;
}

void FrontMapperService::process(const bus::FrameView& view) {
  const auto begun = steady_clock::now();
  const local_mapper::Frame frame{view.header.acquired_ns, view.header.sequence, view.header.state,
                                  asMat(view)};
  const Motion wheels = integrator_.motionTo(frame.acquired_ns);
  if (wheels_ && integrator_.isInUse()) {
    const auto message = wheel_check_.add(frame.acquired_ns, wheels.valid, wheels_->times());
    if (message) status().report(*message);
  }
  local_map_ = mapper_.process(frame, wheels);
  local_map_.robot = camera_.robot;
  if (!debug_folder_.empty() && local_map_.state == FrameState::kOk) {
    const std::string prefix = fmt::format("{}/{:06d}", debug_folder_, local_map_.sequence);
    for (const std::string& problem : local_mapper::saveDistancePictures(mapper_, frame.image, prefix))
      status().report(fileWriteFailed(problem));
  }
  if (!frames_.release(status())) {
    local_map_.state = FrameState::kTorn;
    local_map_.scan = {};
    local_map_.boundary.clear();
  }
  adapters::toWire(local_map_, clock_, sample_);
  out_.write(sample_, status());
  status().processed(steady_clock::now() - begun, local_map_.state == FrameState::kOk);
  reportFault();
}

void FrontMapperService::reportFault() {
  if (mapper_.gap_s() > 0.0)
    status().report(local_mapper::frameGap(camera_.id, mapper_.gap_s(), local_map_.sequence));
  const Message fault =
      local_map_.state == FrameState::kOk ? mapper_.fault() : local_mapper::frameRejected(local_map_.state);
  const std::string where = fault.code == ErrorCode::kNone
                                ? std::string()
                                : fmt::format("frame {} of camera {}", local_map_.sequence, camera_.id);
  for (const Message& message : faults_.add(where, fault)) status().report(message);
}

}  // namespace omnifleet::services
