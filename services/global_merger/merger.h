#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dataset/map_files.h"
#include "global_merger/trajectories.h"
#include "observation/observation.h"
#include "occupancy/contribution.h"
#include "occupancy/map_rays.h"
#include "occupancy/occupancy_map.h"
#include "options/options.h"
#include "outline/prism.h"
#include "structure/polylines.h"

namespace omnifleet::global_merger {

struct KeyframeOptions {
  double distance_m = 0.02;      ///< m moved since the last keyframe
  double rotation_rad = 0.05;    ///< rad turned since the last keyframe
  double interval_s = 0.5;       ///< s, interval of keyframes at rest
  double min_interval_s = 0.15;  ///< s, shortest interval (limits the traffic)
  double at_rest_share = 0.1;    ///< 1, interval at rest per time since the last change, up to `at_rest_s`
  double at_rest_s = 10.0;       ///< s, longest interval at rest
  /// m and rad, largest σ of a pose that only odometry determines at which its frame is mapped: about half a
  /// cell of 5 cm, and as much 1.5 m away. Larger cells allow more.
  double odometry_sigma_m = 0.03, odometry_sigma_rad = 0.02;
  occupancy::MapRaysOptions rays;

  static KeyframeOptions read(const options::Section& section);
};

/// Selects the keyframes among one robot's frames and makes their contributions (the local map of Choi
/// §IV.4). Contributions are kept permanently, so a robot at rest that sees nothing new makes them less and
/// less often.
class ContributionMaker {
 public:
  explicit ContributionMaker(const KeyframeOptions& options) : options_(options), rays_(options.rays) {}

  struct Made {
    occupancy::Contribution contribution;
    occupancy::KeyframePose pose;
  };
  /// `pose`: of the same robot and time as `objects`. Returns nothing if either is invalid, if their times
  /// differ or do not increase, or if the frame is not a keyframe.
  std::optional<Made> make(const Objects& objects, const PoseEstimate& pose);

 private:
  /// An object seen in the last keyframe.
  struct SeenObject {
    std::uint32_t track_id = 0;
    ObjectKind kind = ObjectKind::kUnknown;
    Eigen::Vector2d position_m = Eigen::Vector2d::Zero();  ///< base_link
  };
  bool seesChange(const Objects& objects) const;
  bool isDue(const Objects& objects, const Pose2& map_from_base);

  KeyframeOptions options_;
  occupancy::MapRays rays_;
  bool any_ = false;
  TimeNs last_ns_ = 0;
  TimeNs changed_ns_ = 0;  ///< last motion of the robot or change of the objects that it sees
  Pose2 last_map_from_base_;
  std::vector<SeenObject> last_objects_;
};

struct MergerOptions {
  std::string method = "prism";  ///< prism: fitted over all views | hull: overlay of hulls, Choi §IV.4
  double hull_share =
      0.5;  ///< 1, method hull: share of an object's views that must cover the part that is kept
  std::vector<std::string> observers;  ///< robots whose views shape the outlines; empty: all
  outline::PrismOptions prism;
  double gate_m = 0.12;        ///< m, views of one object have their centres within this distance
  double min_solidity = 0.94;  ///< 1, a silhouette below it is merged from several objects
  double max_contact_m = 2.8;  ///< m, views from farther away do not shape outlines
  double robot_rms_m = 0.05;   ///< m, a known body that fits with a smaller rms may be a robot
  double robot_gap_m = 0.20;   ///< m, what fits a robot's body within this distance of its pose is that robot
  int min_views = 3;           ///< live: views before an outline is published; at the end the fit decides
  double max_spread = 4.0;     ///< σ, views that disagree by more do not show one body
  double seldom_rms_m = 0.015;  ///< m, fewer than 20 views with a larger rms are no object
                                ///< (objects in 26 rooms: 0.012 at most)
  double max_sigma_m = 0.05;    ///< m, a centre with a larger σ is no object
  double flat_m = 0.02;         ///< m, what is surely lower is a floor marking
  double least_alone = 0.5;     ///< 1, share of the occupied cells connected with an outline that must lie at
                                ///< it: otherwise it stands against something
  double least_seen = 0.75;  ///< 1, share of the outline of an object whose top was not seen that must have
                             ///< been seen: otherwise it would be closed by guessing
  structure::PolylineOptions structure;
  /// Whether map.pgm, map.png and topic map/grid also show cells that contradict others (visible_map.h):
  /// every hit is mapped, as in Ahmed et al. 2013 §2.3.
  bool hidden_cells = false;
  int gone_after =
      3;  ///< contributions that later, from as near, saw the floor through its centre: it is gone

