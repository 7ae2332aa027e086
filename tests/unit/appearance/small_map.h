#pragma once

#include <optional>

#include "appearance/topological_map.h"

namespace omnifleet::test {

/// A format of few bytes.
inline SignatureFormat smallFormat() {
  SignatureFormat format;
  format.rows = format.stored_rows = 2;
  format.columns = 64;
  format.stored_modules = 6;
  format.stored_phases = 4;
  format.least_elevation_rad = -0.2f;
  format.most_elevation_rad = 0.1f;
  format.camera = "equidistant 640x480";
  return format;
}

inline StoredSignature smallSignature(unsigned seed) {
  StoredSignature signature;
  for (unsigned k = 0; k < 20; ++k) signature.bytes.push_back(static_cast<std::uint8_t>(37 * seed + 11 * k));
  signature.scale = {1.5f + 0.1f * static_cast<float>(seed), 2.25f};
  return signature;
}

/// Places on a curve, with one loop.
inline appearance::TopologicalMap smallMap(unsigned places, unsigned salt = 0) {
  appearance::TopologicalMap map("r1", "r1", smallFormat());
  for (unsigned i = 0; i < places; ++i) {
    std::optional<appearance::Transition> transition;
    if (i > 0) {
      transition.emplace();
      transition->turn_rad = 0.3 + 0.01 * i;
      transition->turn_sigma_rad = 0.01;
      transition->difference = 0.25;
      if (i % 3 == 0) transition->displacement_m = 0.1 + 0.001 * salt;
    }
    map.add(1000 * i, i, smallSignature(i + salt), transition);
  }
  map.addLoop(0, places - 1, {0.1, 0.2, 0.3}, 0.01 * Eigen::Matrix3d::Identity());
  map.optimise();
  return map;
}

}  // namespace omnifleet::test
