#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "tracking/peers.h"
#include "tracking/view.h"

namespace omnifleet::tracking {

/// Predicted outline of a peer whose pose is published, compared with observed outlines and scans.
struct PeerOutline {
  /// @param eye view from the camera's place in this frame; only the number of its supports is used @param
  /// margin_m tolerance between outlines on the floor under the body
  PeerOutline(const Peer& peer, const View& eye, double margin_m);

  /// True if the observed outline lies within the peer's, apart from small excesses: then it is a piece of
  /// the peer. An object in front of the peer would exceed the peer's outline, and the peer would hide an
  /// object behind it. An outline that clearly matches the peer in part may contain some of the peer's shadow
  /// on the floor.
  bool encloses(const View& outline) const;
  /// Number of directions in which the outline matches the peer's within the margin.
  int sharedDirections(const View& outline) const;
  /// True if the outline matches the peer's in 75 % of all directions and in 75 % of the contact directions.
  bool isWhole(const View& outline) const;
  /// Keeps only the directions in which the outline matches the peer's; the others get σ = −1.
  void keepOwn(View& outline) const;
  /// True if the scan is undecided at the peer's place on most of the bearings that reach it.
  bool isUndecided(const Scan& scan) const;
  /// True if the scan does not reach behind the peer's near side: an object hides the peer, or something
  /// stands there.
  bool mayBeThere(const Scan& scan) const;

 private:
  /// Distances at which a ray enters and leaves the peer, metres.
  struct Chord {
    double begin_m = 0.0, end_m = 0.0;
  };
  /// @param ray unit vector
  std::optional<Chord> chordOf(const Eigen::Vector2d& ray) const;
  bool mayHoldShadow(const View& outline) const;
  double off(const View& outline, std::size_t k) const;

  double margin_m_;
  double top_share_;  ///< shrinks a distance to the image of the top on the floor to the distance on the
                      ///< floor below it
  std::vector<double> support_m_;         ///< predicted for the peer, metres
  std::vector<Eigen::Vector2d> normals_;  ///< of the directions
  std::vector<double> shrink_;  ///< scale of an excess in this direction to the floor under the body
};

/// Extends `outline` to enclose `other`.
void joinOutlines(const View& other, View& outline);

}  // namespace omnifleet::tracking
