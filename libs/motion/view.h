#pragma once

#include "motion/formation_types.h"
#include "observation/observation.h"

namespace omnifleet::motion {

/// The scan as a View of at most View::kMostRays entries. Adjacent rays share an entry; the nearest of them
/// counts. Rays that show nothing at both ends of the field of view are left out.
/// - An object whose range is less certain than `sigma_limit_m` (m, σ) is not solid: the floor is free up to
///   3 σ before it, and what lies there is seen from nearer.
/// - A robot is not solid: the floor is free up to it.
/// - An object at the edge of the hidden floor (Scan::blind_m) begins somewhere before that edge.
View compactView(const Scan& scan, double sigma_limit_m);

/// Angle between the outermost bearings of a view, radians; 0 if it is empty.
double fieldOfView(const View& view);

}  // namespace omnifleet::motion
