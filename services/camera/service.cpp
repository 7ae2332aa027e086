#include "camera/service.h"

#include "adapters/adapters.h"
#include "camera/messages.h"
#include "camera/source.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr auto kReaderRetry = std::chrono::milliseconds(20);
constexpr auto kSlotRetry = std::chrono::microseconds(500);

std::size_t frameBytes(const fleet::CameraSpec& camera) {
  return static_cast<std::size_t>(camera.model.image_width_px) * camera.model.image_height_px * 3;
}

}  // namespace

CameraService::CameraService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      camera_(fleet.camera(context.options.camera)),
      paced_(context.options.mode == bus::RunMode::kLive),
      source_(openSource(camera_, fleet)),
      writer_(context.bus.frameWriter(camera_.id, frameBytes(camera_))),
      preview_(context, camera_.id),
      ends_(context, adapters::RunClock::kDataset) {
  if (context.options.record)
    recorder_.open(status(), context.options.out + "/recording", camera_.id, camera_.model);
  header_.clock = bus::ClockId::kDataset;
}

std::vector<bus::Expectation> CameraService::expectations() const {
  return {{"a reader of camera " + camera_.id, [this] { return writer_->matched() >= 1; }}};
}

void CameraService::start() {
  status().state(bus::ServiceState::kRunning);
}

bool CameraService::spin() {
  if (ended_) return false;
  wake_at_.reset();
  if (!decoded_ && !decode()) return ended_;
  if (!due()) return false;
  publish();
  return true;
}

bool CameraService::decode() {
  header_.width_px = camera_.model.image_width_px;
  header_.height_px = camera_.model.image_height_px;
  header_.channels = 3;
  std::uint8_t* loan = writer_->begin(header_);
  if (!loan) {
    wake_at_ = steady_clock::now() + kSlotRetry;
    return false;
  }
  cv::Mat image(header_.height_px, header_.width_px, CV_8UC3, loan);
  dataset::FrameInfo info;
  if (!source_->next(image, info)) {
    writer_->abandon();
    for (const Message& message : faults_.end()) status().report(message);
    if (samples_ > 0 && rejected_ == samples_) status().report(noFrameRead(camera_.id, samples_));
    finish();
    return false;
  }
  if (const std::string notice = source_->takeNotice(); !notice.empty())
    status().report({ErrorCode::kClockOffset, notice});
  header_.acquired_ns = info.time_ns;
  header_.sequence = info.sequence;
  header_.state = info.state;
  for (const Message& message : faults_.add(info.where, {codeOf(info.state), info.fault}))
    status().report(message);
  if (info.state == FrameState::kOk) preview_.offer(info.time_ns, image, status());
  recorder_.write(status(), [&](dataset::ImageStreamWriter& recorder) {
    info.state == FrameState::kOk ? recorder.write(info.time_ns, image) : recorder.writeMissing(info.time_ns);
  });
  writer_->amend(header_);
  decoded_ = true;
  return true;
}

bool CameraService::due() {
  if (!paced_) return true;
  const auto now = steady_clock::now();
  if (samples_ == 0 && writer_->matched() == 0) {  // without a reader the first frame would be lost
    wake_at_ = now + kReaderRetry;
    return false;
  }
  if (samples_ == 0) {
    first_frame_ns_ = header_.acquired_ns;
    first_sent_ = now;
  }
  const auto at = first_sent_ + std::chrono::nanoseconds(header_.acquired_ns - first_frame_ns_);
  if (now >= at) return true;
  wake_at_ = at;
  return false;
}

void CameraService::publish() {
  const auto begun = steady_clock::now();
  decoded_ = false;
  if (!writer_->publish()) {
    status().dropped();
    status().report(writeFailed("camera " + camera_.id, writer_->error()));
    return;
  }
  last_ns_ = header_.acquired_ns;
  ++samples_;
  if (header_.state != FrameState::kOk) ++rejected_;
  status().processed(steady_clock::now() - begun, header_.state == FrameState::kOk);
}

void CameraService::finish() {
  if (ended_) return;
  ended_ = true;
  ends_.announce("camera " + camera_.id, last_ns_, samples_);
}

void CameraService::drain() {
  finish();
}

}  // namespace omnifleet::services
