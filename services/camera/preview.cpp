#include "camera/preview.h"

#include <opencv2/imgcodecs.hpp>

#include "common/messages.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr auto kPeriod = std::chrono::milliseconds(200);
constexpr std::size_t kBound = 1048576;  // bound of the JPEG in camera.idl
constexpr int kQuality = 80;

}  // namespace

Preview::Preview(const bus::ServiceContext& context, const std::string& camera_id)
    : writer_(context.bus.writer(context.topics.camera_preview)) {
  sample_.camera(camera_id);
}

void Preview::offer(TimeNs acquired_ns, const cv::Mat& image, bus::StatusBoard& status) {
  if (writer_->matched() == 0) return;
  const auto now = steady_clock::now();
  if (sent_ && now - *sent_ < kPeriod) return;
  sent_ = now;
  const std::string name = "camera_preview " + std::string(sample_.camera().c_str());
  if (!cv::imencode(".jpg", image, jpeg_, {cv::IMWRITE_JPEG_QUALITY, kQuality}) || jpeg_.size() > kBound) {
    status.report(writeFailed(name, "the JPEG is larger than 1 MiB"));
    return;
  }
  sample_.acquired_ns(acquired_ns);
  sample_.width(static_cast<std::uint32_t>(image.cols));
  sample_.height(static_cast<std::uint32_t>(image.rows));
  sample_.jpeg().assign(jpeg_.begin(), jpeg_.end());
  if (!writer_->write(sample_)) status.report(writeFailed(name, writer_->error()));
}

}  // namespace omnifleet::services
