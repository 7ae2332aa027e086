#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "bus/service.h"
#include "common/inlet.h"
#include "common/newest_term.h"
#include "common/office.h"
#include "fleet/fleet.h"
#include "global_merger/alignments.h"
#include "global_merger/map_publisher.h"
#include "global_merger/map_saver.h"
#include "global_merger/merger.h"
#include "global_merger/own_maps.h"
#include "global_merger/places.h"
#include "global_merger/replication.h"

namespace omnifleet::services {

/// One robot's replica of the map. It makes contributions for all replicas from its robot's objects and
/// poses, and it builds the map from the contributions and keyframe poses of all robots. Live, it exchanges
/// with the other replicas what one of them lacks (replication.h). One replica publishes the map: the first
/// one; live, they elect it (office "map"). On each machine the first replica saves the map, and beside it
/// the maps of robots whose poses are in frames of their own.
class GlobalMergerService : public bus::Service {
 public:
  GlobalMergerService(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  std::vector<bus::Expectation> expectations() const override;
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool background() override;
  bool finished() const override { return ended_; }
  void drain() override;
  /// False if the map could not be saved, or if there is none: in a live run, and in every run that ended
  /// without a usable frame of this robot.
  bool succeeded() const override { return !saver_.failed() && !lacks_map_; }
  std::optional<std::chrono::steady_clock::time_point> wakeAt() const override;
  std::optional<bus::Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    return merger_.waitingFor(now);
  }

 private:
  using Payload = std::variant<std::monostate, Objects, PoseEstimate>;
  /// A stream into the set: unordered, with a count at the end.
  struct SetStream {
    std::uint64_t arrived = 0;
    std::optional<std::uint64_t> announced;
    std::chrono::steady_clock::time_point announced_at{};
    bool complete() const { return announced && arrived >= *announced; }
  };

  bool pull();
  bool receiveAndProcess();
  bool pullSets();
  bool exchange();
  void exchangeFinally();
  void add(const occupancy::Contribution& contribution);
  void add(const occupancy::KeyframePose& pose);
  void promise(const v1::Pose& pose);
  void process();
  void pause();
  void contribute();
  bool setsComplete() const;
  void listenTo(const std::string& stream);
  void finishMaps();
  void saveFinally();
  void savePeriodically();
  bool speak();

  bus::ServiceContext context_;
  adapters::RunClock clock_;
  std::string robot_;
  bool saves_;
  bus::TimeMerger<Payload> merger_;
  bus::TimeMerger<Payload>::Batch batch_;
  RunEnds ends_;
  std::optional<Inlet<v1::Objects, Payload>> objects_;  ///< of a robot with sensors
  std::vector<std::unique_ptr<Inlet<v1::Pose, Payload>>> poses_;
  NewestTerm pose_term_;
  std::map<std::string, int> stream_of_pose_;  ///< by robot
  std::unique_ptr<bus::Reader<v1::Contribution>> contributions_;
  std::unique_ptr<bus::Reader<v1::KeyframePose>> keyframe_poses_;
  Outlet<v1::Contribution> contribution_out_;
  Outlet<v1::KeyframePose> pose_out_;
  std::optional<Office> office_;  ///< live, if there are several replicas
  MapPublisher publisher_;
  global_merger::ContributionMaker maker_;
  global_merger::Merger replica_;  ///< the common map
  global_merger::OwnMaps own_maps_;
  Alignments alignments_;
  Places places_;
  MapSaver saver_;
  std::optional<Replication> replication_;  ///< live only: other modes lose no sample
  std::map<std::string, SetStream> sets_;
  std::deque<Objects> waiting_objects_;               ///< whose pose has not arrived yet
  std::deque<PoseEstimate> waiting_poses_;            ///< of the own robot
  v1::Contribution contribution_, own_contribution_;  ///< as received; as written
  v1::KeyframePose keyframe_pose_, own_keyframe_pose_;
  bool has_new_batches_ = false;  ///< batches arrived since the map was last published or not due
  std::uint64_t frames_ = 0, usable_frames_ = 0;  ///< of the own robot
  bool contributed_all_ = false, ended_ = false, lacks_map_ = false;
  std::chrono::steady_clock::time_point saved_at_ = std::chrono::steady_clock::now();
};

std::unique_ptr<bus::Service> makeGlobalMerger(const bus::ServiceContext& context);

}  // namespace omnifleet::services
