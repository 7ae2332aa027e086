#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::appearance {

struct TopologicalMapOptions {
  bool use_wheels = true;  ///< lengths of links are those of the wheels where there are any; false: scale · D
  /// Direction of a link: true: halfway between both headings; false: the accumulated heading after it, eq.
  /// 3–4.
  bool midway = true;
  double difference_share = 0.3;  ///< σ of a length from D, as a share of it
  double least_sigma_m = 0.002;   ///< m, of any length
  double unknown_turn_rad = 0.5;  ///< rad, σ of a turn that the compass does not know
  /// Keys: the names above.
  static TopologicalMapOptions read(const options::Section& section);
};

/// From the place before to a new one.
struct Transition {
  double turn_rad = 0.0;        ///< φ of the visual compass, or of the wheels
  double turn_sigma_rad = 0.0;  ///< ≤ 0: unknown
  double difference = 0.0;      ///< D, eq. 2, of the two signatures, or its normalised form; one form per map
  /// Wheels: signed length of the displacement (negative: backwards) and its σ, metres.
  std::optional<double> displacement_m;
  double displacement_sigma_m = 0.0;
  /// Direction of the displacement in the frame halfway between both headings, as TravelHint::bearing_rad. A
  /// robot that turns on the spot between two images does not move along it.
  double bearing_rad = 0.0;
};

/// Metres per unit of D.
struct MapScale {
  bool metric = false;  ///< false: nothing determines it; lengths are in units of D
  double metres = 1.0, sigma_metres = 0.0;
};

/// The topological map of one robot (Fernández et al. 2011, §IV.A): places with pose, signature and links. A
/// new place lies D (eq. 2) from the one before, in the direction of the accumulated heading (eq. 3–5).
/// Deviations: D is scaled by the least-squares ratio of wheel displacement to D, over all links that have
/// both; where a link has a wheel displacement, that is its length; poses have covariances; loop closures
/// correct the poses.
class TopologicalMap {
 public:
  TopologicalMap() = default;
  /// @param frame of the poses; the first place is its origin
  TopologicalMap(std::string robot, std::string frame, const SignatureFormat& format,
                 const TopologicalMapOptions& options = {});

  /// The first place, or one after the last place. Throws std::invalid_argument for a malformed signature,
  /// numbers that are not finite, and a missing or needless transition. Where a link has no wheel
  /// displacement, a new scale lays out all places anew; call optimise() again after it. @return its index
  std::uint32_t add(TimeNs acquired_ns, std::uint32_t sequence, const StoredSignature& signature,
                    const std::optional<Transition>& transition);

  /// A loop closure between two places of this map. @param earlier_from_later relative pose in the map's
  /// units
  /// @param covariance of its right perturbation. Throws std::invalid_argument for unknown places or a
  /// covariance that is not positive definite.
  void addLoop(std::uint32_t earlier, std::uint32_t later, const Pose2& earlier_from_later,
               const Eigen::Matrix3d& covariance);

  /// Least squares over all links; the first place stays. @return largest movement of a place
  double optimise();

  const std::vector<Place>& places() const { return places_; }
  const MapScale& scale() const { return scale_; }
  const std::string& robot() const { return robot_; }
  const std::string& frame() const { return frame_; }
  const SignatureFormat& format() const { return format_; }

 private:
  void learnScale(const Transition& transition);
  PlaceLink linkOf(std::size_t index) const;
  void layOut(std::size_t first);

  TopologicalMapOptions options_;
  std::string robot_, frame_;
  SignatureFormat format_;
  std::vector<Place> places_;
  std::vector<Transition> transitions_;                ///< to each place; of the first: not used
  double sum_dd_ = 0.0, sum_dl_ = 0.0, sum_ll_ = 0.0;  ///< D·D, D·length, length·length
  int measured_ = 0;
  bool relies_on_scale_ = false;  ///< some link has no wheel displacement
  MapScale scale_;
};

}  // namespace omnifleet::appearance
