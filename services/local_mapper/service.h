#pragma once

#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "bus/service.h"
#include "common/fault_runs.h"
#include "common/frame_inlet.h"
#include "common/inlet.h"
#include "common/overlap_check.h"
#include "dataset/dataset.h"
#include "fleet/fleet.h"
#include "local_mapper/appearance_source.h"
#include "local_mapper/debug_images.h"
#include "local_mapper/laser_service.h"
#include "local_mapper/lens_verdict.h"
#include "local_mapper/local_mapper.h"
#include "local_mapper/persistent_places.h"
#include "local_mapper/wheel_check.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::services {

/// One robot's frames and wheel speeds in, one local map per frame out. If the robot also has a laser, the
/// scan at the time of the frame (at most `services: {local_mapper: {laser_age_s}}` earlier) replaces the
/// camera's rays (laser/join.h).
class LocalMapperService : public bus::Service {
 public:
  /// `debug_images`: write the four images of Choi's Figs. 15–17 of every frame to OUT/debug/<robot>.
  LocalMapperService(const bus::ServiceContext& context, const fleet::Fleet& fleet, bool debug_images);

  std::vector<bus::Expectation> expectations() const override { return {out_.expectation()}; }
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override { out_.end(ends_, ended_ ? "" : "stopped"); }
  std::optional<bus::Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    return merger_.waitingFor(now);
  }

 private:
  using Payload = std::variant<std::monostate, bus::FrameView, dataset::WheelRow, LaserInput>;

  bool pull();
  void takeSideInputs();
  void process(const bus::FrameView& view);
  void addAppearance(const local_mapper::Frame& frame);
  void joinLaser();
  void reportLens(const cv::Mat& image);
  bool isByLens(ErrorCode code) const;
  void reportOcclusion();
  void reportFault();
  void reportUndecided(bool ended);
  void saveDebugImages(const cv::Mat& image);

  bus::ServiceContext context_;
  fleet::CameraSpec camera_;
  bus::TimeMerger<Payload> merger_;
  bus::TimeMerger<Payload>::Batch batch_;
  RunEnds ends_;
  FrameInlet frames_;
  int frame_stream_;
  LiveTimes live_times_;
  adapters::RunClock clock_;
  std::optional<Inlet<v1::WheelOdometry, Payload>> wheels_;
  std::optional<Inlet<v1::LaserScan, Payload>> scans_;
  std::optional<OverlapCheck> scan_check_;
  Outlet<v1::LocalMap> out_;
  motion::WheelIntegrator integrator_;
  local_mapper::WheelCheck wheel_check_;
  local_mapper::LocalMapper mapper_;
  local_mapper::LensCheck lens_check_;
  std::optional<Message> lens_problem_;          ///< lasts for the whole run
  ErrorCode hidden_by_lens_ = ErrorCode::kNone;  ///< why the frame that showed the wrong lens was rejected
  double unstated_view_deg_ = 0.0;  ///< angle at which the image ends, if sensor.yaml does not state it
  std::optional<local_mapper::AppearanceSource> appearance_;
  std::optional<laser::LaserMapper> laser_;
  TimeNs laser_age_ns_;
  std::optional<LaserInput> scan_;  ///< the latest
  std::string debug_folder_;        ///< empty: no debug images
  LocalMap local_map_;
  v1::LocalMap sample_;
  std::size_t rejected_points_ = 0;  ///< for which the correcting lens has no floor point
  FaultRuns faults_, scan_faults_;
  local_mapper::PersistentPlaces undecided_;
  static constexpr int kReportEvery = 50;  ///< frames
  /// Undecided regions that are not reported yet: frame, place in its base_link.
  std::vector<std::pair<std::uint32_t, Eigen::Vector2d>> unreported_;
  int frames_since_report_ = kReportEvery;
  double reported_occlusion_ = 0.0;  ///< share of the view
  bool reported_bare_ = false;
  int enclosed_frames_ = 0;  ///< consecutive frames with hardly any visible floor
  bool ended_ = false;
};

/// Options of a fisheye camera's mapper: `services: {local_mapper: …}`. Marks the keys of the other mappers
/// as known. Throws options::Error for an unknown key.
local_mapper::Options fisheyeOptions(const fleet::Fleet& fleet);

/// For the camera that the robot maps with, or for its laser if it has none.
std::unique_ptr<bus::Service> makeLocalMapper(const bus::ServiceContext& context);

}  // namespace omnifleet::services
