#include "motion/formation_types.h"

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

}  // namespace omnifleet::motion
