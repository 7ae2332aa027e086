#include "common/frame_inlet.h"

#include "common/messages.h"

namespace omnifleet::services {

FrameInlet::FrameInlet(const bus::ServiceContext& context, const fleet::CameraSpec& camera, RunEnds& ends)
    : name_("camera " + camera.id),
      reader_(context.bus.frameReader(camera.id, static_cast<std::size_t>(camera.model.image_width_px) *
                                                     camera.model.image_height_px * 3)),
      may_lose_(context.options.mode == bus::RunMode::kLive) {
  ends.listen(name_, [this](TimeNs last, std::uint64_t) {
    end_ns_ = last;
    last_event_ = std::chrono::steady_clock::now();
  });
}

bool FrameInlet::ended() const {
  if (!end_ns_ || reader_->holding()) return false;
  return last_ns_ >= *end_ns_ || (may_lose_ && std::chrono::steady_clock::now() - last_event_ >= kGrace);
}

std::optional<bus::FrameView> FrameInlet::take(bus::StatusBoard& status) {
  while (auto frame = reader_->take()) {
    if (times_ != nullptr) frame->header.acquired_ns = times_->toRun(frame->header.acquired_ns);
    if (frame->header.acquired_ns > last_ns_) {
      last_ns_ = frame->header.acquired_ns;
      last_event_ = std::chrono::steady_clock::now();
      return frame;
    }
    reader_->release();
    status.dropped();
    status.report(sampleOutOfOrder(name_));
  }
  return std::nullopt;
}

bool FrameInlet::release(bus::StatusBoard& status) {
  const bool valid = reader_->stillValid();
  reader_->release();
  if (!valid) {
    status.dropped();
    status.report(frameOverwritten(name_));
  }
  return valid;
}

cv::Mat asMat(const bus::FrameView& frame) {
  if (!frame.data || frame.header.bytes() == 0) return {};
  // The loan is read-only memory of the writer. This Mat must not be written.
  return {frame.header.height_px, frame.header.width_px, frame.header.channels == 1 ? CV_8UC1 : CV_8UC3,
          const_cast<std::uint8_t*>(frame.data)};
}

}  // namespace omnifleet::services
