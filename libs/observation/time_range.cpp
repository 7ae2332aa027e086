#include "observation/time_range.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

namespace omnifleet {
namespace {

constexpr double kSecond_ns = 1e9, kHour_s = 3600.0;

double seconds(TimeNs ns) {
  return static_cast<double>(ns) / kSecond_ns;
}

struct Unit {
  const char* name;
  double factor;  ///< to nanoseconds
};

/// The unit in which a number stands, if it should be `expected_ns`; empty: none fits.
const char* unitOf(TimeNs number, TimeNs expected_ns) {
  constexpr std::array<Unit, 3> kUnits{{{"microseconds", 1e3}, {"milliseconds", 1e6}, {"seconds", 1e9}}};
  constexpr double kTolerance = 0.02;  // two streams of one run begin nearly together
  for (const Unit& unit : kUnits) {
    const double ratio =
        unit.factor * static_cast<double>(number) / std::max(1.0, static_cast<double>(expected_ns));
    if (std::abs(ratio - 1.0) < kTolerance) return unit.name;
  }
  return nullptr;
}

}  // namespace

std::string toString(const TimeRange& range) {
  return fmt::format("{:.3f} to {:.3f} s", seconds(range.first_ns), seconds(range.last_ns));
}

std::string likelyCause(const std::string& name, const TimeRange& stream, const TimeRange& frames) {
  constexpr double kHalfHour_s = 0.5 * kHour_s, kLongestZone_h = 14.0;
  constexpr double kZoneSlack_s = 20.0;                 // two streams of one run begin nearly together
  constexpr double kSince1970_s = 20 * 365.25 * 86400;  // a system time is later than 1990
  if (const char* unit = unitOf(stream.first_ns, frames.first_ns))
    return fmt::format("{} seem to be in {}, not nanoseconds", name, unit);
  if (const char* unit = unitOf(frames.first_ns, stream.first_ns))
    return fmt::format("the frames seem to be in {}, not nanoseconds", unit);
  const double apart_s = seconds(stream.first_ns - frames.first_ns);
  const double zones = std::round(apart_s / kHalfHour_s);
  if (zones != 0.0 && std::abs(zones) <= 2.0 * kLongestZone_h &&
      std::abs(apart_s - zones * kHalfHour_s) < kZoneSlack_s)
    return fmt::format("{} are {:+g} h off, which looks like a time zone", name, 0.5 * zones);
  const bool stream_is_system = seconds(stream.first_ns) > kSince1970_s;
  const bool frames_are_system = seconds(frames.first_ns) > kSince1970_s;
  if (!stream_is_system && frames_are_system)
    return fmt::format("{} seem to count since the start of a machine, the frames since 1970", name);
  if (stream_is_system && !frames_are_system)
    return fmt::format("{} seem to count since 1970, the frames since the start of a machine", name);
  return fmt::format("{} seem to have another clock, {:+.3f} s off", name, apart_s);
}

}  // namespace omnifleet
