#include "camera/arena_service.h"

namespace omnifleet::services {
namespace {
using std::chrono::steady_clock;
constexpr auto kLoanRetry = std::chrono::microseconds(500);
}  // namespace

ArenaCameraService::ArenaCameraService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      camera_(fleet.camera(context.options.camera)),
      realtime_(context.options.mode == bus::RunMode::kLive),
      ends_(context, adapters::RunClock::kSim),
      writer_(context.bus.frameWriter(camera_.id, static_cast<std::size_t>(camera_.model.image_width_px) *
                                                      camera_.model.image_height_px * 3)),
      preview_(context, camera_.id),
      renderer_(*fleet.arena, camera_.id, static_cast<std::uint32_t>(fleet.seed)),
      map_from_bases_(fleet.arena->robots.size()) {
  for (const synthetic::ArenaRobot& robot : fleet.arena->robots) {
    robots_[robot.name] = robots_.size();
    // All truth samples come from one process, so waiting for all robots costs no time, in live mode as well.
    truths_.push_back(std::make_unique<Inlet<v1::Truth, TruePose>>(
        context.bus.reader(context.topics.world_truth, robot.name), merger_, ends_,
        bus::StreamSpec{"world/truth " + robot.name, robot.name, 0, bus::StreamRole::kInput,
                        bus::StreamMode::kLockstep}));
  }
  if (context.options.record)
    recorder_.open(status(), context.options.out + "/recording", camera_.id, camera_.model);
}

std::vector<bus::Expectation> ArenaCameraService::expectations() const {
  return {{"a reader of camera " + camera_.id, [this] { return writer_->matched() >= 1; }}};
}

bool ArenaCameraService::pull() {
  bool any = ends_.poll();
  for (auto& inlet : truths_) {
    any |= inlet->pull(status(), [this](const v1::Truth& wire, TruePose& pose) {
      const auto robot = robots_.find(wire.robot().to_string());
      pose = {robot == robots_.end() ? 0 : robot->second,
              wire.header().sequence_number(),
              {wire.map_from_base().x(), wire.map_from_base().y(), wire.map_from_base().theta()}};
      return robot != robots_.end() && pose.map_from_base.isFinite();
    }) > 0;
  }
  return any;
}

bool ArenaCameraService::spin() {
  bool any = pull();
  wake_at_.reset();
  while (!pending_ && merger_.nextBatch(batch_)) {
    setPoses();
    any = pending_ = true;
    // Behind the clock: only the newest state is rendered.
    while (realtime_ && merger_.nextBatch(batch_)) {
      status().dropped();
      setPoses();
    }
  }
  if (pending_) any |= render();
  if (!ended_ && !pending_ && merger_.finished()) {
    finish("");
    ended_ = any = true;
  }
  return any;
}

void ArenaCameraService::setPoses() {
  for (const auto& item : batch_.inputs) map_from_bases_[item.payload.robot] = item.payload.map_from_base;
  header_.acquired_ns = batch_.time;
  header_.sequence = batch_.inputs.front().payload.frame;
}

bool ArenaCameraService::render() {
  const auto begun = steady_clock::now();
  header_.clock = bus::ClockId::kSim;
  header_.width_px = camera_.model.image_width_px;
  header_.height_px = camera_.model.image_height_px;
  header_.channels = 3;
  std::uint8_t* loan = writer_->begin(header_);
  if (!loan) {
    wake_at_ = steady_clock::now() + kLoanRetry;
    return false;
  }
  cv::Mat image(header_.height_px, header_.width_px, CV_8UC3, loan);
  renderer_.render(static_cast<int>(header_.sequence), map_from_bases_, image);
  preview_.offer(header_.acquired_ns, image, status());
  recorder_.write(status(), [&](dataset::ImageStreamWriter& r) { r.write(header_.acquired_ns, image); });
  pending_ = false;
  if (!writer_->publish()) {
    status().dropped();
    status().report(writeFailed("camera " + camera_.id, writer_->error()));
    return true;
  }
  last_ns_ = header_.acquired_ns;
  ++samples_;
  status().processed(steady_clock::now() - begun);
  return true;
}

void ArenaCameraService::finish(const std::string& reason) {
  if (!ended_) ends_.announce("camera " + camera_.id, last_ns_, samples_, reason);
}

}  // namespace omnifleet::services
