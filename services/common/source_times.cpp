#include "common/source_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>

#include "camera/device_service.h"

namespace omnifleet::services {
namespace {

constexpr TimeNs kMillisecondNs = 1000000;
constexpr TimeNs kFresh_ns = 5000 * kMillisecondNs;  // a sample of this run is not older when it arrives
constexpr TimeNs kClear_ns = 500 * kMillisecondNs;   // no delay of a sample looks like a larger jump
constexpr TimeNs kBack_ns = 1000 * kMillisecondNs;   // samples out of order are less late
constexpr int kFitting = 3;  // samples that must fit a correction near the present one

Message timesCorrected(const std::string& stream, TimeNs correction_ns) {
  if (correction_ns == 0)
    return {ErrorCode::kClockJump,
            stream + ": its times are those of the run again; they are used as they are"};
  return {
      ErrorCode::kClockJump,
      fmt::format("{}: the clock of its publisher was {}; its times are corrected by {:+.3f} s, so that the "
                  "samples stay at the right frames. Start the fleet anew to use the new time",
                  stream, clockSet(-correction_ns), 1e-9 * static_cast<double>(correction_ns))};
}

}  // namespace

SourceTimes::SourceTimes(std::string stream, HostClock clock, ReadClocks read, TimeNs limit_ns)
    : stream_(std::move(stream)), clock_(std::move(clock)), read_(std::move(read)), limit_ns_(limit_ns) {}

TimeNs SourceTimes::age(TimeNs stamp_ns, TimeNs correction_ns) const {
  return std::abs(now_ns_ - (stamp_ns + correction_ns));
}

void SourceTimes::correct(TimeNs correction_ns) {
  if (correction_ns == correction_ns_) return;
  correction_ns_ = correction_ns;
  better_ = 0;
  message_ = timesCorrected(stream_, correction_ns);
}

/// Takes the correction with which the sample is youngest. Of two corrections that differ by less than
/// kClear_ns the other one must fit several times in a row, because a sample may wait in this process.
void SourceTimes::followHost(TimeNs stamp_ns) {
  TimeNs best_ns = correction_ns_;
  const std::array<std::optional<TimeNs>, 3> candidates{
      TimeNs{0}, std::abs(jump_ns_) >= limit_ns_ ? std::optional(-jump_ns_) : std::nullopt, own_offset_ns_};
  for (const auto& candidate : candidates) {
    if (candidate && age(stamp_ns, *candidate) <= kFresh_ns &&
        age(stamp_ns, *candidate) < age(stamp_ns, best_ns))
      best_ns = *candidate;
  }
  better_ = best_ns == correction_ns_ ? 0 : better_ + 1;
  if (std::abs(best_ns - correction_ns_) >= kClear_ns || better_ >= kFitting) correct(best_ns);
}

void SourceTimes::followStream(TimeNs stamp_ns) {
  if (!last_ns_ || stamp_ns + correction_ns_ > *last_ns_ - kBack_ns) {
    backward_ = 0;
    return;
  }
  backward_ = backward_ > 0 && stamp_ns <= backward_ns_ ? 1 : backward_ + 1;
  backward_ns_ = stamp_ns;
  if (backward_ < kBackward) return;
  backward_ = 0;
  own_offset_ns_ = *last_ns_ + (now_ns_ - last_arrived_ns_) - stamp_ns;
  correct(*own_offset_ns_);
}

TimeNs SourceTimes::toRun(TimeNs stamp_ns) {
  const ClockReading reading = read_();
  now_ns_ = reading.monotonic_ns + clock_.offset();
  jump_ns_ = reading.system_ns - now_ns_;
  followHost(stamp_ns);
  followStream(stamp_ns);
  const TimeNs time_ns = stamp_ns + correction_ns_;
  if (!last_ns_ || time_ns > *last_ns_) {
    last_ns_ = time_ns;
    last_arrived_ns_ = now_ns_;
  }
  return time_ns;
}

LiveTimes::LiveTimes(const bus::ServiceContext& context, const fleet::Fleet& fleet, ReadClocks read)
    : read_(std::move(read)), limit_ns_(CameraOptions::read(fleet.service("camera")).clockJump_ns()) {
  const bool is_real = context.options.mode == bus::RunMode::kLive && !fleet.arena && fleet.dataset.empty();
  if (is_real) clock_ = std::make_unique<SharedClock>(context.options.out, read_);
}

SourceTimes* LiveTimes::add(const std::string& stream) {
  if (!clock_) return nullptr;
  return &streams_.emplace_back(stream, clock_->clock(), read_, limit_ns_);
}

void LiveTimes::report(bus::StatusBoard& status) {
  for (SourceTimes& stream : streams_)
    if (const auto message = stream.takeMessage()) status.report(*message);
}

}  // namespace omnifleet::services
