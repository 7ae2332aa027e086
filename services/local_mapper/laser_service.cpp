#include "local_mapper/laser_service.h"

#include <fmt/format.h>

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

const dataset::LaserSensor& sensorOf(const fleet::Fleet& fleet, const std::string& robot) {
  const auto& laser = fleet.robot(robot).laser;
  if (!laser) throw options::Error("robot '" + robot + "' has no laser");
  return *laser;
}

}  // namespace

laser::Options laserOptions(const fleet::Fleet& fleet) {
  return laser::Options::read(fleet.service("local_mapper").child("laser"));
}

double wheelsMissing_s(const options::Section& section) {
  double missing_s = 3.0;
  section.read("wheels_missing_s", missing_s, {0.0, 3600.0});
  return missing_s;
}

local_mapper::WheelCheck makeWheelCheck(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                                        const std::string& robot) {
  const double missing_s = wheelsMissing_s(fleet.service("local_mapper"));
  return local_mapper::WheelCheck(
      robot, bus::isDeterministic(context.options.mode) ? 0 : static_cast<TimeNs>(1e9 * missing_s));
}

std::vector<Message> scanFaults(FaultRuns& runs, const std::string& robot, const LocalMap& map,
                                const char* fault) {
  Message message;
  if (map.state != FrameState::kOk)
    message = {ErrorCode::kScanRejected, *fault != '\0' ? fault : toString(map.state)};
  return runs.add(fmt::format("scan {} of laser {}", map.sequence, robot), message);
}

Validity takeScan(const v1::LaserScan& wire, LaserInput& scan) {
  scan.sequence = wire.header().sequence_number();
  return orInvalid(adapters::fromWire(wire, scan.row));
}

LaserMapperService::LaserMapperService(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                                       ReadClocks read)
    : context_(context),
      robot_(context.options.robot),
      ends_(context, runClock(context.options, fleet)),
      live_times_(context, fleet, std::move(read)),
      clock_(runClock(context.options, fleet)),
      scans_(context.bus.reader(context.topics.laser, robot_), merger_, ends_,
             {"laser " + robot_, robot_, 0, bus::StreamRole::kInput, streamMode(context.options)}),
      out_(context.bus.writer(context.topics.local_map, robot_), "local_map " + robot_,
           fleet::expectedReaders(fleet, "local_map", robot_)),
      integrator_(makeIntegrator(fleet, fleet.robot(robot_))),
      wheel_check_(makeWheelCheck(context, fleet, robot_)),
      mapper_(sensorOf(fleet, robot_), laserOptions(fleet)) {
  live_times_.follow(scans_, "laser " + robot_);
  if (!fleet.robot(robot_).has_wheels) return;
  wheels_.emplace(context.bus.reader(context.topics.wheels_odometry, robot_), merger_, ends_,
                  bus::StreamSpec{"wheels/odometry " + robot_, robot_, 1, bus::StreamRole::kSide,
                                  streamMode(context.options)});
  live_times_.follow(*wheels_, "wheels/odometry " + robot_);
}

bool LaserMapperService::pull() {
  bool any = ends_.poll();
  if (wheels_) {
    any |= wheels_->pull(status(), [](const v1::WheelOdometry& wire, Payload& payload) {
      return adapters::fromWire(wire, payload.emplace<dataset::WheelRow>());
    }) > 0;
  }
  any |= scans_.pull(status(), [](const v1::LaserScan& wire, Payload& payload) {
    return takeScan(wire, payload.emplace<LaserInput>());
  }) > 0;
  live_times_.report(status());
  return any;
}

bool LaserMapperService::spin() {
  bool any = pull();
  while (merger_.nextBatch(batch_)) {
    process();
    any = true;
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

void LaserMapperService::process() {
  const auto begun = steady_clock::now();
  for (const auto& item : batch_.side) {
    const auto& row = std::get<dataset::WheelRow>(item.payload);
    integrator_.add(row.time_ns, row.left_mps, row.right_mps);
  }
  const LaserInput& scan = std::get<LaserInput>(batch_.inputs.front().payload);
  const Motion wheels = integrator_.motionTo(scan.row.time_ns);
  if (wheels_ && integrator_.isInUse()) {
    const auto message = wheel_check_.add(scan.row.time_ns, wheels.valid, wheels_->times());
    if (message) status().report(*message);
  }
  local_map_ = mapper_.process(scan.row, scan.sequence, wheels);
  local_map_.robot = robot_;
  adapters::toWire(local_map_, clock_, sample_);
  out_.write(sample_, status());
  const bool good = local_map_.state == FrameState::kOk;
  status().processed(steady_clock::now() - begun, good);
  for (const Message& message : scanFaults(faults_, robot_, local_map_, mapper_.fault()))
    status().report(message);
}

}  // namespace omnifleet::services
