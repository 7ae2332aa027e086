#include "tracking/seen_step.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "tracking/outline_split.h"

namespace omnifleet::tracking {
namespace {

constexpr std::size_t kLeastThings = 2, kAnywhere = 3;
constexpr double kNear_m = 0.5, kNear_rad = 0.5;      // how far two things alone may tell
constexpr double kLeap_m = 0.15, kLeap_rad = 0.3;     // from going on
constexpr double kSetOff_m = 0.5, kSetOff_rad = 1.0;  // from standing, on the first frames
constexpr double kBeyond_mps = 3.0;
constexpr double kOn_m = 0.1, kOn_rad = 0.2;       // σ of going on where one thing bears it out
constexpr double kOutline_m = 0.01, kMost = 16.0;  // σ of a typical distance; χ² of what is not there
constexpr double kGain = 20.0,
                 kRival = 8.0;     // χ² that a motion must be better by: than the told, than others
constexpr double kHere_m = 0.04;   // typical distance of outlines: it is where it should be
constexpr double kCatch_m = 0.15;  // from which a fit comes to it
constexpr double kBeside_m = 0.012, kMuchNearer = 0.3;  // of outlines; share of it after the fit
constexpr double kGate = 16.3;                          // χ² (3 dof, 99.9 %) between what is told and seen
constexpr double kFar_m = 0.5;                          // of a blob's foot from a thing's edge: another one
constexpr double kPair_m = 0.08, kBase_m = 0.3;         // between two distances; between two things
constexpr double kSame_m = 0.06, kSame_rad = 0.1;       // of two motions
constexpr int kFits = 4;
constexpr std::size_t kMostPairs = 300, kMostFits = 12;  // bounds of the work
constexpr std::size_t kStride = 2;                       // directions from one taken to the next
constexpr double kSigma_m = 0.01, kHuber_m = 0.02, kCorrelation = 8.0;  // of a direction of an outline
constexpr double kFit_m = 0.004, kFit_rad = 0.003;    // σ that a fit has beside its own, to refute …
constexpr double kFloor_m = 0.01, kFloor_rad = 0.01;  // … and to be believed
constexpr int kKnown = 3;                             // views of what stands

Eigen::Matrix3d squares(double sigma_m, double sigma_rad) {
  return Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
}

bool areSame(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() < kSame_m &&
         std::abs(wrapAngle(a.theta_rad - b.theta_rad)) < kSame_rad;
}

/// A place of the robot in odom, and which blob each thing is then (−1: none).
struct Place {
  Pose2 odom_from_base;
  std::vector<int> blob_of;
  std::size_t found = 0, here = 0;  ///< all, and those that are where they should be
  double apart_m = 0.0;             ///< mean of those found
  double cost = 0.0;                ///< χ² of all things
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
      if (!track.moving && track.views >= kKnown) things_.push_back(&track.filter);
      if (!is_robot) perhaps.push_back(&track.filter);
    }
    stand_ = things_.size() >= kLeastThings;
    if (!stand_) things_ = std::move(perhaps);
    views_.resize(now.objects.size());
    for (std::size_t b = 0; b < views_.size(); ++b) {
      views_[b].supports = now.objects[b].supports;
      views_[b].camera_height_m = now.camera_height_m;
    }
  }

  /// These are known to stand; else they have not been judged yet, as on the first frames.
  bool stand() const { return stand_; }
  std::size_t things() const { return things_.size(); }

