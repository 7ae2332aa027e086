#include "global_merger/replication.h"

#include <cmath>

#include "common/inlet.h"
#include "common/messages.h"
#include "global_merger/messages.h"

namespace omnifleet::services {
namespace {

using occupancy::SampleId;
using occupancy::SampleKind;

constexpr std::size_t kPosesPerSample = 64;  // bound in map.idl

template <class Sample>
std::uint64_t digestOf(const Sample& sample) {
  return occupancy::digest(occupancy::canonicalBytes(sample));
}

}  // namespace

Replication::Replication(const bus::ServiceContext& context, adapters::RunClock clock,
                         const std::string& robot, const std::vector<std::string>& robots,
                         const occupancy::ReconcilerOptions& options)
    : robot_(robot),
      clock_(clock),
      options_(options),
      reconciler_(robot, robots, options),
      have_in_(context.bus.reader(context.topics.map_have)),
      have_out_(context.bus.writer(context.topics.map_have)),
      resend_in_(context.bus.reader(context.topics.map_resend)),
      resend_out_(context.bus.writer(context.topics.map_resend)) {}

std::chrono::nanoseconds Replication::longestEnd() const {
  return std::chrono::nanoseconds(std::llround(options_.final_s * 1e9));
}

void Replication::added(const occupancy::ContributionStore& store,
                        const occupancy::Contribution& contribution, Time now) {
  const auto* keyframe = store.find(contribution.robot, contribution.acquired_ns);
  reconciler_.put({contribution.robot, SampleKind::kContribution, contribution.acquired_ns},
                  keyframe->contribution_digest, now);
}

void Replication::added(const occupancy::ContributionStore& store, const occupancy::KeyframePose& pose,
                        Time now) {
  const auto* keyframe = store.find(pose.robot, pose.acquired_ns);
  reconciler_.put({pose.robot, SampleKind::kKeyframePose, pose.acquired_ns}, keyframe->pose_digest, now);
}

bool Replication::pull(bus::StatusBoard& status,
                       const std::function<void(const occupancy::Contribution&)>& add_contribution,
                       const std::function<void(const occupancy::KeyframePose&)>& add_pose) {
  bool any = false;
  occupancy::Have have;
  while (have_in_->take(have_)) {
    any = true;
    if (adapters::fromWire(have_, have)) {
      reconciler_.receive(have, std::chrono::steady_clock::now());
    } else {
      status.dropped();
      status.report(sampleRejected("map/have " + have.replica));
    }
  }
  while (resend_in_->take(received_)) {
    any = true;
    if (received_.replica().to_string() != robot_) pullResent(status, add_contribution, add_pose);
  }
  return any;
}

void Replication::pullResent(bus::StatusBoard& status,
                             const std::function<void(const occupancy::Contribution&)>& add_contribution,
                             const std::function<void(const occupancy::KeyframePose&)>& add_pose) {
  const std::string sender = received_.replica().to_string();
  const auto now = std::chrono::steady_clock::now();
  occupancy::Contribution contribution;
  for (const v1::Contribution& wire : received_.contributions()) {
    if (adapters::fromWire(wire, contribution)) {
      add_contribution(contribution);
    } else {
      status.dropped();
      status.report(global_merger::contributionRejected(contribution.robot));
    }
    reconciler_.noteResent(sender, {contribution.robot, SampleKind::kContribution, contribution.acquired_ns},
                           digestOf(contribution), now);
  }
  occupancy::KeyframePose pose;
  for (const v1::KeyframePose& wire : received_.keyframe_poses()) {
    if (adapters::fromWire(wire, pose)) add_pose(pose);
    reconciler_.noteResent(sender, {pose.robot, SampleKind::kKeyframePose, pose.acquired_ns}, digestOf(pose),
                           now);
  }
}

void Replication::send(const occupancy::ContributionStore& store, Time now, bus::StatusBoard& status) {
  if (reconciler_.isHaveDue(now)) publishHave(now, status);
  resend(store, now, status);
}

void Replication::publishHave(Time now, bus::StatusBoard& status) {
  adapters::toWire(reconciler_.have(now), have_);
  adapters::fillHeader(0, haves_++, clock_, have_.header());
  if (!have_out_->write(have_)) status.report(writeFailed("map/have", have_out_->error()));
}

void Replication::resend(const occupancy::ContributionStore& store, Time now, bus::StatusBoard& status) {
  resend_.replica(robot_);
  for (const SampleId& id : reconciler_.due(now)) {
    if (!reconciler_.canSend(now)) break;
    const auto* keyframe = store.find(id.robot, id.time_ns);
    if (keyframe == nullptr) continue;
    if (id.kind == SampleKind::kContribution && keyframe->contribution) {
      adapters::toWire(*keyframe->contribution, clock_, resend_.contributions().emplace_back());
    } else if (id.kind == SampleKind::kKeyframePose && keyframe->pose) {
      adapters::toWire(*keyframe->pose, clock_, resend_.keyframe_poses().emplace_back());
    } else {
      continue;
    }
    const bool is_pose = id.kind == SampleKind::kKeyframePose;
    reconciler_.noteResent(robot_, id, is_pose ? keyframe->pose_digest : keyframe->contribution_digest, now);
    if (!resend_.contributions().empty() || resend_.keyframe_poses().size() == kPosesPerSample) flush(status);
  }
  flush(status);
}

/// Writes what is collected and counts its bytes.
void Replication::flush(bus::StatusBoard& status) {
  if (resend_.contributions().empty() && resend_.keyframe_poses().empty()) return;
  adapters::fillHeader(0, resends_++, clock_, resend_.header());
  reconciler_.spend(bus::describe<v1::Resend>().size(&resend_));
  if (!resend_out_->write(resend_)) status.report(writeFailed("map/resend", resend_out_->error()));
  resend_.contributions().clear();
  resend_.keyframe_poses().clear();
}

}  // namespace omnifleet::services
