#include "seed_run.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "dataset/atomic_file.h"
#include "dataset/frame_source.h"
#include "dataset/ground_truth.h"
#include "evaluate/report.h"
#include "figures.h"
#include "fleet_in_process/in_process.h"
#include "localizer/ceiling_front_end.h"
#include "occupancy/contribution.h"
#include "synthetic/randomised.h"
#include "world/recording.h"

namespace omnifleet::choi {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string>& methods() {
  static const std::vector<std::string> kMethods{"literal", "omnifleet"};
  return kMethods;
}

void scaleImages(double scale, synthetic::Arena& arena) {
  for (synthetic::ArenaCamera& camera : arena.cameras) {
    lens::CameraModel& m = camera.model;
    m.image_width_px = static_cast<int>(std::lround(scale * m.image_width_px));
    m.image_height_px = static_cast<int>(std::lround(scale * m.image_height_px));
    m.focal_px *= scale;
    m.principal_point_px = scale * (m.principal_point_px.array() + 0.5) - 0.5;
    m.self_mask_radius_px *= scale;
  }
}

/// Replaces the lens of 185° by the orthographic lens of eq. 6–7. Its image circle ends at 90° and has the
/// same size.
void makeOrthographic(synthetic::Arena& arena) {
  for (synthetic::ArenaCamera& camera : arena.cameras) {
    if (camera.robot.empty()) continue;
    lens::CameraModel& m = camera.model;
    const double mask_rad = m.self_mask_radius_px / m.focal_px.x();
    m.focal_px = Eigen::Vector2d::Constant(0.5 * m.image_height_px);
    m.projection = lens::Projection::kOrthographic;
    m.fov_deg = 180.0;
    m.self_mask_radius_px = std::ceil(m.focal_px.x() * std::sin(mask_rad));
  }
}

MapScore score(const std::vector<dataset::MapObject>& truth, const std::vector<dataset::MapObject>& objects) {
  constexpr double kPair_m = 0.5;
  const evaluation::MapMetrics strict = evaluation::compareMaps(truth, objects, {});
  const evaluation::MapMetrics wide = evaluation::compareMaps(truth, objects, {kPair_m, 0.0});
  MapScore s;
  s.truths = wide.truths;
  s.reported = wide.estimates;
  s.found = static_cast<int>(strict.matches.size());
  s.paired = static_cast<int>(wide.matches.size());
  s.x_m = wide.x_error_m;
  s.y_m = wide.y_error_m;
  s.distances_m = wide.distances_error_m;
  s.iou = wide.iou;
  return s;
}

/// Mean over robots, weighted by their number of frames.
class PathMean {
 public:
  void add(const evaluation::PathMetrics& p) {
    if (p.poses == 0) return;
    const double n = p.poses, all = sum_.poses + n;
    const auto mix = [&](double& mean, double value) { mean += (value - mean) * n / all; };
    mix(sum_.x_m, p.x_m);
    mix(sum_.y_m, p.y_m);
    mix(sum_.distance_m, p.distance_m);
    mix(sum_.heading_rad, p.heading_rad);
    sum_.poses += p.poses;
  }
  PathScore score() const { return sum_; }

 private:
  PathScore sum_;
};

PathScore compare(const Paths& reference, const Paths& estimate) {
  PathMean mean;
  for (const auto& [robot, path] : reference) {
    const auto found = estimate.find(robot);
    if (found != estimate.end()) mean.add(evaluation::comparePaths(path, found->second));
  }
  return mean.score();
}

class Experiment {
 public:
  Experiment(const SeedOptions& options, const std::function<void(const std::string&)>& progress)
      : options_(options), progress_(progress) {
    result_.seed = options.seed;
    result_.settings = settingsOf(options);
    data_.overlay = options.config + "/papers/choi.yaml";
  }

  SeedResult run() {
    fs::remove_all(work());
    dataset::makeDirectories(work().string());
    staticExperiment();
    dynamicExperiment();
    if (!options_.figures.empty()) {
      progress_("figures");
      drawFigures(data_, options_.figures);
    }
    if (!options_.keep) fs::remove_all(work());
    return result_;
  }

 private:
  fs::path work() const { return fs::path(options_.folder) / "work"; }

  synthetic::Arena arena(const std::string& name) const {
    auto arena = synthetic::randomised(synthetic::Arena::load(options_.config + "/arenas/" + name + ".yaml"),
                                       options_.seed);
    scaleImages(options_.image_scale, arena);
    return arena;
  }

  std::string record(const synthetic::Arena& room, const std::string& name, bool ceiling) {
    progress_("recording " + name);
    world::RecordingOptions how;
    how.seed = options_.seed;
    how.ceiling = ceiling;
    how.world = world::World::Options::read(room.world);
    const std::string folder = (work() / name).string();
    world::record(room, how, folder);
    return folder;
  }

  /// `observers`: robots whose views shape the map; empty: all robots.
  std::string replay(const std::string& recording, const std::string& method, const std::string& name,
                     const std::vector<std::string>& observers = {}) {
    progress_(name);
    services::InProcessRun run;
    run.dataset = recording;
    run.out = (work() / name).string();
    run.log_level = "err";
    if (method == "literal") run.overlays.push_back(data_.overlay);
    if (!observers.empty()) {
      const std::string file = run.out + ".yaml";
      dataset::writeAtomic(file,
                           fmt::format("services: {{global_merger: {{outlines: {{observers: [{}]}}}}}}\n",
                                       fmt::join(observers, ", ")));
      run.overlays.push_back(file);
    }
    if (!services::runInProcess(run)) throw std::runtime_error(run.out + ": the run did not save its map");
    return run.out;
  }

