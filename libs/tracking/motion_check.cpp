#include "tracking/motion_check.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "tracking/outline_split.h"

namespace omnifleet::tracking {
namespace {

constexpr std::size_t kLeastObjects = 2, kAnywhere = 3;
constexpr double kNear_m = 0.5, kNear_rad = 0.5;          // largest deviation that two objects alone may show
constexpr double kLeap_m = 0.15, kLeap_rad = 0.3;         // against the last velocity
constexpr double kFromRest_m = 0.5, kFromRest_rad = 1.0;  // against standing still, on the first frames
constexpr double kBeyond_mps = 3.0;
/// Wheels that grip reach no more: friction of 0.4 g; turning, with 0.5 m from the centre. Beyond some tenths
/// of a second the last velocity says nothing.
constexpr double kAcceleration_mps2 = 4.0, kTurning_radps2 = 8.0;
constexpr double kLastVelocity_m = 0.1,
                 kLastVelocity_rad = 0.2;          // σ of the last velocity where one object confirms it
constexpr double kOutline_m = 0.01, kMost = 16.0;  // σ of a typical distance; χ² of a missing object
constexpr double kGain = 20.0,
                 kRival = 8.0;  // χ² by which a motion must be better than the given one, than the others
constexpr double kHere_m =
    0.04;  // distance of outlines up to which an object is where the motion predicts it
constexpr double kCatch_m = 0.15;  // distance from which a fit converges
constexpr double kBeside_m = 0.012,
                 kMuchNearer = 0.3;  // small correction: least distance of outlines, share left after the fit
constexpr double kGate = 16.3;       // χ² (3 dof, 99.9 %) between the given motion and the fitted one
constexpr double kFar_m = 0.5;       // a blob whose contact is farther from an object's edge is another one
constexpr double kPair_m = 0.08, kBase_m = 0.3;    // distance of two objects: tolerance, least value
constexpr double kSame_m = 0.06, kSame_rad = 0.1;  // two motions this close are the same
constexpr int kFits = 4;
constexpr std::size_t kMostPairs = 300, kMostFits = 12;                 // bounds of the computing time
constexpr std::size_t kStride = 2;                                      // every second direction is used
constexpr double kSigma_m = 0.01, kHuber_m = 0.02, kCorrelation = 8.0;  // of a direction of an outline
constexpr double kFit_m = 0.004, kFit_rad = 0.003;    // σ added to the fit, to reject the given motion
constexpr double kFloor_m = 0.01, kFloor_rad = 0.01;  // σ added to the covariance that is reported
constexpr int kKnown = 3;                             // views that make a stationary object a reference

Eigen::Matrix3d squares(double sigma_m, double sigma_rad) {
  return Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
}

bool areSame(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() < kSame_m &&
         std::abs(wrapAngle(a.theta_rad - b.theta_rad)) < kSame_rad;
}

/// A candidate pose of the robot in odom, and the blob of each reference object at that pose (−1: none).
struct Place {
  Pose2 odom_from_base;
  std::vector<int> blob_of;
  std::size_t found = 0, here = 0;  ///< matched objects; those within kHere_m
  double apart_m = 0.0;             ///< mean distance of the matched objects
  double cost = 0.0;                ///< χ² of all objects
};

class Search {
 public:
  Search(const std::vector<TrackState>& tracks, const LocalMap& now) : now_(now) {
    TimeNs last_ns = 0;
    for (const TrackState& track : tracks) last_ns = std::max(last_ns, track.seen_ns);
    std::vector<const PrismFilter*> perhaps;
    for (const TrackState& track : tracks) {
      if (track.seen_ns != last_ns || !track.whole || track.dissolved) continue;
      const bool is_robot = track.kind == ObjectKind::kRobot || track.identity >= 0;
      if (!track.moving && track.views >= kKnown) objects_.push_back(&track.filter);
      if (!is_robot) perhaps.push_back(&track.filter);
    }
    stationary_ = objects_.size() >= kLeastObjects;
    if (!stationary_) objects_ = std::move(perhaps);
    views_.resize(now.objects.size());
    for (std::size_t b = 0; b < views_.size(); ++b) {
      views_[b].supports = now.objects[b].supports;
      views_[b].camera_height_m = now.camera_height_m;
    }
  }

  /// True if the reference objects are known to be stationary; false if nothing is classified yet, as on the
  /// first frames.
  bool areStationary() const { return stationary_; }
  std::size_t objectCount() const { return objects_.size(); }

