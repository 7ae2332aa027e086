#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <variant>
#include <vector>

#include "bus/service.h"
#include "common/inlet.h"
#include "common/overlap_check.h"
#include "dataset/dataset.h"
#include "fleet/fleet.h"
#include "localizer/ceiling_agreement.h"
#include "localizer/ceiling_wait.h"
#include "localizer/estimator_stage.h"
#include "localizer/marked_robots.h"
#include "localizer/observation_frames.h"
#include "localizer/pose_gaps.h"
#include "localizer/state_recovery.h"

namespace omnifleet::services {

/// The fleet's estimator. Input: objects of every robot and measurements of every front end. Output: one pose
/// per robot and frame, corrections of frames whose poses changed (`map/keyframe_pose`), and messages about
/// errors found in the fleet description, each reported once. For robots without a camera that report ranges
/// and bearings it also integrates the wheels, makes their frames and publishes the landmarks they see as
/// their objects. At the end of a run it publishes the smoothed poses as corrected keyframe poses. A
/// localizer that is restarted during a run begins at the latest poses of the robots in the map, and
/// publishes no valid pose before it knows them.
class LocalizerService : public bus::Service {
 public:
  /// What a localizer of another machine has heard before it takes over.
  struct Takeover {
    std::map<std::string, occupancy::KeyframePose> latest;  ///< keyframe pose of each robot
  };

  LocalizerService(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                   const std::optional<Takeover>& takeover = std::nullopt);

  std::vector<bus::Expectation> expectations() const override;
  void start() override;
  bool spin() override;
  bool background() override;
  bool finished() const override { return ended_; }
  void drain() override;
  std::optional<bus::Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    return merger_.waitingFor(now);
  }
  std::optional<std::chrono::steady_clock::time_point> wakeAt() const override {
    if (recovery_deadline_) {
      return std::chrono::steady_clock::now() < heard_deadline_ ? heard_deadline_ : *recovery_deadline_;
    }
    return ceiling_wait_ ? ceiling_wait_->until() : std::nullopt;
  }
  /// Returns false if a run has ended in which frames arrived but no robot was ever localized: there is no
  /// map.
  bool succeeded() const override;

 private:
  struct Measurements {
    std::vector<Measurement> values;
  };
  using Report = localizer::ObservationFrames::Report;
  using Payload = std::variant<std::monostate, Objects, Measurements, Report, dataset::WheelRow>;
  struct RobotOutputs {
    Outlet<v1::Pose> pose;
    Outlet<v1::KeyframePose> correction;
    Outlet<v1::Alignment> alignment;
    Outlet<v1::Place> place;
    std::optional<Outlet<v1::Objects>> objects;  ///< of a robot without a camera
    Message reported;                            ///< last message about the robot
  };

  void readCameras(const fleet::Fleet& fleet);
  void readMeasurements(const fleet::Fleet& fleet);
  void readObservers(const fleet::Fleet& fleet);
  void addOutputs(const fleet::Fleet& fleet, const std::string& robot);

  bool pull();
  bool isRecovering();
  bool waitsForCeiling();
  bool isPast(const std::string& robot) const;
  void addRecoveredPoses();
  void process();
  void takeWheels();
  void publishPose(PoseEstimate pose);
  void checkTimes();
  void reportTimes();
  void noteLocalized(const PoseEstimate& pose);
  void reportNeverLocalized();
  void notePublished(std::size_t published, const std::vector<PoseEstimate>& poses);
  void publishObjects(const Report& report);
  bool refine();
  bool reportFindings(std::size_t at_most);
  bool publishAlignments();
  bool publishPlaces();
  void publishCorrections(const std::vector<PoseEstimate>& poses);
  void finish(const std::string& reason);

  bus::ServiceContext context_;
  bus::TimeMerger<Payload> merger_;
  bus::TimeMerger<Payload>::Batch batch_;
  RunEnds ends_;
  adapters::RunClock clock_;
  LiveTimes live_times_;
  std::vector<std::unique_ptr<Inlet<v1::Objects, Payload>>> objects_;
  std::vector<std::unique_ptr<Inlet<v1::Measurement, Payload>>> measurements_, reports_;
  std::vector<OverlapCheck> measurement_checks_;      ///< of measurements_
  std::map<std::string, OverlapCheck> wheel_checks_;  ///< by robot: wheels beside observations
  std::vector<std::unique_ptr<Inlet<v1::WheelOdometry, Payload>>> wheels_;
  std::map<int, std::string> robot_of_wheels_;  ///< by stream
  std::map<std::string, RobotOutputs> outputs_;
  estimation::EstimatorOptions estimator_options_;
  std::uint32_t term_;  ///< of the published poses; the mergers' own first estimates have term 0
  std::map<std::string, Pose2> own_frames_;  ///< robots that begin in a frame of their own
  localizer::EstimatorStage estimator_;
  localizer::ObservationFrames observation_frames_;
  localizer::MarkedRobots marked_robots_;
  localizer::CeilingAgreement agreement_;
  std::optional<localizer::PoseGaps> gaps_;             ///< live
  std::optional<localizer::CeilingWait> ceiling_wait_;  ///< live, if a robot that maps has no wheels
  std::size_t ceiling_cameras_ = 0;
  std::vector<TimeNs> newest_ns_;      ///< of the ceiling cameras
  std::vector<Measurement> surveyed_;  ///< landmarks with known positions, passed to the estimator once
  std::set<std::string> names_;        ///< of all robots
  std::vector<const Report*> reported_;
  std::vector<const Objects*> frames_;
  std::vector<const Measurement*> values_;
  std::map<std::string, TimeNs> last_ns_;  ///< of the published poses, including this batch; not used live
  /// After a restart during a run: the state to recover, and until when the localizer waits for it.
  std::optional<localizer::StateRecovery> state_recovery_;
  std::optional<std::chrono::steady_clock::time_point> recovery_deadline_;
  /// From then on the localizer does not wait for robots of which nothing has arrived.
  std::chrono::steady_clock::time_point heard_deadline_{};
  bool takes_over_ = false;
  std::unique_ptr<bus::Reader<v1::KeyframePose>> keyframe_poses_;
  v1::KeyframePose keyframe_pose_;
  std::vector<Measurement> recovered_poses_;
  v1::Pose sample_;
  v1::Objects objects_sample_;
  v1::Alignment alignment_sample_;
  v1::Place place_sample_;
  std::deque<Place> places_;          ///< not yet published
  std::deque<PoseEstimate> revised_;  ///< not yet published
  std::uint32_t revision_ = 0;
  std::map<std::string, bool> is_localized_;  ///< whether a robot of which frames arrived was ever localized
  bool ended_ = false;
};

/// A front end (with --camera) or the fleet's estimator.
std::unique_ptr<bus::Service> makeLocalizer(const bus::ServiceContext& context);

}  // namespace omnifleet::services
