#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"
#include "observation/observation.h"
#include "occupancy/contribution.h"
#include "occupancy/occupancy_map.h"
#include "options/options.h"
#include "outline/prism.h"

namespace omnifleet::global_merger {

struct KeyframeOptions {
  double distance_m = 0.02;      ///< m moved since the last keyframe
  double rotation_rad = 0.05;    ///< rad turned since the last keyframe
  double interval_s = 0.5;       ///< s, a standing robot gives one this often
  double min_interval_s = 0.15;  ///< s, never more often (traffic)
  double at_rest_share = 0.1;  ///< 1, of the time since anything was new: standing, not sooner than this …
  double at_rest_s = 10.0;     ///< s, … but this often

  static KeyframeOptions read(const options::Section& section);
};

/// Which of one robot's frames are keyframes, and what they give. Choi §IV.4's local map to be overlaid.
/// Contributions are kept for ever, so a robot that stands and sees nothing new gives them ever more rarely.
class ContributionMaker {
 public:
  explicit ContributionMaker(const KeyframeOptions& options) : options_(options) {}

  struct Made {
    occupancy::Contribution contribution;
    occupancy::KeyframePose pose;
  };
  /// `pose` of the same robot and time as `objects`. Nothing where either is invalid, where times do not
  /// agree, do not grow, or where the frame is no keyframe.
  std::optional<Made> make(const Objects& objects, const PoseEstimate& pose);

 private:
  /// A thing that the last keyframe saw.
  struct Thing {
    std::uint32_t track_id = 0;
    ObjectKind kind = ObjectKind::kUnknown;
    Eigen::Vector2d position_m = Eigen::Vector2d::Zero();  ///< base_link
  };
  bool seesOthers(const Objects& objects) const;
  bool isDue(const Objects& objects, const Pose2& map_from_base);

  KeyframeOptions options_;
  bool any_ = false;
  TimeNs last_ns_ = 0;
  TimeNs news_ns_ = 0;  ///< when the robot moved, or something else than before was seen
  Pose2 last_map_from_base_;
  std::vector<Thing> last_things_;
};

struct MergerOptions {
  std::string method = "prism";        ///< prism: fitted over all views | hull: Choi §IV.4, hulls overlaid
  double hull_share = 0.5;             ///< 1, "hull": of the views of a thing that must cover what is kept
  std::vector<std::string> observers;  ///< robots whose views shape the outlines; empty: all
  outline::PrismOptions prism;
  double gate_m = 0.12;         ///< m, views of one object have their centres this near
  double min_solidity = 0.94;   ///< below it a silhouette is merged of several
  double max_contact_m = 2.8;   ///< m, views from farther away do not shape outlines
  double robot_rms_m = 0.05;    ///< m, a known body that fits this well may be a robot
  double robot_gap_m = 0.20;    ///< m, what fits a robot's body this near its pose is that robot
  int min_views = 3;            ///< live: views before an outline is published; the end decides by fit
  double max_spread = 4.0;      ///< in σ, views that disagree more than this do not show one body
  double seldom_rms_m = 0.015;  ///< m, what is seen in fewer than 20 views and fits worse is no object
                                ///< (things in 26 rooms: 0.012 at most)
  double max_sigma_m = 0.05;    ///< m, a centre less certain than this is no object
  double flat_m = 0.02;         ///< m, what is surely lower is a mark on the floor
  int gone_after = 3;  ///< contributions that later, as near, saw the floor through its middle: it has gone

  static MergerOptions read(const options::Section& section);
};

struct Candidate;
struct Group;

/// A place where several views saw something that is not in the map.
struct Unmapped {
  enum class Why : std::uint8_t {
    kNoShape,    ///< the views do not agree on what
    kFlat,       ///< it is no higher than a mark on the floor, or low and seldom seen
    kFloorSeen,  ///< the floor was seen there, too: it has gone, or is hardly to be told from the floor
    kFloats,  ///< mostly the floor was, yet parallax gives it a height: a top whose sides look like the floor
  };
  Eigen::Vector2d at_m = Eigen::Vector2d::Zero();  ///< map
  Why why = Why::kNoShape;
};

/// What is done between the fits of outlines, which together take longer than a frame may wait.
using Meanwhile = std::function<void()>;

/// One replica of the map (Ahmed §2: every robot holds one). All that it tells is a function of the sets it
/// holds.
class Merger {
 public:
  Merger(const MergerOptions& options, const occupancy::OccupancyOptions& occupancy_options,
         const std::map<std::string, RobotBody>& bodies);