  static MergerOptions read(const options::Section& section);
};

struct Candidate;
struct Group;
struct Verdict;
enum class Reason : std::uint8_t;

/// A place where several views saw a candidate that is not in the map, and the reason.
struct RejectedCandidate {
  Eigen::Vector2d at_m = Eigen::Vector2d::Zero();  ///< map
  Reason reason{};
  int observations = 0;  ///< number of views
};

/// Called between the fits of outlines, which together take longer than a frame may wait.
using Meanwhile = std::function<void()>;

/// One replica of the map (Ahmed §2: every robot holds one). All results are functions of the sets of
/// contributions and poses that it holds. It holds the poses of all frames and uses those in its own one.
class Merger {
 public:
  /// @param frame of the map, as in PoseEstimate::frame: empty for the common map, or a robot's name
  Merger(const MergerOptions& options, const occupancy::OccupancyOptions& occupancy_options,
         const std::map<std::string, RobotBody>& bodies, std::string frame = {});

  /// Lenses of the robots' cameras; call before anything is added. Equidistant for robots that are not
  /// listed.
  void setLenses(std::map<std::string, lens::Spread> lenses) { map_.setLenses(std::move(lenses)); }
  /// Returns true if the set changed.
  bool add(const occupancy::Contribution& contribution);
  bool add(const occupancy::KeyframePose& pose);
  /// Live: after a change of a camera error, contributions are corrected a few at a time by correctSome(), so
  /// that no frame is delayed.
  void correctLater() { map_.correctLater(); }
  /// Returns false if there is nothing to correct.
  bool correctSome(std::size_t at_most);
  /// Every pose sample of the localizer. Valid ones are used for the trajectories, all of them for
  /// localization().
  void addTrajectory(const PoseEstimate& pose) { trajectories_.add(pose, frame()); }

  const std::string& frame() const { return map_.store().frame(); }
  const occupancy::OccupancyMap& map() const { return map_; }
  /// OccupancyMap::grid(), with the cells that are hidden there if the options say so.
  dataset::OccupancyGrid grid(const std::vector<dataset::MapObject>& objects) const;
  const std::map<std::string, RobotBody>& bodies() const { return bodies_; }
  /// Of the robots that have a pose in this map.
  std::map<std::string, Trajectories::Trajectory> trajectories() const {
    return trajectories_.of(map_.store());
  }
  /// States and events of all pose samples of all robots, valid or not, in order of time.
  const std::map<std::string, std::vector<dataset::StampedLocalization>>& localization() const {
    return trajectories_.localization();
  }
  /// Frame of the robot's latest valid pose. Empty if it has none. Poses that were published again count
  /// instead of the samples of their time.
  std::optional<std::string> frameOf(const std::string& robot) const;

  /// Obstacles fitted over all views and the structure around them, ordered by id; found again only if the
  /// sets changed. What `meanwhile`
  /// adds to the sets is used by the next call.
  const std::vector<dataset::MapObject>& outlines(const Meanwhile& meanwhile = {});
  /// The outlines as last fitted.
  const std::vector<dataset::MapObject>& lastOutlines() const { return outlines_; }
  /// Rejected candidates, at most one within 0.3 m. Live: so far.
  const std::vector<RejectedCandidate>& rejected() const { return rejected_; }
  /// The same with the codes of the reasons.
  std::vector<dataset::RejectedPlace> rejectedPlaces() const;
  /// At run/end: decides undecided candidates by fit and covariance, and updates the cells. Idempotent.
  void finish();

  /// Writes map.bt, map.pgm, map.yaml, map.png, objects.geojson, trajectories/<robot>.tum,
  /// covariances/<robot>.csv and localization/<robot>.csv (save.h). Returns one line per file that could not
  /// be written. Empty: all files are saved.
  std::vector<std::string> save(const std::string& folder);
  /// The same with the outlines as last fitted: for live runs, where fitting all outlines would delay frames.
  std::vector<std::string> saveAsFitted(const std::string& folder) const;

 private:
  std::vector<Verdict> judge(const std::vector<Group>& groups) const;
  bool wasDrivenAt(const Eigen::Vector2d& at_m, double within_m) const;
  void findFloorMarkings(const std::vector<Group>& groups, const std::vector<Verdict>& verdicts);
  void addTopFaces(const std::vector<Candidate>& candidates, const Meanwhile& meanwhile,
                   std::vector<Group>& groups) const;
  void findRejected(const std::vector<Group>& groups, const std::vector<Verdict>& verdicts);
  void findStructure();

  MergerOptions options_;
  std::map<std::string, RobotBody> bodies_;
  occupancy::OccupancyMap map_;
  Trajectories trajectories_;
  std::vector<Eigen::Vector2d> driven_m_;  ///< positions of the trajectories when the outlines were fitted
  std::vector<dataset::MapObject> outlines_;
  std::vector<RejectedCandidate> rejected_;
  std::vector<Eigen::Vector2d> standing_m_;  ///< centres of candidates that stand there with an open outline
  std::map<std::pair<std::string, std::uint32_t>, ObjectKind>
      kinds_;             ///< of the tracks that form the outlines; unknown: floor markings
  bool is_stale_ = true;  ///< the sets changed since the outlines were fitted
  bool finished_ = false;
};

}  // namespace omnifleet::global_merger
