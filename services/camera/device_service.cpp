#include "camera/device_service.h"

#include "camera/messages.h"
#include "common/messages.h"

namespace omnifleet::services {
namespace {

constexpr auto kSlotWait = std::chrono::microseconds(500);
constexpr auto kCheckPeriod = std::chrono::milliseconds(250);
constexpr std::chrono::seconds kBackShown{5};  // how long the status shows that a camera is back
constexpr int kWrongSizes = 10;                // frames, after which the device is opened again

std::size_t bytesOf(const fleet::CameraSpec& camera) {
  return static_cast<std::size_t>(camera.model.image_width_px) * camera.model.image_height_px * 3;
}

double secondsOf(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

CameraOptions CameraOptions::read(const options::Section& section) {
  CameraOptions o;
  o.device = dataset::LiveCameraOptions::read(section.child("device"));
  section.read("clock_jump_s", o.clock_jump_s, {0.001, 3600.0});
  section.finish();
  return o;
}

DeviceCameraService::DeviceCameraService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : DeviceCameraService(
          context, fleet,
          dataset::makeCaptureDevice(fleet.camera(context.options.camera).path,
                                     {fleet.camera(context.options.camera).model.image_width_px,
                                      fleet.camera(context.options.camera).model.image_height_px}),
          readHostClocks) {}

DeviceCameraService::DeviceCameraService(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                                         std::unique_ptr<dataset::CaptureDevice> device, ReadClocks read)
    : context_(context),
      camera_(fleet.camera(context.options.camera)),
      options_(CameraOptions::read(fleet.service("camera"))),
      clock_(context.options.out, std::move(read)),
      clock_watch_(clock_.clock(), options_.clockJump_ns()),
      writer_(context.bus.frameWriter(camera_.id, bytesOf(camera_))),
      preview_(context, camera_.id),
      ends_(context),
      device_(
          std::move(device), options_.device, [clock = clock_.clock()] { return clock.now(); },
          [&bus = context.bus] { bus.wake(); }) {
  if (context.options.record)
    recorder_.open(status(), context.options.out + "/recording", camera_.id, camera_.model);
  header_.clock = bus::ClockId::kSystem;
}

std::vector<bus::Expectation> DeviceCameraService::expectations() const {
  return {{"a reader of camera " + camera_.id, [this] { return writer_->matched() >= 1; }}};
}

bool DeviceCameraService::spin() {
  wake_at_ = Clock::now() + kCheckPeriod;
  is_pending_ = device_.take(frame_) || is_pending_;
  checkDevice();
  return is_pending_ && publish();
}

/// Reports a device or a clock that fails. The report of a lost camera is repeated, because others replace it
/// in the status.
void DeviceCameraService::checkDevice() {
  const auto now = Clock::now();
  if (const TimeNs jump_ns = clock_watch_.check(); jump_ns != 0)
    status().report(cameraClockJump(camera_.id, jump_ns));
  if (const auto loss = device_.loss(now)) {
    const Message message =
        cameraLost(camera_.id, secondsOf(now - loss->since), loss->reason, options_.device.retry_longest_s);
    lost_since_ ? status().update(message, true) : status().report(message, true);
    lost_since_ = loss->since;
    back_since_.reset();
  } else if (lost_since_ && is_pending_) {
    status().clearError();
    status().report(cameraBack(camera_.id, secondsOf(now - *lost_since_)));
    lost_since_.reset();
    back_since_ = now;
  } else if (back_since_ && now - *back_since_ > kBackShown) {
    status().clearError();
    back_since_.reset();
  }
}

bool DeviceCameraService::publish() {
  const auto begun = Clock::now();
  header_.width_px = camera_.model.image_width_px;
  header_.height_px = camera_.model.image_height_px;
  header_.channels = 3;
  std::uint8_t* loan = writer_->begin(header_);
  if (!loan) {
    wake_at_ = begun + kSlotWait;
    return false;
  }
  is_pending_ = false;
  cv::Mat image(header_.height_px, header_.width_px, CV_8UC3, loan);
  dataset::FrameInfo info{frame_.time_ns, frame_.sequence, FrameState::kOk, {}, camera_.path};
  dataset::FrameSize size{header_.width_px, header_.height_px};
  info.state = dataset::copyFrame(frame_.image, dataset::Colour::kBgr, size, image, info.fault);
  checkSize(info);
  header_.acquired_ns = info.time_ns;
  header_.sequence = info.sequence;
  header_.state = info.state;
  if (info.state == FrameState::kOk) preview_.offer(info.time_ns, image, status());
  recorder_.write(status(), [&](dataset::ImageStreamWriter& recorder) {
    info.state == FrameState::kOk ? recorder.write(info.time_ns, image) : recorder.writeMissing(info.time_ns);
  });
  writer_->amend(header_);
  if (!writer_->publish()) {
    status().dropped();
    status().report(writeFailed("camera " + camera_.id, writer_->error()));
    return true;
  }
  last_ns_ = header_.acquired_ns;
  ++samples_;
  status().processed(Clock::now() - begun, header_.state == FrameState::kOk);
  return true;
}

/// A device that returns may deliver its default size. Opening it again requests the right one.
void DeviceCameraService::checkSize(const dataset::FrameInfo& info) {
  for (const Message& message : faults_.add(info.where, {codeOf(info.state), info.fault}))
    status().report(message);
  wrong_sizes_ = info.state == FrameState::kWrongSize ? wrong_sizes_ + 1 : 0;
  if (wrong_sizes_ < kWrongSizes) return;
  wrong_sizes_ = 0;
  status().report(cameraSizeChanged(camera_.id, info.fault, options_.device.retry_longest_s));
  device_.reopen();
}

void DeviceCameraService::drain() {
  for (const Message& message : faults_.end()) status().report(message);
  ends_.announce("camera " + camera_.id, last_ns_, samples_, "stopped");
}

}  // namespace omnifleet::services
