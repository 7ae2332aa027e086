#include "local_mapper/service.h"

#include <fmt/format.h>

#include <algorithm>

#include "dataset/atomic_file.h"
#include "laser/join.h"
#include "local_mapper/front_service.h"
#include "local_mapper/messages.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr int kEnclosedFrames = 10;   // frames with hardly any floor, after which this is reported
constexpr double kFloorOnly_m = 0.5;  // metres with only floor in view, after which this is reported
constexpr double kLitBeyond = 0.5;    // share of lit pixels where the lens has no image
constexpr double kLittleFloor = 0.2;  // share of its depth, below which hardly any floor is visible

const fleet::CameraSpec& fisheye(const fleet::Fleet& fleet, const std::string& robot) {
  const fleet::CameraSpec* camera = fleet.fisheyeOf(fleet.robot(robot).name);
  if (!camera) throw options::Error("robot '" + robot + "' has no fisheye camera");
  return *camera;
}

double laserAge(const fleet::Fleet& fleet) {
  double age_s = 0.02;
  fleet.service("local_mapper").read("laser_age_s", age_s, {0.0, 1.0});
  return age_s;
}

/// Options of one robot's mapper: whether the texture of the floor measures its motion.
local_mapper::Options robotOptions(const fleet::Fleet& fleet, const fleet::RobotSpec& robot) {
  local_mapper::Options o = fisheyeOptions(fleet);
  o.floor_motion.is_optional = o.floor_motion.use == "auto";
  o.floor_motion.use = o.floor_motion.isUsed(robot.has_wheels) ? "always" : "never";
  return o;
}

local_mapper::LocalMapper makeMapper(const fleet::CameraSpec& camera, const local_mapper::Options& options) {
  try {
    return {lens::Camera(camera.model), options};
  } catch (const options::Error& error) {
    throw options::Error("camera " + camera.id + ": " + error.what());
  }
}

}  // namespace

local_mapper::Options fisheyeOptions(const fleet::Fleet& fleet) {
  const options::Section section = fleet.service("local_mapper");
  for (const char* key : {"wheels", "laser", "laser_age_s", "wheels_missing_s", "method", "distance_vector",
                          "appearance", "image_circle"})
    section.has(key);
  return local_mapper::Options::read(section);
}

motion::WheelIntegrator makeIntegrator(const fleet::Fleet& fleet, const fleet::RobotSpec& robot) {
  const auto options = motion::WheelIntegrator::Options::read(fleet.service("local_mapper").child("wheels"));
  return robot.has_wheels && options.use ? motion::WheelIntegrator(robot.body.wheel_separation_m, options)
                                         : motion::WheelIntegrator();
}

LocalMapperService::LocalMapperService(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                                       bool debug_images)
    : context_(context),
      camera_(fisheye(fleet, context.options.robot)),
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
      mapper_(makeMapper(camera_, robotOptions(fleet, fleet.robot(camera_.robot)))),
      lens_check_(camera_.model, local_mapper::ImageCircleOptions::read(
                                     fleet.service("local_mapper").child("image_circle"))),
      laser_age_ns_(static_cast<TimeNs>(1e9 * laserAge(fleet))) {
  const auto appearance =
      local_mapper::AppearanceOptions::read(fleet.service("local_mapper").child("appearance"));
  if (appearance.use) {
    try {
      appearance_.emplace(lens::Camera(camera_.model), appearance);
    } catch (const options::Error& error) {
      context_.log->warn("camera {}: no panorama, so no places and no visual compass: {}", camera_.id,
                         error.what());
    }
  }
  if (const auto& sensor = fleet.robot(camera_.robot).laser) {
    laser_.emplace(*sensor, laserOptions(fleet));
    scans_.emplace(context.bus.reader(context.topics.laser, camera_.robot), merger_, ends_,
                   bus::StreamSpec{"laser " + camera_.robot, camera_.robot, 2, bus::StreamRole::kInput,
                                   streamMode(context.options), false});
    live_times_.follow(*scans_, "laser " + camera_.robot);
    scan_check_.emplace("laser " + camera_.robot, "camera " + camera_.id,
                        !bus::isDeterministic(context.options.mode));
  }
  if (camera_.source == fleet::CameraSource::kDevice) live_times_.follow(frames_, "camera " + camera_.id);
  if (fleet.robot(camera_.robot).has_wheels) {
    wheels_.emplace(context.bus.reader(context.topics.wheels_odometry, camera_.robot), merger_, ends_,
                    bus::StreamSpec{"wheels/odometry " + camera_.robot, camera_.robot, 1,
                                    bus::StreamRole::kSide, streamMode(context.options)});
    live_times_.follow(*wheels_, "wheels/odometry " + camera_.robot);
  }
  if (debug_images && !context.options.out.empty()) {
    debug_folder_ = context.options.out + "/debug/" + camera_.robot;
    dataset::makeDirectories(debug_folder_);
  }
}