  Place at(const Pose2& odom_from_base, double within_m = kCatch_m) {
    Place place;
    place.odom_from_base = odom_from_base;
    place.blob_of.assign(objects_.size(), -1);
    for (View& view : views_) {
      view.foot_m = odom_from_base * now_.scan.origin_m;
      view.heading_rad = odom_from_base.theta_rad;
    }
    struct Pair {
      double apart_m;
      std::size_t object, blob;
    };
    std::vector<Pair> pairs;
    for (std::size_t t = 0; t < objects_.size(); ++t) {
      for (std::size_t b = 0; b < views_.size(); ++b) {
        const double away_m = (odom_from_base * now_.objects[b].contact_m - objects_[t]->position()).norm();
        if (away_m > objects_[t]->radius() + kFar_m) continue;
        const double apart_m = outlineDistance(views_[b], *objects_[t]);
        if (apart_m < within_m) pairs.push_back({apart_m, t, b});
      }
    }
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const Pair& a, const Pair& b) { return a.apart_m < b.apart_m; });
    std::vector<bool> taken(views_.size(), false);
    for (const Pair& pair : pairs) {
      if (place.blob_of[pair.object] >= 0 || taken[pair.blob]) continue;
      place.blob_of[pair.object] = static_cast<int>(pair.blob);
      taken[pair.blob] = true;
      ++place.found;
      place.cost += std::min(kMost, pair.apart_m * pair.apart_m / (kOutline_m * kOutline_m));
      place.here += pair.apart_m < kHere_m ? 1 : 0;
      place.apart_m += pair.apart_m;
    }
    place.cost += kMost * static_cast<double>(objects_.size() - place.found);
    if (place.found > 0) place.apart_m /= static_cast<double>(place.found);
    return place;
  }

  /// The pose to which a fit of the outlines converges from `from`.
  Place fitted(const Pose2& from) {
    Place place = at(from);
    for (int i = 0; i < kFits && place.found >= kLeastObjects; ++i) {
      Eigen::Matrix3d h;
      const Eigen::Vector3d d = step(place, h);
      Pose2 next = place.odom_from_base;
      next.x_m += d.x(), next.y_m += d.y(), next.theta_rad = wrapAngle(next.theta_rad + d.z());
      if (!next.isFinite()) break;
      place = at(next, i + 2 < kFits ? kCatch_m : kHere_m);
    }
    return place;
  }

  /// A small correction: the same objects on the same blobs, but all outlines off. Nothing if the outlines
  /// match already. With two objects of which one matches, the other has changed: e.g. a piece of a wall that
  /// ends where it is hidden.
  std::optional<Place> beside(const Place& there, std::size_t least) {
    if (there.found < least || there.apart_m < kBeside_m) return {};
    if (there.found == kLeastObjects && there.here < there.found) return {};
    Place place = fitted(there.odom_from_base);
    if (place.found < there.found || place.apart_m > kMuchNearer * there.apart_m) return {};
    return place;
  }

  /// Poses that put two reference objects on two blobs: the kMostFits best ones.
  std::vector<Pose2> pairs() {
    std::vector<Place> all;
    for (const Pose2& pose : allPairs()) all.push_back(at(pose));
    std::stable_sort(all.begin(), all.end(), [](const Place& a, const Place& b) { return a.cost < b.cost; });
    std::vector<Pose2> best;
    for (std::size_t i = 0; i < std::min(all.size(), kMostFits); ++i) best.push_back(all[i].odom_from_base);
    return best;
  }

  /// Covariance of the fit, right perturbation.
  Eigen::Matrix3d covariance(const Place& place) {
    Eigen::Matrix3d h;
    step(place, h);
    Eigen::Matrix3d c = h.ldlt().solve(Eigen::Matrix3d::Identity());
    const Eigen::Matrix2d turn = place.odom_from_base.rotation();
    c.topLeftCorner<2, 2>() = (turn.transpose() * c.topLeftCorner<2, 2>() * turn).eval();
    c.topRightCorner<2, 1>() = (turn.transpose() * c.topRightCorner<2, 1>()).eval();
    c.bottomLeftCorner<1, 2>() = c.topRightCorner<2, 1>().transpose();
    return c;
  }

