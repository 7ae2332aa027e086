#pragma once

#include "geometry/polygon.h"
#include "observation/observation.h"
#include "synthetic/scene.h"

namespace omnifleet::world {

/// Gap between two convex polygons, metres. Overlapping polygons have a negative gap: the shortest shift that
/// separates them.
double gapBetween(const Polygon& a, const Polygon& b);

/// Gap between the body of a robot and a solid. Negative: they overlap. Exact for round bodies, and for
/// footprints near the solid; far from it a lower bound above zero. Bodies are round or convex.
double gapToSolid(const RobotBody& body, const Pose2& map_from_base, const synthetic::Solid& solid,
                  const Pose2& map_from_solid);

/// The same between the bodies of two robots.
double gapToBody(const RobotBody& a, const Pose2& map_from_a, const RobotBody& b, const Pose2& map_from_b);

}  // namespace omnifleet::world
