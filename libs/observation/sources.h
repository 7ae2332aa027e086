#pragma once

#include <array>
#include <cstdint>

namespace omnifleet {

/// What the localizer takes a pose from. Bits of SourceSet, here and on the wire.
enum class Source : std::uint16_t {
  kWheels = 1,
  kFloor = 2,         ///< motion by the texture of the floor
  kAppearance = 4,    ///< visual compass; without wheels also the length of the way
  kScan = 8,          ///< scan matched with keyframes
  kLandmarks = 16,    ///< outlines of free-standing obstacles
  kSightings = 32,    ///< robots that the robot sees
  kAbsolute = 64,     ///< ceiling cameras, surveyed points
  kInitialPose = 128  ///< as configured
};
inline constexpr std::array kSources{Source::kWheels,   Source::kFloor,      Source::kAppearance,
                                     Source::kScan,     Source::kLandmarks,  Source::kSightings,
                                     Source::kAbsolute, Source::kInitialPose};
const char* toString(Source source);

struct SourceSet {
  std::uint16_t bits = 0;

  void add(Source source) { bits = static_cast<std::uint16_t>(bits | static_cast<std::uint16_t>(source)); }
  bool has(Source source) const { return (bits & static_cast<std::uint16_t>(source)) != 0; }
  /// Only bits of kSources are set.
  bool isKnown() const { return bits < 2 * static_cast<std::uint16_t>(Source::kInitialPose); }
  bool operator==(const SourceSet& other) const { return bits == other.bits; }
};

}  // namespace omnifleet