bool LocalMapperService::pull() {
  bool any = ends_.poll();
  if (wheels_) {
    any |= wheels_->pull(status(), [](const v1::WheelOdometry& wire, Payload& payload) {
      return adapters::fromWire(wire, payload.emplace<dataset::WheelRow>());
    }) > 0;
  }
  if (scans_) {
    any |= scans_->pull(status(), [](const v1::LaserScan& wire, Payload& payload) {
      return takeScan(wire, payload.emplace<LaserInput>());
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

bool LocalMapperService::spin() {
  bool any = pull();
  while (merger_.nextBatch(batch_)) {
    takeSideInputs();
    for (const auto& item : batch_.inputs) {
      if (const auto* view = std::get_if<bus::FrameView>(&item.payload)) process(*view);
    }
    any = true;
    pull();
  }
  if (!ended_ && merger_.finished()) {
    if (wheels_ && integrator_.isInUse())
      if (const auto message = wheel_check_.finish(wheels_->times())) status().report(*message);
    reportUndecided(true);
    if (scan_check_)
      if (const auto message = scan_check_->finish()) status().report(*message);
    for (FaultRuns* runs : {&faults_, &scan_faults_})
      for (const Message& message : runs->end()) status().report(message);
    out_.end(ends_);
    ended_ = any = true;
    if (rejected_points_ > 0)
      context_.log->info(
          "camera {}: {} points rejected, they lie beyond the lens' image of the floor (Choi eq. 7: r >= F)",
          camera_.id, rejected_points_);
  }
  // Later messages replace it in the status. They are in the log.
  if (lens_problem_) status().update(*lens_problem_, true);
  return any;
}

/// Takes what arrived beside the frames: wheel rows, and the scan of this time.
void LocalMapperService::takeSideInputs() {
  for (const auto& item : batch_.side) {
    const auto& row = std::get<dataset::WheelRow>(item.payload);
    integrator_.add(row.time_ns, row.left_mps, row.right_mps);
  }
  for (const auto& item : batch_.inputs) {
    if (const auto* scan = std::get_if<LaserInput>(&item.payload)) scan_ = *scan;
  }
}

void LocalMapperService::joinLaser() {
  const LocalMap& by_laser = laser_->process(scan_->row, scan_->sequence, {});
  for (const Message& message : scanFaults(scan_faults_, camera_.robot, by_laser, laser_->fault()))
    status().report(message);
  laser::join(by_laser, local_map_.scan);
}

void LocalMapperService::process(const bus::FrameView& view) {
  const auto begun = steady_clock::now();
  const cv::Mat image = asMat(view);
  const local_mapper::Frame frame{view.header.acquired_ns, view.header.sequence, view.header.state, image};
  const Motion wheels = integrator_.motionTo(frame.acquired_ns);
  if (wheels_ && integrator_.isInUse()) {
    const auto message = wheel_check_.add(frame.acquired_ns, wheels.valid, wheels_->times());
    if (message) status().report(*message);
  }
  if (scan_check_)
    if (const auto message = scan_check_->addFrame(frame.acquired_ns, scans_->times()))
      status().report(*message);
  local_map_ = mapper_.process(frame, wheels);
  local_map_.robot = camera_.robot;
  if (scan_ && local_map_.state == FrameState::kOk && frame.acquired_ns - scan_->row.time_ns <= laser_age_ns_)
    joinLaser();
  addAppearance(frame);
  rejected_points_ += mapper_.rejectedPoints();
  reportLens(image);
  reportOcclusion();
  if (local_map_.state == FrameState::kOk) {
    undecided_.take(local_map_.motion, mapper_.undecided(), local_map_.objects);
    reportUndecided(false);
  }
  const bool is_enclosed = local_map_.state == FrameState::kOk && mapper_.freeShare() < kLittleFloor;
  enclosed_frames_ = is_enclosed ? enclosed_frames_ + 1 : 0;
  if (enclosed_frames_ == kEnclosedFrames) {
    status().report(local_mapper::floorHidden(camera_.id, camera_.model.self_mask_radius_px));
  }
  if (!debug_folder_.empty() && local_map_.state == FrameState::kOk) saveDebugImages(image);
  if (!frames_.release(status())) {
    local_map_.state = FrameState::kTorn;
    local_map_.objects.clear();
    local_map_.scan = {};
    local_map_.boundary.clear();
    local_map_.floor_motion = {};
    if (appearance_) local_map_.appearance = appearance_->skip();
  }
  adapters::toWire(local_map_, clock_, sample_);
  out_.write(sample_, status());
  status().processed(steady_clock::now() - begun, local_map_.state == FrameState::kOk);
  reportFault();
}

void LocalMapperService::addAppearance(const local_mapper::Frame& frame) {
  if (!appearance_) return;
  local_map_.appearance = local_map_.state == FrameState::kOk
                              ? appearance_->process(frame.acquired_ns, frame.image, local_map_.motion)
                              : appearance_->skip();
}

void LocalMapperService::reportFault() {
  if (mapper_.gap_s() > 0.0)
    status().report(local_mapper::frameGap(camera_.id, mapper_.gap_s(), local_map_.sequence));
  std::string where;
  Message fault;
  if (local_map_.state != FrameState::kOk) {
    where = fmt::format("frame {} of camera {}", local_map_.sequence, camera_.id);
    const local_mapper::FrameFault& found = mapper_.fault();
    fault = found.code != ErrorCode::kNone ? Message{found.code, found.text}
                                           : local_mapper::frameRejected(local_map_.state);
    if (isByLens(fault.code)) fault = {};
  }
  for (const Message& message : faults_.add(where, fault)) status().report(message);
}

/// Reports the first region at once, the following ones together: a floor with a strong pattern has many.
void LocalMapperService::reportUndecided(bool ended) {
  for (const Eigen::Vector2d& at_m : undecided_.toReport(ended))
    unreported_.emplace_back(local_map_.sequence, at_m);
  ++frames_since_report_;
  if (unreported_.empty() || (!ended && frames_since_report_ < kReportEvery)) return;
  status().report(local_mapper::undecidedRegions(camera_.id, unreported_));
  unreported_.clear();
  frames_since_report_ = 0;
}

/// Reports that the image contradicts the lens of its sensor.yaml. Also examines frames that were rejected as
/// dark or occluded: a wrong lens takes the dark rim around the image for a part of the view.
void LocalMapperService::reportLens(const cv::Mat& image) {
  if (lens_problem_) return;
  if (mapper_.litBeyondLens() >= kLitBeyond) {
    lens_problem_ = local_mapper::lensMismatch(camera_.id, mapper_.litBeyondLens(), camera_.model);
  } else if (local_map_.state == FrameState::kOk || local_map_.state == FrameState::kDark) {
    const auto verdict = lens_check_.examine(image);
    if (!verdict) return;
    if (verdict->contradiction == local_mapper::Contradiction::kNone) {
      context_.log->info(local_mapper::imageEnd(camera_.id, *verdict));
      if (!verdict->states_view) unstated_view_deg_ = verdict->view_deg;
      return;
    }
    lens_problem_ = local_mapper::lensContradicted(camera_.id, *verdict, camera_.model);
  }
  if (!lens_problem_) return;
  status().report(*lens_problem_, true);
  if (local_map_.state != FrameState::kOk && mapper_.fault().code == ErrorCode::kNone)
    hidden_by_lens_ = codeOf(local_map_.state);
}

/// Is the problem a consequence of the wrong lens? Its message would mislead.
bool LocalMapperService::isByLens(ErrorCode code) const {
  return lens_problem_ &&
         (code == ErrorCode::kLensOccluded || code == ErrorCode::kFloorOnly || code == hidden_by_lens_);
}

void LocalMapperService::reportOcclusion() {
  const double share = mapper_.occludedShare();
  if (share > 0.0 && share != reported_occlusion_ && !isByLens(ErrorCode::kLensOccluded))
    status().report(
        local_mapper::lensPartlyOccluded(camera_.id, share, local_map_.sequence, unstated_view_deg_));
  if (share == 0.0 && reported_occlusion_ > 0.0 && !isByLens(ErrorCode::kLensOccluded))
    context_.log->info("camera {}: lens no longer occluded from frame {} on", camera_.id,
                       local_map_.sequence);
  reported_occlusion_ = share;
  if (mapper_.bare_m() > kFloorOnly_m && !reported_bare_ && !isByLens(ErrorCode::kFloorOnly)) {
    status().report(local_mapper::floorOnly(camera_.id, mapper_.bare_m()));
    reported_bare_ = true;
  }
}

void LocalMapperService::saveDebugImages(const cv::Mat& image) {
  const auto pictures = local_mapper::DebugImages::render(mapper_, local_map_, image);
  for (const std::string& problem :
       pictures.save(fmt::format("{}/{:06d}", debug_folder_, local_map_.sequence))) {
    status().report(fileWriteFailed(problem));
  }
}

std::unique_ptr<bus::Service> makeLocalMapper(const bus::ServiceContext& context) {
  const auto& o = context.options;
  const fleet::Fleet fleet = fleet::Fleet::load(o.fleet, o.dataset, o.configs);
  const fleet::CameraSpec* camera = fleet.mapCameraOf(o.robot);
  if (!camera && fleet.robot(o.robot).laser) return std::make_unique<LaserMapperService>(context, fleet);
  if (camera && camera->role == fleet::CameraRole::kFront)
    return std::make_unique<FrontMapperService>(context, fleet, o.debug_images);
  return std::make_unique<LocalMapperService>(context, fleet, o.debug_images);
}

}  // namespace omnifleet::services