  MapScore mapScore(const std::string& recording, const std::string& run) const {
    return score(dataset::GroundTruth::load(recording).scene, dataset::readObjects(run + "/objects.geojson"));
  }

  void staticExperiment() {
    const synthetic::Arena room = arena("paper_static");
    data_.fixed = record(room, "static", !options_.figures.empty());
    data_.fixed_ceiling = setCeilingAside(data_.fixed, "static_ceiling");
    for (const std::string& method : methods()) {
      const std::string run = replay(data_.fixed, method, "static_" + method);
      data_.fixed_runs[method] = run;
      result_.maps[method] = mapScore(data_.fixed, run);
      const auto report = evaluate::evaluateRun(run, data_.fixed);
      if (report.kinds) result_.robots_f1["static " + method] = report.kinds->robot.f1();
      result_.teams.push_back({method, static_cast<int>(room.robots.size()), result_.maps[method]});
      teams(room, method);
    }
    synthetic::Arena other = room;
    makeOrthographic(other);
    const std::string recording = record(other, "static_orthographic", false);
    for (const std::string& method : methods())
      result_.maps[method + " orthographic"] =
          mapScore(recording, replay(recording, method, "static_orthographic_" + method));
  }

  /// §IV.4: maps from each single robot and each pair.
  void teams(const synthetic::Arena& room, const std::string& method) {
    std::vector<std::vector<std::string>> chosen;
    for (const auto& a : room.robots) {
      chosen.push_back({a.name});
      for (const auto& b : room.robots) {
        if (a.name < b.name) chosen.push_back({a.name, b.name});
      }
    }
    for (const auto& names : chosen) {
      if (names.size() >= room.robots.size()) continue;
      const std::string name = fmt::format("static_{}_{}", method, fmt::join(names, "_"));
      result_.teams.push_back({method, static_cast<int>(names.size()),
                               mapScore(data_.fixed, replay(data_.fixed, method, name, names))});
    }
  }

  void dynamicExperiment() {
    synthetic::Arena room = arena("paper_dynamic");
    if (options_.duration_s > 0.0) room.duration_s = std::min(room.duration_s, options_.duration_s);
    data_.moving = record(room, "dynamic", true);
    trackFromCeiling(setCeilingAside(data_.moving, "dynamic_ceiling"));
    const Paths truth = dataset::GroundTruth::load(data_.moving).trajectories;
    result_.paths["ceiling"] = compare(truth, data_.ceiling);
    for (const std::string& method : methods()) {
      const std::string run = replay(data_.moving, method, "dynamic_" + method);
      data_.moving_runs[method] = run;
      const auto report = evaluate::evaluateRun(run, data_.moving);
      PathMean wheels;
      Paths estimate;
      for (const auto& robot : report.robots) {
        estimate[robot.name] = dataset::flat(dataset::readTum(run + "/trajectories/" + robot.name + ".tum"));
        if (robot.dead_reckoning) wheels.add(*robot.dead_reckoning);
      }
      result_.paths[method] = compare(truth, estimate);
      result_.paths["wheels"] = wheels.score();
      result_.paths_ceiling[method] = compare(data_.ceiling, estimate);
      result_.maps["dynamic " + method] = mapScore(data_.moving, run);
      if (report.kinds) result_.robots_f1["dynamic " + method] = report.kinds->robot.f1();
    }
  }

  /// Moves the ceiling cameras to a recording of their own. They serve as the reference, so the replay must
  /// not localize the robots by them. Returns the folder, or an empty string without ceiling cameras.
  std::string setCeilingAside(const std::string& recording, const std::string& name) {
    const fs::path from = fs::path(recording) / "ceiling", to = work() / name;
    if (!fs::exists(from)) return {};
    fs::create_directories(to);
    fs::rename(from, to / "ceiling");
    fs::copy_file(fs::path(recording) / "dataset.yaml", to / "dataset.yaml");
    return to.string();
  }

  void trackFromCeiling(const std::string& folder) {
    progress_("ceiling tracker");
    const dataset::Dataset recording = dataset::Dataset::open(folder);
    data_.moving_ceiling = folder;
    for (const dataset::ImageStream& stream : recording.ceiling) {
      localizer::CeilingFrontEnd tracker(stream.name, stream.camera, recording.markers.value(), {});
      const auto source = dataset::openStream(stream, dataset::Colour::kBgr);
      cv::Mat image;
      dataset::FrameInfo info;
      while (source->next(image, info)) {
        if (info.state != FrameState::kOk) continue;
        for (const Measurement& seen : tracker.process(info.time_ns, info.sequence, image))
          data_.ceiling[seen.to].push_back({seen.acquired_ns, Pose2::fromVector(seen.value)});
      }
    }
  }

  SeedOptions options_;
  std::function<void(const std::string&)> progress_;
  SeedResult result_;
  SeedData data_;
};

}  // namespace

std::string settingsOf(const SeedOptions& options) {
  std::uint64_t digest = 0;
  for (const char* file : {"/papers/choi.yaml", "/arenas/paper_static.yaml", "/arenas/paper_dynamic.yaml"})
    digest = digest * 31 + occupancy::digest(dataset::readFile(options.config + file));
  digest = digest * 31 + occupancy::digest(dataset::readFile("/proc/self/exe"));
  return fmt::format("scale {:g}, duration {:g}, digest {:016x}", options.image_scale, options.duration_s,
                     digest);
}

SeedResult runSeed(const SeedOptions& options, const std::function<void(const std::string&)>& progress) {
  return Experiment(options, progress).run();
}

}  // namespace omnifleet::choi
