#pragma once

#include "global_merger/grouping.h"
#include "global_merger/merger.h"
#include "occupancy/contribution_store.h"

namespace omnifleet::global_merger {

/// All that is known about one candidate. Measured once per group; verdict.h decides by it alone.
struct Evidence {
  // Its views.
  int views = 0;
  int cut_views = 0;     ///< by the edge of the view or by a nearer object: the top is not visible
  int flawed_views = 0;  ///< cut, or merged from several objects
  bool from_camera = false;
  ObjectKind kind = ObjectKind::kUnknown;
  bool is_top_face = false;        ///< its sides look like the floor: the views show only the top face
  bool always_behind = false;      ///< in each view the ray ended at something nearer
  bool fits_silent_robot = false;  ///< the body of a fleet robot that has no pose in this map
  bool was_driven_at = false;      ///< a robot drove within 10 cm of its centre

  // Its shape, fitted over all views.
  bool has_shape = false;
  double spread = 0.0;                          ///< disagreement of the views, in σ
  double rms_m = 0.0;                           ///< m, of the residuals
  double sigma_m = 0.0;                         ///< m, of the centre, the larger axis
  double height_m = 0.0, height_sigma_m = 0.0;  ///< m; σ ≤ 0: unknown

  // Floor at its place: numbers of contributions whose ray went 5 cm beyond its centre.
  int floor_before = 0,
      floor_after = 0;        ///< from as near as its views (median), before or after its last view
  int floor_since_first = 0;  ///< from anywhere, since its first view
  int floor_ever = 0;         ///< from anywhere, at any time
  int missed = 0;             ///< had its place in plain sight and did not see it
  int missed_by_walls = 0;    ///< of these, rays that end at no tracked object
  int ended_after = 0;        ///< rays that ended at its place without an object, after its last view

  bool is_thin = false;  ///< a sliver, see map_warnings.h
  double faced = 0.0;    ///< share of its outline that faced a camera in some view

  // The map around it.
  bool is_mirrored = false;  ///< its centre lies behind a possible mirror (structure/mirrors.h)
  double seen = 1.0;         ///< share of its outline at which rays ended
  double alone = 1.0;  ///< share of the occupied cells connected with its outline that lie at it or at the
                       ///< outline of another obstacle; 1 if there are none
};

/// The evidence of a group, without the map around it.
Evidence evidenceOf(const Group& group, const occupancy::ContributionStore& store);

}  // namespace omnifleet::global_merger
