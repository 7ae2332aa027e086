#include "local_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "dataset/frame_source.h"
#include "dataset/ground_truth.h"
#include "fleet/fleet.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::choi {
namespace {

constexpr float kVectorScale = 3.0f;  // 5 cm are few pixels
constexpr double kReach_m = 2.2;      // from the robot to the edge of the floor pictures

LocalView makeView(const fleet::Fleet& fleet, const dataset::RobotRecording& robot) {
  const options::Section section = fleet.service("local_mapper");
  motion::WheelIntegrator wheels(robot.body.wheel_separation_m,
                                 motion::WheelIntegrator::Options::read(section.child("wheels")));
  for (const dataset::WheelRow& row : robot.wheels) wheels.add(row.time_ns, row.left_mps, row.right_mps);
  local_mapper::LocalMapper mapper(lens::Camera(robot.fisheye->camera), local_mapper::Options::read(section));
  const auto source = dataset::openStream(*robot.fisheye, dataset::Colour::kBgr);
  const std::size_t last = source->size() - 1;
  LocalView view;
  view.robot = robot.name;
  view.body = robot.body;
  dataset::FrameInfo info;
  for (std::size_t i = 0; i <= last && source->next(view.image, info); ++i) {
    if (i != 0 && i != last) continue;
    const std::uint32_t sequence = i == 0 ? 0 : 1;  // consecutive numbers: skipped frames are no gap
    view.map =
        mapper.process({info.time_ns, sequence, info.state, view.image}, wheels.motionTo(info.time_ns));
  }
  view.labelled = mapper.labelledBlobs();
  view.connected = mapper.connectedBlobs();
  return view;
}

/// The square in which the image circle lies.
cv::Mat cropped(const cv::Mat& image) {
  const int side = std::min(image.cols, image.rows);
  return image(cv::Rect((image.cols - side) / 2, (image.rows - side) / 2, side, side)).clone();
}

void tint(cv::Mat& image, const ground::Blob& blob, const cv::Scalar& colour) {
  for (const ground::Run& run : blob.runs) {
    auto* row = image.ptr<cv::Vec3b>(run.row);
    for (int x = run.begin; x < run.end; ++x) {
      for (int c = 0; c < 3; ++c)
        row[x][c] = cv::saturate_cast<std::uint8_t>(0.25 * row[x][c] + 0.75 * colour[c]);
    }
  }
}

cv::Mat faded(const cv::Mat& image) {
  cv::Mat grey, picture;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  cv::cvtColor(grey, picture, cv::COLOR_GRAY2BGR);
  return 0.6 * picture + cv::Scalar(90, 90, 90);
}

void number(cv::Mat& image, const std::string& text, cv::Point at) {
  const double size = std::max(0.4, image.rows / 1400.0);
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, size, {255, 255, 255}, 4, cv::LINE_AA);
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, size, {20, 20, 20}, 1, cv::LINE_AA);
}

Plot floorPlot(const LocalView& view, const std::string& title) {
  Axes axes;
  axes.title = title;
  axes.x_label = "x, ahead of " + view.robot + " (m)";
  axes.y_label = "y, to its left (m)";
  axes.low = {-kReach_m, -kReach_m};
  axes.high = {kReach_m, kReach_m};
  axes.equal = true;
  return Plot(axes, {900, 900});
}

}  // namespace

std::vector<LocalView> localViews(const std::string& recording, const std::vector<std::string>& overlays) {
  const fleet::Fleet fleet = fleet::Fleet::load("", recording, overlays);
  const auto truth = dataset::GroundTruth::load(recording).trajectories;
  std::vector<LocalView> views;
  for (const dataset::RobotRecording& robot : dataset::Dataset::open(recording).robots) {
    if (!robot.fisheye || robot.fisheye->rows.empty()) continue;
    views.push_back(makeView(fleet, robot));
    views.back().map_from_base = truth.at(robot.name).back().map_from_base;
  }
  return views;
}

bool hasOutline(const ObjectObservation& object) {
  const auto& sigma = object.supports.sigma_m;
  return std::any_of(sigma.begin(), sigma.end(), [](float s) { return s > 0.0f; });
}

cv::Mat labelPicture(const LocalView& view) {
  cv::Mat picture = faded(view.image);
  for (std::size_t i = 0; i < view.labelled.size(); ++i) tint(picture, view.labelled[i], ink::label(i));
  for (const ground::Blob& blob : view.labelled)
    number(picture, std::to_string(blob.label), (blob.rect.tl() + blob.rect.br()) / 2);
  return cropped(picture);
}

cv::Mat connectedPicture(const LocalView& view) {
  cv::Mat picture = faded(view.image);
  for (std::size_t i = 0; i < view.connected.size(); ++i) tint(picture, view.connected[i], ink::label(i));
  for (std::size_t i = 0; i < view.connected.size(); ++i) {
    const ground::Blob& blob = view.connected[i];
    cv::rectangle(picture, blob.rect, {40, 40, 220}, std::max(1, picture.rows / 480));
    number(picture, std::to_string(blob.label), blob.rect.tl() + cv::Point(4, picture.rows / 40));
  }
  return cropped(picture);
}

cv::Mat vectorPicture(const LocalView& view) {
  cv::Mat picture = view.image.clone();
  const int width = std::max(1, picture.rows / 480);
  for (const ObjectObservation& object : view.map.objects) {
    for (const FlowVector& v : object.vectors) {
      const Eigen::Vector2f tip = v.from_px + kVectorScale * (v.to_px - v.from_px);
      const cv::Point from(cvRound(v.from_px.x()), cvRound(v.from_px.y())),
          to(cvRound(tip.x()), cvRound(tip.y()));
      cv::arrowedLine(picture, from, to, {30, 30, 255}, width + 1, cv::LINE_AA, 0, 0.3);
      cv::circle(picture, from, width + 1, {0, 230, 255}, cv::FILLED, cv::LINE_AA);
    }
  }
  return cropped(picture);
}

cv::Mat correctedPicture(const LocalView& view) {
  Plot plot = floorPlot(view, "corrected vectors on the floor, " + view.robot);
  const auto& objects = view.map.objects;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    for (const FlowVector& v : objects[i].vectors) {
      const Eigen::Vector2d from = v.from_m.cast<double>(), to = v.to_m.cast<double>();
      plot.dot(from, ink::label(i), 3, fmt::format("start points, object {}", objects[i].label));
      plot.arrow(from, to, {{40, 40, 220}, 1, false, false, ""});
    }
  }
  plot.body(view.body.outline(), {0.0, 0.0}, 0.0, ink::kBlack);
  return plot.image();
}

cv::Mat hullPicture(const LocalView& view) {
  Plot plot = floorPlot(view, "local map of " + view.robot + ": hulls on the floor");
  const auto& objects = view.map.objects;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const ObjectObservation& object = objects[i];
    for (const FlowVector& v : object.vectors)
      plot.dot(v.to_m.cast<double>(), ink::kGrey, 2, "feature points");
    plot.dot(object.contact_m, ink::kBlack, 4, "nearest point (contact)");
    if (!hasOutline(object)) continue;
    plot.area(object.hull_m, ink::label(i), 0.25);
    plot.line(object.hull_m, {ink::label(i), 2, false, true, "convex hull"});
  }
  for (const ObjectObservation& object : objects)
    plot.words(std::to_string(object.label), object.contact_m, ink::kBlack, 14);
  plot.body(view.body.outline(), {0.0, 0.0}, 0.0, ink::kBlack);
  return plot.image();
}

}  // namespace omnifleet::choi
