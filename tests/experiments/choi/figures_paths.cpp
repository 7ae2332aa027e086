#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>

#include "dataset/frame_source.h"
#include "dataset/ground_truth.h"
#include "dataset/map_files.h"
#include "evaluation/trajectory_metrics.h"
#include "figures.h"
#include "plot.h"

namespace omnifleet::choi {
namespace {

const char* nameOf(const std::string& method) {
  return method == "literal" ? "as printed" : "omnifleet";
}

Paths pathsOf(const SeedData& data, const std::string& method) {
  Paths paths;
  for (const auto& [robot, truth] : dataset::GroundTruth::load(data.moving).trajectories)
    paths[robot] =
        dataset::flat(dataset::readTum(data.moving_runs.at(method) + "/trajectories/" + robot + ".tum"));
  return paths;
}

/// Fig. 20: six moments of the drive, seen from the ceiling.
void drawSnapshots(const SeedData& data, const std::string& path) {
  const dataset::Dataset recording = dataset::Dataset::open(data.moving_ceiling);
  if (recording.ceiling.empty()) return;
  const dataset::ImageStream& stream = recording.ceiling.front();
  constexpr std::size_t kMoments = 6;
  constexpr int kSnapshot_px = 600;  // width
  const std::size_t n = stream.rows.size();
  std::vector<cv::Mat> pictures;
  std::vector<std::string> captions;
  const auto source = dataset::openStream(stream, dataset::Colour::kBgr);
  cv::Mat image;
  dataset::FrameInfo info;
  for (std::size_t i = 0; i < n && source->next(image, info); ++i) {
    const std::size_t wanted = pictures.size() * (n - 1) / (kMoments - 1);
    if (i < wanted || pictures.size() >= kMoments) continue;
    cv::Mat small;
    cv::resize(image, small, {kSnapshot_px, image.rows * kSnapshot_px / image.cols}, 0, 0, cv::INTER_AREA);
    pictures.push_back(small);
    captions.push_back(
        fmt::format("t = {:.1f} s", 1e-9 * static_cast<double>(info.time_ns - stream.rows.front().time_ns)));
  }
  if (pictures.empty()) return;
  const auto row = [&](std::size_t begin) {
    const auto from = static_cast<std::ptrdiff_t>(begin),
               to = static_cast<std::ptrdiff_t>(std::min(begin + 3, pictures.size()));
    return beside(std::vector<cv::Mat>(pictures.begin() + from, pictures.begin() + to),
                  std::vector<std::string>(captions.begin() + from, captions.begin() + to));
  };
  std::vector<cv::Mat> rows;
  for (std::size_t i = 0; i < pictures.size(); i += 3) rows.push_back(row(i));
  save(path, stacked(rows));
}

/// Fig. 21: the paths.
void drawPaths(const SeedData& data, const std::string& path) {
  const auto truth = dataset::GroundTruth::load(data.moving);
  const Paths literal = pathsOf(data, "literal"), omnifleet = pathsOf(data, "omnifleet");
  Axes axes;
  axes.title = "paths of V.2: ceiling tracker, as printed, omnifleet";
  axes.x_label = "x (m)";
  axes.y_label = "y (m)";
  axes.equal = true;
  axes.low = {1e9, 1e9};
  axes.high = {-1e9, -1e9};
  for (const auto& [robot, poses] : truth.trajectories) {
    for (const auto& pose : poses) {
      axes.low = axes.low.cwiseMin((pose.map_from_base.translation().array() - 0.35).matrix());
      axes.high = axes.high.cwiseMax((pose.map_from_base.translation().array() + 0.35).matrix());
    }
  }
  Plot plot(axes, {1500, 760});
  for (const auto& object : truth.scene) {
    plot.area(object.outline_m, ink::kFaint, 1.0, "obstacle");
    plot.line(object.outline_m, {ink::kGrey, 1, false, true, ""});
  }
  const auto draw = [&](const std::vector<dataset::StampedPose>& poses, const Line& line) {
    std::vector<Eigen::Vector2d> points;
    for (const auto& pose : poses) points.push_back(pose.map_from_base.translation());
    plot.line(points, line);
  };
  for (const auto& [robot, poses] : literal) draw(poses, {ink::kOrange, 2, false, false, "as printed"});
  for (const auto& [robot, poses] : omnifleet) draw(poses, {ink::kBlue, 2, false, false, "omnifleet"});
  for (const auto& [robot, poses] : data.ceiling) {
    for (std::size_t i = 0; i < poses.size(); i += 4)
      plot.dot(poses[i].map_from_base.translation(), ink::kBlack, 2, "ceiling tracker (every 4th frame)");
  }
  for (const auto& [robot, poses] : truth.trajectories)
    plot.words(robot, poses.front().map_from_base.translation(), ink::kBlack, 18);
  save(path, plot.image());
}

struct ErrorTrace {
  std::string robot;
  std::vector<double> t_s, x_cm, y_cm;
};

std::vector<ErrorTrace> errorsOf(const Paths& reference, const Paths& estimate) {
  std::vector<ErrorTrace> traces;
  for (const auto& [robot, poses] : estimate) {
    const auto found = reference.find(robot);
    if (found == reference.end() || poses.empty()) continue;
    ErrorTrace trace;
    trace.robot = robot;
    for (const auto& pose : poses) {
      Pose2 exact;
      if (!evaluation::poseAt(found->second, pose.time_ns, 1'000'000'000, exact)) continue;
      trace.t_s.push_back(1e-9 * static_cast<double>(pose.time_ns - poses.front().time_ns));
      trace.x_cm.push_back(100.0 * (pose.map_from_base.x_m - exact.x_m));
      trace.y_cm.push_back(100.0 * (pose.map_from_base.y_m - exact.y_m));
    }
    traces.push_back(trace);
  }
  return traces;
}

cv::Mat drawErrors(const std::vector<ErrorTrace>& traces, const std::string& title, bool x_axis) {
  Axes axes;
  axes.title = title;
  axes.x_label = "time (s)";
  axes.y_label = std::string(x_axis ? "x" : "y") + " error (cm)";
  double max_cm = 0.05, end = 1.0;
  for (const ErrorTrace& trace : traces) {
    for (const double v : x_axis ? trace.x_cm : trace.y_cm) max_cm = std::max(max_cm, std::abs(v));
    if (!trace.t_s.empty()) end = std::max(end, trace.t_s.back());
  }
  axes.low = {0.0, -1.15 * max_cm};
  axes.high = {1.14 * end, 1.15 * max_cm};  // space for the legend
  Plot plot(axes, {860, 420});
  plot.line({{0.0, 0.0}, {end, 0.0}}, {ink::kGrey, 1, false, false, ""});
  for (std::size_t i = 0; i < traces.size(); ++i) {
    std::vector<Eigen::Vector2d> points;
    for (std::size_t k = 0; k < traces[i].t_s.size(); ++k)
      points.emplace_back(traces[i].t_s[k], (x_axis ? traces[i].x_cm : traces[i].y_cm)[k]);
    plot.line(points, {ink::robot(i), 2, false, false, traces[i].robot});
  }
  return plot.image();
}

/// Fig. 22: path errors over time, against the ceiling tracker (the paper's reference) and the exact truth.
void drawErrorFigure(const SeedData& data, const std::string& path) {
  const Paths truth = dataset::GroundTruth::load(data.moving).trajectories;
  std::vector<cv::Mat> rows;
  for (const std::string method : {"literal", "omnifleet"}) {
    const Paths paths = pathsOf(data, method);
    const auto against_ceiling = errorsOf(data.ceiling, paths), against_truth = errorsOf(truth, paths);
    const std::string name = nameOf(method);
    rows.push_back(beside({drawErrors(against_ceiling, name + " against the ceiling tracker", true),
                           drawErrors(against_ceiling, name + " against the ceiling tracker", false)},
                          {}));
    if (method == "omnifleet") {
      rows.push_back(beside({drawErrors(against_truth, name + " against the exact truth", true),
                             drawErrors(against_truth, name + " against the exact truth", false)},
                            {}));
    }
  }
  const auto tracker = errorsOf(truth, data.ceiling);
  rows.push_back(beside({drawErrors(tracker, "ceiling tracker against the exact truth", true),
                         drawErrors(tracker, "ceiling tracker against the exact truth", false)},
                        {}));
  save(path, stacked(rows));
}

struct TeamColumn {
  std::vector<double> error_cm, iou, found;
};

TeamColumn columnOf(const std::vector<SeedResult>& results, const std::string& method, int robots) {
  TeamColumn column;
  for (const SeedResult& result : results) {
    for (const TeamScore& team : result.teams) {
      if (team.method != method || team.robots != robots || team.map.truths == 0) continue;
      column.found.push_back(100.0 * team.map.found / team.map.truths);
      if (team.map.paired == 0) continue;
      column.error_cm.push_back(100.0 * std::hypot(team.map.x_m, team.map.y_m));
      column.iou.push_back(team.map.iou);
    }
  }
  return column;
}

double meanOf(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return values.empty() ? std::nan("") : sum / static_cast<double>(values.size());
}

using Part = std::vector<double> TeamColumn::*;

cv::Mat drawTeamPlot(const std::vector<SeedResult>& results, const std::vector<std::string>& shown,
                     const std::set<int>& sizes, const std::string& title, const std::string& unit, Part part,
                     double top) {
  Axes axes;
  axes.title = title;
  axes.x_label = "number of robots whose views form the map";
  axes.y_label = unit;
  axes.low = {0.5, 0.0};
  axes.high = {*sizes.rbegin() + 0.5, top};
  for (const std::string& method : shown) {
    if (top > 0.0) break;
    for (const int n : sizes) {
      const TeamColumn column = columnOf(results, method, n);
      for (const double v : column.*part) axes.high.y() = std::max(axes.high.y(), 1.15 * v);
    }
  }
  Plot plot(axes, {620, 480});
  for (const std::string& method : shown) {
    const bool literal = method == "literal";
    const cv::Scalar colour = literal ? ink::kOrange : ink::kBlue;
    std::vector<Eigen::Vector2d> means;
    for (const int n : sizes) {
      const TeamColumn column = columnOf(results, method, n);
      const auto& values = column.*part;
      if (values.empty()) continue;
      const auto [min, max] = std::minmax_element(values.begin(), values.end());
      const double x = n + (shown.size() < 2 ? 0.0 : literal ? -0.04 : 0.04);
      plot.bar(x, *min, *max, colour);
      means.emplace_back(x, meanOf(values));
      plot.dot(means.back(), colour, 4);
    }
    plot.line(means, {colour, 2, false, false, std::string(nameOf(method)) + ": mean, minimum, maximum"});
  }
  return plot.image();
}

}  // namespace

void drawPathFigures(const SeedData& data, const std::string& folder) {
  drawSnapshots(data, folder + "/fig20_snapshots.png");
  drawPaths(data, folder + "/fig21_paths.png");
  drawErrorFigure(data, folder + "/fig22_path_errors.png");
}

void drawTeams(const std::vector<SeedResult>& results, const std::string& path) {
  std::set<int> sizes;
  for (const SeedResult& result : results) {
    for (const TeamScore& team : result.teams) sizes.insert(team.robots);
  }
  if (sizes.empty()) return;
  const std::vector<std::string> both{"literal", "omnifleet"};
  save(path, stacked({beside({drawTeamPlot(results, {"omnifleet"}, sizes, "position error, omnifleet", "cm",
                                           &TeamColumn::error_cm, 0.0),
                              drawTeamPlot(results, {"literal"}, sizes, "position error, as printed", "cm",
                                           &TeamColumn::error_cm, 0.0)},
                             {}),
                      beside({drawTeamPlot(results, both, sizes, "overlap of footprints", "IoU",
                                           &TeamColumn::iou, 1.05),
                              drawTeamPlot(results, both, sizes, "obstacles found (15 cm, IoU 0.3)", "%",
                                           &TeamColumn::found, 105.0)},
                             {})}));
}

}  // namespace omnifleet::choi