 private:
  std::vector<Pose2> allPairs() const {
    std::vector<Pose2> all;
    std::vector<std::vector<std::optional<Eigen::Vector2d>>> centres(objects_.size());
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      for (std::size_t b = 0; b < views_.size(); ++b) centres[i].push_back(centre(b, *objects_[i]));
    }
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      for (std::size_t j = i + 1; j < objects_.size(); ++j) {
        const Eigen::Vector2d in_odom = objects_[j]->position() - objects_[i]->position();
        if (in_odom.norm() < kBase_m) continue;
        for (std::size_t a = 0; a < views_.size(); ++a) {
          for (std::size_t b = 0; b < views_.size(); ++b) {
            if (a == b) continue;
            const auto &from = centres[i][a], &to = centres[j][b];
            if (!from || !to) continue;
            const Eigen::Vector2d in_base = *to - *from;
            if (std::abs(in_base.norm() - in_odom.norm()) > kPair_m) continue;
            const double theta =
                wrapAngle(std::atan2(in_odom.y(), in_odom.x()) - std::atan2(in_base.y(), in_base.x()));
            const Eigen::Vector2d t = 0.5 * (objects_[i]->position() + objects_[j]->position()) -
                                      Eigen::Rotation2Dd(theta) * Eigen::Vector2d(0.5 * (*from + *to));
            all.push_back({t.x(), t.y(), theta});
            if (all.size() == kMostPairs) return all;
          }
        }
      }
    }
    return all;
  }

  double ratio(const PrismFilter& object) const {
    return now_.camera_height_m > 0.0 ? std::clamp(1.0 - object.height() / now_.camera_height_m, 0.03, 1.0)
                                      : 1.0;
  }

  /// Centre of a blob as an object of that height, in base_link. Nothing if less than half of the directions
  /// are usable.
  std::optional<Eigen::Vector2d> centre(std::size_t blob, const PrismFilter& object) const {
    const View& view = views_[blob];
    const double shrink = ratio(object);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    std::size_t used = 0;
    for (std::size_t k = 0; k < view.size(); k += kStride) {
      if (!view.usable(k)) continue;
      const double phi = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(view.size());
      const Eigen::Vector3d row(1.0, std::cos(phi), std::sin(phi));
      const double b = view.supports.b_m[k];
      normal += row * row.transpose();
      right += (b < 0.0 ? b : shrink * b) * row;
      ++used;
    }
    if (2 * kStride * used < view.size()) return {};
    const Eigen::Vector3d solved = normal.ldlt().solve(right);
    if (!solved.allFinite()) return {};
    return now_.scan.origin_m + Eigen::Vector2d(solved.tail<2>());
  }

  /// One Gauss–Newton step in odom axes. `h` is its normal matrix, 1/σ².
  Eigen::Vector3d step(const Place& place, Eigen::Matrix3d& h) const {
    h.setZero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    const Pose2& pose = place.odom_from_base;
    const Eigen::Vector2d arm = pose.rotation() * now_.scan.origin_m;
    const Eigen::Vector2d foot = pose.translation() + arm, swing(-arm.y(), arm.x());
    for (std::size_t t = 0; t < objects_.size(); ++t) {
      if (place.blob_of[t] < 0) continue;
      const View& view = views_[static_cast<std::size_t>(place.blob_of[t])];
      const PrismFilter& object = *objects_[t];
      const double shrink = ratio(object);
      const Eigen::Vector2d to = object.position() - foot;
      for (std::size_t k = 0; k < view.size(); k += kStride) {
        if (!view.usable(k)) continue;
        constexpr double kTurn_rad = 1e-3;
        const double phi =
            pose.theta_rad + 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(view.size());
        const Eigen::Vector2d n(std::cos(phi), std::sin(phi)), across(-n.y(), n.x());
        const double b = view.supports.b_m[k];
        const double off = object.reach(phi) + n.dot(to) - (b < 0.0 ? b : shrink * b);
        const double slope =
            (object.reach(phi + kTurn_rad) - object.reach(phi - kTurn_rad)) / (2.0 * kTurn_rad);
        const Eigen::Vector3d row(-n.x(), -n.y(), slope + across.dot(to) - n.dot(swing));
        const double sigma = std::hypot(kSigma_m, static_cast<double>(view.supports.sigma_m[k]));
        const double weight =
            std::min(1.0, kHuber_m / std::max(1e-9, std::abs(off))) / (sigma * sigma * kCorrelation);
        h += weight * row * row.transpose();
        g += weight * off * row;
      }
    }
    h.diagonal().array() += 1e-6;
    return -h.ldlt().solve(g);
  }

  const LocalMap& now_;
  std::vector<const PrismFilter*> objects_;
  bool stationary_ = false;
  std::vector<View> views_;
};

/// The pose with the lowest χ². Nothing if a different pose has nearly the same χ².
const Place* best(const std::vector<const Place*>& all, std::size_t least) {
  const Place* best = nullptr;
  for (const Place* place : all) {
    if (place->here >= least && (best == nullptr || place->cost < best->cost)) best = place;
  }
  const bool rivalled =
      best != nullptr && std::any_of(all.begin(), all.end(), [&](const Place* place) {
        return place->cost < best->cost + kRival && !areSame(place->odom_from_base, best->odom_from_base);
      });
  return rivalled ? nullptr : best;
}

bool isNear(const Pose2& pose, const Pose2& other, double within_m, double within_rad) {
  const Pose2 by = pose.inverse() * other;
  return by.translation().norm() < within_m && std::abs(by.theta_rad) < within_rad;
}

