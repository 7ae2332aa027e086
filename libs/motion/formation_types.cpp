#include "motion/formation_types.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::motion {

const char* toString(FormationShape shape) {
  switch (shape) {
    case FormationShape::kLine:
      return "line";
    case FormationShape::kColumn:
      return "column";
    case FormationShape::kWedge:
      return "wedge";
    case FormationShape::kTriangle:
      return "triangle";
  }
  return "unknown";
}

const char* toString(Behaviour behaviour) {
  const auto index = static_cast<std::size_t>(behaviour);
  return index < behaviourNames().size() ? behaviourNames()[index].c_str() : "unknown";
}

const std::vector<std::string>& behaviourNames() {
  static const std::vector<std::string> kNames{"formation", "boundary_following", "exploration"};
  return kNames;
}

std::uint16_t View::entry(Kind kind, double range_m) {
  constexpr double kMost_mm = (1 << kRangeBits) - 1;
  const auto range_mm = static_cast<unsigned>(std::lround(std::clamp(1e3 * range_m, 0.0, kMost_mm)));
  return static_cast<std::uint16_t>(static_cast<unsigned>(kind) << kRangeBits | range_mm);
}

}  // namespace omnifleet::motion
