#include "localizer/ceiling_service.h"

#include <opencv2/core/mat.hpp>

#include "localizer/messages.h"

namespace omnifleet::services {
namespace {
using std::chrono::steady_clock;
}

CeilingService::CeilingService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      camera_(fleet.camera(context.options.camera)),
      ends_(context, runClock(context.options, fleet)),
      frames_(context, camera_, ends_),
      live_times_(context, fleet),
      clock_(runClock(context.options, fleet)),
      out_(context.bus.writer(context.topics.measurement, camera_.id), "measurement " + camera_.id,
           fleet::expectedReaders(fleet, "measurement", camera_.id)),
      front_end_(camera_.id.substr(camera_.id.find('/') + 1), camera_.model, fleet.markers.value(),
                 markers::FinderOptions::read(fleet.service("localizer").child("markers"))) {
  if (camera_.source == fleet::CameraSource::kDevice) live_times_.follow(frames_, "camera " + camera_.id);
}

bool CeilingService::spin() {
  bool any = ends_.poll();
  while (const auto frame = frames_.take(status())) {
    process(*frame);
    any = true;
  }
  live_times_.report(status());
  if (!ended_ && frames_.ended()) {
    out_.end(ends_);
    ended_ = any = true;
  }
  return any;
}

void CeilingService::process(const bus::FrameView& frame) {
  const auto begun = steady_clock::now();
  FrameState state = frame.header.state;
  found_.clear();
  if (state == FrameState::kOk) {
    const cv::Mat image = asMat(frame);
    if (image.type() == CV_8UC3 && image.cols == camera_.model.image_width_px &&
        image.rows == camera_.model.image_height_px) {
      found_ = front_end_.process(frame.header.acquired_ns, frame.header.sequence, image);
      reportConflicts();
    } else {
      state = FrameState::kWrongSize;
    }
  }
  if (!frames_.release(status())) {
    state = FrameState::kTorn;
    found_.clear();
  }
  adapters::toWire(camera_.id, frame.header.acquired_ns, frame.header.sequence, state, found_, clock_,
                   sample_);
  out_.write(sample_, status());
  status().processed(steady_clock::now() - begun, state == FrameState::kOk);
}

/// Reports each robot once until its second marker is gone.
void CeilingService::reportConflicts() {
  std::set<std::string> now;
  for (const markers::Conflict& conflict : front_end_.conflicts()) {
    now.insert(conflict.robot);
    if (ambiguous_.count(conflict.robot) == 0)
      status().report(localizer::markersAmbiguous(camera_.id, conflict.robot, conflict.decided));
  }
  ambiguous_.swap(now);
}

}  // namespace omnifleet::services