/// The pose of the robot extrapolated with its last velocity; standing still if the velocity is unknown.
struct Extrapolation {
  Extrapolation(const OwnMotion& own, const Pose2& since, double dt_s_)
      : dt_s(dt_s_), odom_from_since(since), odom_from_base(since) {
    const auto way = own.extrapolate(dt_s);
    is_known = way.has_value();
    if (way) odom_from_base = since * *way;
  }
  /// True if no robot can change its speed by so much between two frames.
  bool isLeap(const Pose2& given) const {
    const double square = dt_s * dt_s;
    return !isNear(odom_from_base, given,
                   std::max(is_known ? kLeap_m : kFromRest_m, kAcceleration_mps2 * square),
                   std::max(is_known ? kLeap_rad : kFromRest_rad, kTurning_radps2 * square));
  }
  /// True if no robot can drive so far between two frames.
  bool isImpossible(const Pose2& given) const {
    return !isNear(odom_from_base, given, std::max(kFromRest_m, kBeyond_mps * dt_s), M_PI);
  }

  double dt_s;
  Pose2 odom_from_since, odom_from_base;
  bool is_known = false;
};

Motion withMotion(const Motion& given, const Pose2& way, const Eigen::Matrix3d& covariance) {
  Motion motion = given;
  motion.wheels_rejected = true;
  motion.previous_from_current = way;
  motion.covariance = covariance;
  return motion;
}

/// Result where no object shows the motion: reject the given motion, or return nothing.
std::optional<Motion> motionWithoutMatch(Search& search, const Place& given, const Motion& motion,
                                         const Extrapolation& extrapolation) {
  if (given.here > 0 || !extrapolation.isLeap(given.odom_from_base)) return {};
  if (extrapolation.is_known && search.at(extrapolation.odom_from_base).here > 0) {
    return withMotion(motion, extrapolation.odom_from_since.inverse() * extrapolation.odom_from_base,
                      squares(kLastVelocity_m, kLastVelocity_rad));
  }
  if (search.objectCount() < kLeastObjects && !extrapolation.isImpossible(given.odom_from_base)) return {};
  Motion unknown = motion;
  unknown.wheels_rejected = true;
  unknown.valid = false;
  return unknown;
}

}  // namespace

std::optional<Motion> checkMotion(const std::vector<TrackState>& tracks, const LocalMap& now,
                                  const OwnMotion& own) {
  const auto since = own.odomFromBaseAt(now.motion.since_ns);
  if (!now.motion.valid || !since || !now.motion.previous_from_current.isFinite()) return {};
  const Extrapolation extrapolation(own, *since,
                                    static_cast<double>(now.acquired_ns - now.motion.since_ns) * 1e-9);
  Search search(tracks, now);
  const Place given = search.at(*since * now.motion.previous_from_current);
  const auto corrected = [&](const Place& place) -> std::optional<Motion> {
    const Eigen::Matrix3d covariance = search.covariance(place);
    const Eigen::Vector3d off = (given.odom_from_base.inverse() * place.odom_from_base).vector();
    const Eigen::Matrix3d of_both = covariance + now.motion.covariance + squares(kFit_m, kFit_rad);
    if (off.dot(of_both.ldlt().solve(off)) < kGate) return {};
    return withMotion(now.motion, since->inverse() * place.odom_from_base,
                      covariance + squares(kFloor_m, kFloor_rad));
  };
  const std::size_t least = search.areStationary() ? kLeastObjects : kAnywhere;
  if (const auto beside = search.beside(given, least)) return corrected(*beside);
  if (given.cost < kGain) return motionWithoutMatch(search, given, now.motion, extrapolation);

  std::vector<Place> places{search.fitted(extrapolation.odom_from_base), search.fitted(*since)};
  for (const Pose2& start : search.pairs()) places.push_back(search.fitted(start));
  std::vector<const Place*> all, near;
  for (const Place& place : places) {
    if (place.cost + kGain > given.cost) continue;
    all.push_back(&place);
    // Two objects show no leap while one of them matches the given motion.
    if (given.here > 0 && place.here < kAnywhere &&
        !isNear(given.odom_from_base, place.odom_from_base, kLeap_m, kLeap_rad))
      continue;
    if (isNear(extrapolation.odom_from_base, place.odom_from_base, kNear_m, kNear_rad) ||
        isNear(*since, place.odom_from_base, kNear_m, kNear_rad))
      near.push_back(&place);
  }
  const bool leaps = extrapolation.is_known && extrapolation.isLeap(given.odom_from_base);
  const Place* place = best(near, leaps ? kLeastObjects : least);
  if (place == nullptr) place = best(all, kAnywhere);
  return place != nullptr ? corrected(*place) : motionWithoutMatch(search, given, now.motion, extrapolation);
}

}  // namespace omnifleet::tracking
