#include "localizer/elected_localizer.h"

#include <algorithm>
#include <tuple>

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

}  // namespace

ElectedLocalizer::ElectedLocalizer(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      fleet_(fleet),
      office_(context, "estimator", fleet.estimatorHosts(), context.options.host, steady_clock::now()),
      keyframe_poses_(context.bus.reader(context.topics.map_keyframe_pose)) {}

/// Also the terms of localizers that are dead: their poses must not outrank those to come.
bool ElectedLocalizer::noteKeyframePoses() {
  bool any = false;
  occupancy::KeyframePose pose;
  while (keyframe_poses_->take(sample_)) {
    any = true;
    if (!adapters::fromWire(sample_, pose) || !pose.valid) continue;
    office_.noteTerm(pose.term);
    const auto order = [](const occupancy::KeyframePose& p) {
      return std::make_tuple(p.acquired_ns, p.term, p.revision);
    };
    const auto [at, is_new] = known_.latest.try_emplace(pose.robot, pose);
    if (!is_new && order(at->second) < order(pose)) at->second = pose;
  }
  return any;
}

bool ElectedLocalizer::spin() {
  bool any = noteKeyframePoses();
  if (office_.update(steady_clock::now())) {
    begin();
    any = true;
  }
  return (estimator_ && estimator_->spin()) || any;
}

/// The office has come or gone. A holder whose term has grown has outlasted another one: it begins again with
/// the robots of both.
void ElectedLocalizer::begin() {
  estimator_.reset();
  const std::uint32_t term = office_.term();
  if (term == 0) {
    context_.log->info("the localizer of another machine estimates from now on; this one stands by");
    status().state(bus::ServiceState::kWaiting);
    return;
  }
  context_.log->info("this localizer estimates from now on (term {})", term);
  bus::ServiceContext context = context_;
  context.options.incarnation = std::max(context_.options.incarnation, static_cast<int>(term));
  const bool takes_over = context.options.incarnation > 1;
  estimator_ = std::make_unique<LocalizerService>(
      context, fleet_, takes_over ? std::optional<LocalizerService::Takeover>(known_) : std::nullopt);
  estimator_->start();
}

void ElectedLocalizer::drain() {
  if (estimator_) estimator_->drain();
  office_.leave(finished());
}

std::optional<steady_clock::time_point> ElectedLocalizer::wakeAt() const {
  const auto election = office_.wakeAt();
  const auto estimator = estimator_ ? estimator_->wakeAt() : std::nullopt;
  if (!election || !estimator) return election ? election : estimator;
  return std::min(*election, *estimator);
}

}  // namespace omnifleet::services