  /// Of the robots' cameras, before anything is added; equidistant where nothing is said.
  void setLenses(std::map<std::string, lens::Spread> lenses) { map_.setLenses(std::move(lenses)); }
  /// True when the set changed.
  bool add(const occupancy::Contribution& contribution);
  bool add(const occupancy::KeyframePose& pose);
  /// Live: what another error of a camera changes is put anew a few contributions at a time, when
  /// correctSome() asks, so that no frame is held up.
  void correctLater() { map_.correctLater(); }
  /// False where there is nothing to correct.
  bool correctSome(std::size_t at_most);
  /// Every pose estimate, for the trajectories alone; invalid ones are left out.
  void addTrajectory(const PoseEstimate& pose);

  const occupancy::OccupancyMap& map() const { return map_; }
  const std::map<std::string, RobotBody>& bodies() const { return bodies_; }
  const std::map<std::string, std::vector<dataset::StampedPose>>& trajectories() const {
    return trajectories_;
  }
  /// Of the trajectories' poses, row by row.
  const std::map<std::string, std::vector<dataset::StampedCovariance>>& covariances() const {
    return covariances_;
  }

  /// Obstacles fitted over all views held, in order of id; fitted anew only when the sets changed. What
  /// `meanwhile` adds to the sets is for the next time.
  const std::vector<dataset::MapObject>& outlines(const Meanwhile& meanwhile = {});
  /// As they were fitted last.
  const std::vector<dataset::MapObject>& lastOutlines() const { return outlines_; }
  /// Since finish(): at most one within 0.3 m.
  const std::vector<Unmapped>& unmapped() const { return unmapped_; }
  /// Since finish(): the middles of outlines where the floor was seen, too: things hardly to be told from it.
  const std::vector<Eigen::Vector2d>& faint() const { return faint_m_; }
  /// Likewise of outlines that hardly any view shows by themselves, and that the views do not quite agree on,
  /// or on which they do not agree at all.
  const std::vector<Eigen::Vector2d>& unclear() const { return unclear_m_; }
  /// At run/end: undecided candidates are decided by fit and covariance; cells follow. Idempotent.
  void finish();

  /// Writes map.bt, map.pgm, map.yaml, map.png, objects.geojson, trajectories/<robot>.tum and
  /// covariances/<robot>.csv, each whole or not at all. Returns one line per file that could not be written
  /// (the old one is then untouched); empty: all is saved.
  std::vector<std::string> save(const std::string& folder);
  /// The same with the outlines as last fitted: live, where a fit of all would hold frames up.
  std::vector<std::string> saveAsFitted(const std::string& folder) const;

 private:
  bool isOneThing(const Group& group) const;
  bool isObject(const Group& group) const;
  std::optional<Unmapped::Why> whyUnmapped(const Group& group) const;
  bool isWay(const Eigen::Vector2d& at_m, double within_m) const;
  void findMarks(const std::vector<Group>& groups);
  void addTops(const std::vector<Candidate>& candidates, const Meanwhile& meanwhile,
               std::vector<Group>& groups) const;
  void findUnmapped(const std::vector<Group>& groups);

  MergerOptions options_;
  std::map<std::string, RobotBody> bodies_;
  occupancy::OccupancyMap map_;
  std::map<std::string, std::vector<dataset::StampedPose>> trajectories_;
  std::map<std::string, std::vector<dataset::StampedCovariance>> covariances_;
  std::vector<dataset::MapObject> outlines_;
  std::vector<Unmapped> unmapped_;
  std::vector<Eigen::Vector2d> faint_m_, unclear_m_;
  std::map<std::pair<std::string, std::uint32_t>, ObjectKind>
      kinds_;             ///< of the tracks behind outlines; unknown: of marks
  bool is_stale_ = true;  ///< the sets changed since the outlines were fitted
  bool finished_ = false;
};

}  // namespace omnifleet::global_merger
