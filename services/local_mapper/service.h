#pragma once

#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "bus/service.h"
#include "common/fault_runs.h"
#include "common/frame_inlet.h"
#include "common/inlet.h"
#include "dataset/dataset.h"
#include "fleet/fleet.h"
#include "local_mapper/debug_images.h"
#include "local_mapper/laser_service.h"
#include "local_mapper/lasting_places.h"
#include "local_mapper/local_mapper.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::services {

/// One robot's frames and wheel speeds in, one local map per frame out. Where the robot has a laser, too, the
/// scan of the frame's moment (at most `services: {local_mapper: {laser_age_s}}` before it) takes the place
/// of the camera's rays (laser/join.h).
class LocalMapperService : public bus::Service {
 public:
  /// `debug_images`: write the four pictures of Choi's Figs. 15–17 of every frame into OUT/debug/<robot>.
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
  void takeBeside();
  void process(const bus::FrameView& view);
  void joinLaser();
  void tellLens();
  void tellCover();
  void tellFault();
  void tellUndecided(bool ended);
  void saveDebugImages(const cv::Mat& image);

  bus::ServiceContext context_;
  fleet::CameraSpec camera_;
  bus::TimeMerger<Payload> merger_;
  bus::TimeMerger<Payload>::Batch batch_;
  RunEnds ends_;
  FrameInlet frames_;
  int frame_stream_;
  std::optional<Inlet<v1::WheelOdometry, Payload>> wheels_;
  std::optional<Inlet<v1::LaserScan, Payload>> scans_;
  Outlet<v1::LocalMap> out_;
  motion::WheelIntegrator integrator_;
  local_mapper::LocalMapper mapper_;
  std::optional<laser::LaserMapper> laser_;
  TimeNs laser_age_ns_;
  std::optional<LaserInput> scan_;  ///< the latest
  std::string debug_folder_;        ///< empty: no pictures
  LocalMap local_map_;
  v1::LocalMap sample_;
  std::size_t rejected_points_ = 0;  ///< that the correcting lens has no floor for
  FaultRuns faults_, scan_faults_;
  local_mapper::LastingPlaces undecided_;
  static constexpr int kTellEvery = 50;  ///< frames
  struct Doubt {
    std::uint32_t sequence;
    Eigen::Vector2d at_m;  ///< base_link of that frame
  };
  std::vector<Doubt> doubts_;  ///< not told yet
  int frames_since_told_ = kTellEvery;
  double told_cover_ = 0.0;  ///< share of the view
  bool told_bare_ = false, told_lens_ = false;
  int hemmed_in_frames_ = 0;  ///< in a row that show hardly any floor
  bool ended_ = false;
};

/// By the robot's fisheye camera; by its laser where it has none.
std::unique_ptr<bus::Service> makeLocalMapper(const bus::ServiceContext& context);

}  // namespace omnifleet::services
