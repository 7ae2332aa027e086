#pragma once

#include "observation/observation.h"
#include "options/options.h"
#include "scan/line_scan.h"

namespace omnifleet::occupancy {

struct MapRaysOptions {
  /// The robot is in a room if more than this share of the bearings ends at walls or furniture. Bearings that
  /// end at tracked objects do not count, so in an open arena hardly any does.
  double room_share = 0.2;
  /// The same of forward cameras that see above the horizon: of what has the floor's colour they see the
  /// upper part there, so nothing but the floor looks like floor to the end of the view.
  double front_room_share = 1.0;
  int room_frames = 10;  ///< number of frames over which the share is averaged (exponential weights)

  /// Share of the σ of an edge that its neighbours share (shadows, texture, blocks of JPEG), so that a line
  /// through them keeps it. Of fisheye cameras and lasers, and of forward cameras: those see an edge from
  /// 8 cm above the floor, where 0.1 px are 1 cm at 1 m.
  double shared_share = 0.0, front_shared_share = 0.9;

  static MapRaysOptions read(const options::Section& section);
};

/// Combines the two descriptions of what ends the floor into the rays that the map is made of: the labelled
/// scan (what stands there) and the boundary (where the floor ends, with its σ). Buffers are reused.
///
/// Per bearing of the labelled scan:
/// - An edge of the boundary ends the ray. Where a line fits around it, its range is that of the line, with
///   the σ of the line. The label is that of the scan; what belongs to no tracked object is an obstacle.
///   An edge on a robot or on another moving object becomes a robot's ray.
/// - If the scan ends clearly before the edge, one of them is wrong. The ray is undecided from the nearer
/// one.
/// - Without an edge, something ends the ray, but what differs little from the floor may begin before that.
///   Such a ray has the label kUnknown and object 0: it hits, and shows no floor. A tracked object keeps its
///   label.
/// - Without an edge and without an obstacle, the floor reaches to the end of the view, or something of the
///   floor's colour stands there. Of all bearings that end at no tracked object, those that end at something
///   are counted (mean of the last `room_frames` or so). If their share exceeds `room_share`, the robot is in
///   a room, and the ray is invalid. Otherwise it shows floor.
class MapRays {
 public:
  explicit MapRays(const MapRaysOptions& options) : options_(options) {}

  /// Valid until the next call. Throws nothing; sizes that differ are cut to the shortest.
  const Scan& of(const Objects& objects);

 private:
  void placeAtEdge(const Scan& scan, std::size_t i, double range_m, double sigma_m, bool moves);
  /// Edge at a beam: range and σ in metres.
  std::pair<double, double> edgeAt(const Boundary& boundary, std::size_t beam) const;

  MapRaysOptions options_;
  scan::LineScan lines_;
  Scan rays_;
  double structure_ = 0.0, nothing_ = 0.0;  ///< numbers of such rays, decaying from frame to frame
};

}  // namespace omnifleet::occupancy