  Place at(const Pose2& odom_from_base, double within_m = kCatch_m) {
    Place place;
    place.odom_from_base = odom_from_base;
    place.blob_of.assign(things_.size(), -1);
    for (View& view : views_) {
      view.foot_m = odom_from_base * now_.scan.origin_m;
      view.heading_rad = odom_from_base.theta_rad;
    }
    struct Pair {
      double apart_m;
      std::size_t thing, blob;
    };
    std::vector<Pair> pairs;
    for (std::size_t t = 0; t < things_.size(); ++t) {
      for (std::size_t b = 0; b < views_.size(); ++b) {
        const double away_m = (odom_from_base * now_.objects[b].contact_m - things_[t]->position()).norm();
        if (away_m > things_[t]->radius() + kFar_m) continue;
        const double apart_m = outlineDistance(views_[b], *things_[t]);
        if (apart_m < within_m) pairs.push_back({apart_m, t, b});
      }
    }
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const Pair& a, const Pair& b) { return a.apart_m < b.apart_m; });
    std::vector<bool> taken(views_.size(), false);
    for (const Pair& pair : pairs) {
      if (place.blob_of[pair.thing] >= 0 || taken[pair.blob]) continue;
      place.blob_of[pair.thing] = static_cast<int>(pair.blob);
      taken[pair.blob] = true;
      ++place.found;
      place.cost += std::min(kMost, pair.apart_m * pair.apart_m / (kOutline_m * kOutline_m));
      place.here += pair.apart_m < kHere_m ? 1 : 0;
      place.apart_m += pair.apart_m;
    }
    place.cost += kMost * static_cast<double>(things_.size() - place.found);
    if (place.found > 0) place.apart_m /= static_cast<double>(place.found);
    return place;
  }

  /// Where the outlines bring the robot from there.
  Place fitted(const Pose2& from) {
    Place place = at(from);
    for (int i = 0; i < kFits && place.found >= kLeastThings; ++i) {
      Eigen::Matrix3d h;
      const Eigen::Vector3d d = step(place, h);
      Pose2 next = place.odom_from_base;
      next.x_m += d.x(), next.y_m += d.y(), next.theta_rad = wrapAngle(next.theta_rad + d.z());
      if (!next.isFinite()) break;
      place = at(next, i + 2 < kFits ? kCatch_m : kHere_m);
    }
    return place;
  }

  /// Not there, but so near that the same things are the same blobs; nothing where it is there. Of two things
  /// one of which is where it should be the other has changed: a piece of a wall, that ends where it is
  /// hidden.
  std::optional<Place> beside(const Place& there, std::size_t least) {
    if (there.found < least || there.apart_m < kBeside_m) return {};
    if (there.found == kLeastThings && there.here < there.found) return {};
    Place place = fitted(there.odom_from_base);
    if (place.found < there.found || place.apart_m > kMuchNearer * there.apart_m) return {};
    return place;
  }

  /// Places from which two of the things are where two blobs are: those that explain most, a few.
  std::vector<Pose2> pairs() {
    std::vector<Place> all;
    for (const Pose2& pose : allPairs()) all.push_back(at(pose));
    std::stable_sort(all.begin(), all.end(), [](const Place& a, const Place& b) { return a.cost < b.cost; });
    std::vector<Pose2> best;
    for (std::size_t i = 0; i < std::min(all.size(), kMostFits); ++i) best.push_back(all[i].odom_from_base);
    return best;
  }

  /// Of the fit, right perturbation.
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
    std::vector<std::vector<std::optional<Eigen::Vector2d>>> centres(things_.size());
    for (std::size_t i = 0; i < things_.size(); ++i) {
      for (std::size_t b = 0; b < views_.size(); ++b) centres[i].push_back(centre(b, *things_[i]));
    }
    for (std::size_t i = 0; i < things_.size(); ++i) {
      for (std::size_t j = i + 1; j < things_.size(); ++j) {
        const Eigen::Vector2d in_odom = things_[j]->position() - things_[i]->position();
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
            const Eigen::Vector2d t = 0.5 * (things_[i]->position() + things_[j]->position()) -
                                      Eigen::Rotation2Dd(theta) * Eigen::Vector2d(0.5 * (*from + *to));
            all.push_back({t.x(), t.y(), theta});
            if (all.size() == kMostPairs) return all;
          }
        }
      }
    }
    return all;
  }

  double ratio(const PrismFilter& thing) const {
    return now_.camera_height_m > 0.0 ? std::clamp(1.0 - thing.height() / now_.camera_height_m, 0.03, 1.0)
                                      : 1.0;
  }

  /// Of a blob as a thing of that height, in base_link; nothing where too little of it is seen.
  std::optional<Eigen::Vector2d> centre(std::size_t blob, const PrismFilter& thing) const {
    const View& view = views_[blob];
    const double shrink = ratio(thing);
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

  /// One Gauss–Newton step, in odom axes; `h`: its normal matrix, 1/σ².
  Eigen::Vector3d step(const Place& place, Eigen::Matrix3d& h) const {
    h.setZero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    const Pose2& pose = place.odom_from_base;
    const Eigen::Vector2d arm = pose.rotation() * now_.scan.origin_m;
    const Eigen::Vector2d foot = pose.translation() + arm, swing(-arm.y(), arm.x());
    for (std::size_t t = 0; t < things_.size(); ++t) {
      if (place.blob_of[t] < 0) continue;
      const View& view = views_[static_cast<std::size_t>(place.blob_of[t])];
      const PrismFilter& thing = *things_[t];
      const double shrink = ratio(thing);
      const Eigen::Vector2d to = thing.position() - foot;
      for (std::size_t k = 0; k < view.size(); k += kStride) {
        if (!view.usable(k)) continue;
        constexpr double kTurn_rad = 1e-3;
        const double phi =
            pose.theta_rad + 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(view.size());
        const Eigen::Vector2d n(std::cos(phi), std::sin(phi)), across(-n.y(), n.x());
        const double b = view.supports.b_m[k];
        const double off = thing.reach(phi) + n.dot(to) - (b < 0.0 ? b : shrink * b);
        const double slope =
            (thing.reach(phi + kTurn_rad) - thing.reach(phi - kTurn_rad)) / (2.0 * kTurn_rad);
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
  std::vector<const PrismFilter*> things_;
  bool stand_ = false;
  std::vector<View> views_;
};

/// The place that explains most; nothing where another explains nearly as much.
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

/// Where the robot is if it goes on as it went in its last step; stands where that is not known.
struct GoingOn {
  GoingOn(const OwnMotion& own, const Pose2& since, double dt_s_)
      : dt_s(dt_s_), odom_from_since(since), odom_from_base(since) {
    const auto way = own.goingOn(dt_s);
    is_known = way.has_value();
    if (way) odom_from_base = since * *way;
  }
  bool isLeap(const Pose2& told) const {
    return !isNear(odom_from_base, told, is_known ? kLeap_m : kSetOff_m, is_known ? kLeap_rad : kSetOff_rad);
  }
  /// No robot's speed changes by so much from one frame to the next.
  bool isBeyondAll(const Pose2& told) const {
    return !isNear(odom_from_base, told, std::max(kSetOff_m, kBeyond_mps * dt_s), M_PI);
  }

  double dt_s;
  Pose2 odom_from_since, odom_from_base;
  bool is_known = false;
};

Motion withMotion(const Motion& told, const Pose2& way, const Eigen::Matrix3d& covariance) {
  Motion motion = told;
  motion.refuted = true;
  motion.previous_from_current = way;
  motion.covariance = covariance;
  return motion;
}

/// What is known where nothing seen tells the motion: that it was not as told, or nothing.
std::optional<Motion> unseenStep(Search& search, const Place& told, const Motion& motion, const GoingOn& on) {
  if (told.here > 0 || !on.isLeap(told.odom_from_base)) return {};
  if (on.is_known && search.at(on.odom_from_base).here > 0) {
    return withMotion(motion, on.odom_from_since.inverse() * on.odom_from_base, squares(kOn_m, kOn_rad));
  }
  if (search.things() < kLeastThings && !on.isBeyondAll(told.odom_from_base)) return {};
  Motion unknown = motion;
  unknown.refuted = true;
  unknown.valid = false;
  return unknown;
}

}  // namespace

std::optional<Motion> seenStep(const std::vector<TrackState>& tracks, const LocalMap& now,
                               const OwnMotion& own) {
  const auto since = own.odomFromBaseAt(now.motion.since_ns);
  if (!now.motion.valid || !since || !now.motion.previous_from_current.isFinite()) return {};
  const GoingOn on(own, *since, static_cast<double>(now.acquired_ns - now.motion.since_ns) * 1e-9);
  Search search(tracks, now);
  const Place told = search.at(*since * now.motion.previous_from_current);
  const auto as_seen = [&](const Place& place) -> std::optional<Motion> {
    const Eigen::Matrix3d covariance = search.covariance(place);
    const Eigen::Vector3d off = (told.odom_from_base.inverse() * place.odom_from_base).vector();
    const Eigen::Matrix3d of_both = covariance + now.motion.covariance + squares(kFit_m, kFit_rad);
    if (off.dot(of_both.ldlt().solve(off)) < kGate) return {};
    return withMotion(now.motion, since->inverse() * place.odom_from_base,
                      covariance + squares(kFloor_m, kFloor_rad));
  };
  const std::size_t least = search.stand() ? kLeastThings : kAnywhere;
  if (const auto beside = search.beside(told, least)) return as_seen(*beside);
  if (told.cost < kGain) return unseenStep(search, told, now.motion, on);

  std::vector<Place> places{search.fitted(on.odom_from_base), search.fitted(*since)};
  for (const Pose2& start : search.pairs()) places.push_back(search.fitted(start));
  std::vector<const Place*> all, near;
  for (const Place& place : places) {
    if (place.cost + kGain > told.cost) continue;
    all.push_back(&place);
    // Two things tell no leap while one of them is where it should be.
    if (told.here > 0 && place.here < kAnywhere &&
        !isNear(told.odom_from_base, place.odom_from_base, kLeap_m, kLeap_rad))
      continue;
    if (isNear(on.odom_from_base, place.odom_from_base, kNear_m, kNear_rad) ||
        isNear(*since, place.odom_from_base, kNear_m, kNear_rad))
      near.push_back(&place);
  }
  const bool leaps = on.is_known && on.isLeap(told.odom_from_base);
  const Place* place = best(near, leaps ? kLeastThings : least);
  if (place == nullptr) place = best(all, kAnywhere);
  return place != nullptr ? as_seen(*place) : unseenStep(search, told, now.motion, on);
}

}  // namespace omnifleet::tracking
