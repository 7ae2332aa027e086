#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>

#include "options/options.h"

namespace omnifleet::dataset {

using Rgb = std::array<std::uint8_t, 3>;  ///< red, green, blue

enum class MarkerKind { kPatches, kCoverTailHead };

/// Colours of one robot. The marker kind determines which are used.
struct RobotColours {
  Rgb individual{};             ///< patches: the individual patch (`rgb`)
  Rgb cover{}, tail{}, head{};  ///< cover_tail_head
};

/// Content of `ceiling/markers.yaml`. Offsets are centres in base_link; sizes are along x and y of base_link.
/// Metres.
struct MarkerSet {
  MarkerKind kind = MarkerKind::kPatches;
  double height_m = 0.0;  ///< height of the marker plane over the floor

  // kind: patches (Choi et al. 2014 §II: team patch and individual patch)
  Rgb team{};
  Eigen::Vector2d team_offset_m{0.0, 0.0}, individual_offset_m{0.0, 0.0}, patch_size_m{0.0, 0.0};

  // kind: cover_tail_head (Ahmed et al. 2013)
  Eigen::Vector2d cover_size_m{0.0, 0.0};
  Eigen::Vector2d head_offset_m{0.0, 0.0}, head_size_m{0.0, 0.0};
  Eigen::Vector2d tail_offset_m{0.0, 0.0}, tail_size_m{0.0, 0.0};

  std::map<std::string, RobotColours> robots;

  /// Throw options::Error that names file, line, key and bound. A size may be one number (a square).
  static MarkerSet load(const std::string& path);
  static MarkerSet read(const options::Section& section);

  /// Text of markers.yaml.
  std::string toYaml() const;
};

}  // namespace omnifleet::dataset
