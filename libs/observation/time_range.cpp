#include "observation/time_range.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <optional>

namespace omnifleet {
namespace {

constexpr double kSecond_ns = 1e9, kHour_s = 3600.0;

double seconds(TimeNs ns) {
  return static_cast<double>(ns) / kSecond_ns;
}

struct Unit {
  const char* name;
  const char* symbol;
  double factor;  ///< to nanoseconds
};

bool isSystemTime(TimeNs ns) {
  constexpr double kYear_s = 365.25 * 86400.0;
  return seconds(ns) > 20.0 * kYear_s && seconds(ns) < 130.0 * kYear_s;  // 1990 to 2100
}

/// The unit in which a number stands, if it should be `expected_ns`; empty: none fits.
std::optional<Unit> unitOf(TimeNs number, TimeNs expected_ns) {
  constexpr std::array<Unit, 3> kUnits{
      {{"microseconds", "us", 1e3}, {"milliseconds", "ms", 1e6}, {"seconds", "s", 1e9}}};
  constexpr double kTolerance = 0.02;  // two streams of one run begin nearly together
  for (const Unit& unit : kUnits) {
    const double ratio =
        unit.factor * static_cast<double>(number) / std::max(1.0, static_cast<double>(expected_ns));
    if (std::abs(ratio - 1.0) < kTolerance) return unit;
  }
  return std::nullopt;
}

/// One of two streams has another unit. Which one is certain if the larger times are those of a system clock.
std::string otherUnit(const Unit& unit, const std::string& small, const std::string& large, TimeNs large_ns) {
  const std::string text = fmt::format("{} seem to be in {}, not nanoseconds", small, unit.name);
  if (isSystemTime(large_ns)) return text;
  return fmt::format("{}, or {} are in nanoseconds under a header that says [{}]", text, large, unit.symbol);
}

}  // namespace

std::string toString(const TimeRange& range) {
  return fmt::format("{:.3f} to {:.3f} s", seconds(range.first_ns), seconds(range.last_ns));
}

std::string likelyCause(const std::string& name, const TimeRange& stream, const TimeRange& frames) {
  constexpr double kHalfHour_s = 0.5 * kHour_s, kLongestZone_h = 14.0;
  constexpr double kZoneSlack_s = 20.0;  // two streams of one run begin nearly together
  if (const auto unit = unitOf(stream.first_ns, frames.first_ns))
    return otherUnit(*unit, name, "the frames", frames.first_ns);
  if (const auto unit = unitOf(frames.first_ns, stream.first_ns))
    return otherUnit(*unit, "the frames", name, stream.first_ns);
  const double apart_s = seconds(stream.first_ns - frames.first_ns);
  const double zones = std::round(apart_s / kHalfHour_s);
  if (zones != 0.0 && std::abs(zones) <= 2.0 * kLongestZone_h &&
      std::abs(apart_s - zones * kHalfHour_s) < kZoneSlack_s)
    return fmt::format("{} are {:+g} h off, which looks like a time zone", name, 0.5 * zones);
  const bool stream_is_system = isSystemTime(stream.first_ns);
  const bool frames_are_system = isSystemTime(frames.first_ns);
  if (!stream_is_system && frames_are_system)
    return fmt::format("{} seem to count since the start of a machine, the frames since 1970", name);
  if (stream_is_system && !frames_are_system)
    return fmt::format("{} seem to count since 1970, the frames since the start of a machine", name);
  return fmt::format("{} seem to have another clock, {:+.3f} s off", name, apart_s);
}

}  // namespace omnifleet
