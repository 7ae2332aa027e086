#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/inlet.h"
#include "common/newest_term.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Feeds the poses of the previous frame back into an earlier stage. Cameras of different robots need not be
/// synchronous. A pose contains times of the other robots' published poses (`published`). These keep this
/// stage from waiting for a pose that the estimator can publish only after this stage has continued
/// (deadlock). An estimator that does not publish them supports only robots with common frame times.
template <class Payload>
class PoseFeedback {
 public:
  PoseFeedback(const bus::ServiceContext& context, const fleet::Fleet& fleet,
               bus::TimeMerger<Payload>& merger, RunEnds& ends)
      : merger_(merger) {
    const std::vector<std::string> observing = fleet.observingRobots();
    for (const std::string& robot : fleet.locatedRobots()) {
      if (std::find(observing.begin(), observing.end(), robot) != observing.end()) continue;
      poses_.push_back(std::make_unique<Inlet<v1::Pose, Payload>>(
          context.bus.reader(context.topics.pose, robot), merger, ends,
          bus::StreamSpec{"pose " + robot, robot, 1, bus::StreamRole::kFeedback,
                          streamMode(context.options)}));
      stream_of_[robot] = poses_.back()->stream();
    }
  }

  /// Moves all arrived poses into the merger. @return whether any pose arrived
  bool pull(bus::StatusBoard& status) {
    bool any = false;
    for (auto& inlet : poses_) {
      any |= inlet->pull(status, [this, &inlet](const v1::Pose& wire, Payload& payload) {
        if (!term_.accepts(inlet->stream(), wire.term(), wire.header().acquired_ns()))
          return Validity::kIgnored;
        for (const v1::PublishedPose& other : wire.published()) {
          const auto stream = stream_of_.find(other.robot().to_string());
          if (stream != stream_of_.end())
            merger_.promise(stream->second, other.last_ns(), wire.header().acquired_ns());
        }
        return orInvalid(adapters::fromWire(wire, payload.template emplace<PoseEstimate>()));
      }) > 0;
    }
    return any;
  }

  /// The newest pose of every robot, including this batch.
  const std::vector<PoseEstimate>& take(std::vector<typename bus::TimeMerger<Payload>::Item>& feedback) {
    for (auto& item : feedback) {
      if (auto* pose = std::get_if<PoseEstimate>(&item.payload)) latest_[pose->robot] = *pose;
    }
    known_.clear();
    for (const auto& [robot, pose] : latest_) known_.push_back(pose);
    return known_;
  }

 private:
  bus::TimeMerger<Payload>& merger_;
  std::vector<std::unique_ptr<Inlet<v1::Pose, Payload>>> poses_;
  std::map<std::string, int> stream_of_;
  std::map<std::string, PoseEstimate> latest_;
  std::vector<PoseEstimate> known_;
  NewestTerm term_;
};

}  // namespace omnifleet::services
