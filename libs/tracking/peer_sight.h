#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "tracking/peers.h"
#include "tracking/view.h"

namespace omnifleet::tracking {

/// What is looked for is a robot whose place is published: it need not be told from scratch.
struct PeerSight {
  /// @param eye where the camera stands: a view whose supports only tell their number @param margin_m by
  /// which outlines may be off on the floor under the body
  PeerSight(const Peer& peer, const View& eye, double margin_m);

  /// All that the outline encloses the peer's does, too, but for little: it is a piece of the peer, as
  /// something before it would stand out, and something behind it is hidden within. Where it clearly is one
  /// it may hold some of the peer's shade on the floor, too.
  bool encloses(const View& outline) const;
  /// Directions in which the outline is about the peer's.
  int sharedDirections(const View& outline) const;
  /// The outline is about the peer's, all around and where it touches the floor.
  bool isWhole(const View& outline) const;
  /// Leaves those directions in which the outline is about the peer's.
  void keepOwn(View& outline) const;
  /// Where the floor ends undecided just where the peer stands, on most of the bearings on which the scan
  /// looks there.
  bool isUndecided(const Scan& scan) const;
  /// The scan does not look through where the peer stands: what lies before it hides it, or something is
  /// there.
  bool mayBeThere(const Scan& scan) const;

 private:
  /// Of a ray, where it would meet the peer and leave it, metres.
  struct Chord {
    double begin_m = 0.0, end_m = 0.0;
  };
  /// @param ray unit vector
  std::optional<Chord> chordOf(const Eigen::Vector2d& ray) const;
  bool mayHoldShade(const View& outline) const;
  double off(const View& outline, std::size_t k) const;

  double margin_m_;
  double top_share_;  ///< of a distance to the top's image on the floor, that to what is below it
  std::vector<double> support_m_;         ///< that the peer should show
  std::vector<Eigen::Vector2d> normals_;  ///< of the directions
  std::vector<double> shrink_;            ///< what is off in that direction, on the floor under the body
};

/// The outline around two.
void joinOutlines(const View& other, View& outline);

}  // namespace omnifleet::tracking
