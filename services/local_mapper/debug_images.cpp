#include "local_mapper/debug_images.h"

#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace omnifleet::local_mapper {

namespace {

constexpr int kMapSize_px = 900;
constexpr double kMapRange_m = 2.8;  // from the middle to the edge of the floor images

const cv::Scalar kRed(40, 40, 230), kWhite(255, 255, 255), kGrid(225, 225, 225), kInk(40, 40, 40),
    kFloor(214, 236, 214);

/// Eight colours that colour-blind readers can distinguish, too (Okabe–Ito and grey), BGR.
cv::Scalar labelColour(int label) {
  static const cv::Scalar kColours[8] = {{0, 159, 230}, {233, 180, 86}, {115, 158, 0},   {66, 228, 240},
                                         {178, 114, 0}, {0, 94, 213},   {167, 121, 204}, {150, 150, 150}};
  return kColours[(label + 7) % 8];
}

cv::Mat toBgr(const cv::Mat& image) {
  cv::Mat bgr;
  if (image.channels() == 1)
    cv::cvtColor(image, bgr, cv::COLOR_GRAY2BGR);
  else
    bgr = image.clone();
  return bgr;
}

/// base_link → image: x (forward) points up, y (left) points left.
cv::Point toPicture(const Eigen::Vector2d& p) {
  const double scale = 0.5 * kMapSize_px / kMapRange_m;
  const auto bounded = [](double v) {
    return static_cast<int>(std::lround(std::min(4.0 * kMapSize_px, std::max(-4.0 * kMapSize_px, v))));
  };
  return {bounded(0.5 * kMapSize_px - scale * p.y()), bounded(0.5 * kMapSize_px - scale * p.x())};
}

cv::Mat emptyFloor() {
  cv::Mat picture(kMapSize_px, kMapSize_px, CV_8UC3, kWhite);
  for (int k = -5; k <= 5; ++k) {
    const double m = 0.5 * k;
    cv::line(picture, toPicture({m, -kMapRange_m}), toPicture({m, kMapRange_m}), kGrid, k % 2 == 0 ? 2 : 1);
    cv::line(picture, toPicture({-kMapRange_m, m}), toPicture({kMapRange_m, m}), kGrid, k % 2 == 0 ? 2 : 1);
  }
  return picture;
}

void drawRobot(cv::Mat& picture) {
  cv::circle(picture, toPicture({0, 0}), 7, kInk, cv::FILLED, cv::LINE_AA);
  cv::arrowedLine(picture, toPicture({0, 0}), toPicture({0.2, 0}), kInk, 2, cv::LINE_AA, 0, 0.3);
}

std::vector<cv::Point> toPicture(const Polygon& polygon) {
  std::vector<cv::Point> points;
  for (const auto& p : polygon) points.push_back(toPicture(p));
  return points;
}

cv::Mat drawLabels(const LocalMapper& mapper, const LocalMap& map, const cv::Mat& image) {
  cv::Mat picture = toBgr(image);
  for (const auto& blob : mapper.connectedBlobs()) {
    const cv::Scalar colour = labelColour(blob.label);
    for (const auto& run : blob.runs) {
      for (int x = run.begin; x < run.end; ++x) {
        auto& p = picture.at<cv::Vec3b>(run.row, x);
        for (int c = 0; c < 3; ++c) p[c] = cv::saturate_cast<std::uint8_t>(0.4 * p[c] + 0.6 * colour[c]);
      }
    }
  }
  for (const auto& blob : mapper.labelledBlobs()) cv::rectangle(picture, blob.rect, {160, 160, 160}, 1);
  for (const auto& o : map.objects) {
    const cv::Rect rect(o.rect_x_px, o.rect_y_px, o.rect_width_px, o.rect_height_px);
    cv::rectangle(picture, rect, kRed, 2);
    cv::putText(picture, std::to_string(o.label), rect.tl() + cv::Point(2, -4), cv::FONT_HERSHEY_SIMPLEX, 0.6,
                kRed, 2, cv::LINE_AA);
  }
  return picture;
}

cv::Mat drawVectors(const LocalMap& map, const cv::Mat& image) {
  cv::Mat picture = toBgr(image);
  for (const auto& o : map.objects) {
    for (const auto& v : o.vectors) {
      const cv::Point from(cvRound(v.from_px.x()), cvRound(v.from_px.y())),
          to(cvRound(v.to_px.x()), cvRound(v.to_px.y()));
      cv::line(picture, from, to, kRed, 1, cv::LINE_AA);
      cv::circle(picture, from, 2, {0, 220, 255}, cv::FILLED, cv::LINE_AA);
    }
  }
  return picture;
}

cv::Mat drawCorrected(const LocalMap& map) {
  cv::Mat picture = emptyFloor();
  for (const auto& o : map.objects) {
    for (const auto& v : o.vectors) {
      const Eigen::Vector2d from = v.from_m.cast<double>(), to = v.to_m.cast<double>();
      cv::circle(picture, toPicture(from), 3, labelColour(o.label), cv::FILLED, cv::LINE_AA);
      cv::line(picture, toPicture(from), toPicture(to), labelColour(o.label), 2, cv::LINE_AA);
      cv::line(picture, toPicture(to), toPicture(to - v.residual_m.cast<double>()), kRed, 1, cv::LINE_AA);
    }
  }
  drawRobot(picture);
  return picture;
}

/// Blue on the floor, then green, red at the camera height.
cv::Scalar heightColour(double share) {
  const auto ramp = [&](double middle) {
    return 255.0 * std::min(1.0, std::max(0.0, 1.5 - std::abs(4.0 * share - middle)));
  };
  return {ramp(1.0), ramp(2.0), ramp(3.0)};
}

/// Surface points at their position, coloured by height.
void drawPoints(const LocalMap& map, cv::Mat& picture) {
  constexpr int kBar_px = 200, kLeft_px = 20, kTop_px = 30;
  for (const auto& o : map.objects) {
    for (const auto& v : o.vectors) {
      if (!(v.point.sigma_m > 0)) continue;
      const cv::Point at = toPicture(Eigen::Vector2d(v.point.point_m.head<2>().cast<double>()));
      cv::circle(picture, at, 5, heightColour(v.point.point_m.z() / map.camera_height_m), cv::FILLED,
                 cv::LINE_AA);
      cv::circle(picture, at, 5, kInk, 1, cv::LINE_AA);
    }
  }
  for (int i = 0; i < kBar_px; ++i) {
    const int y = kTop_px + kBar_px - 1 - i;
    cv::line(picture, {kLeft_px, y}, {kLeft_px + 14, y}, heightColour(static_cast<double>(i) / kBar_px), 1);
  }
  char text[32];
  std::snprintf(text, sizeof text, "%.2f m", map.camera_height_m);
  cv::putText(picture, text, {kLeft_px, kTop_px - 8}, cv::FONT_HERSHEY_SIMPLEX, 0.5, kInk, 1, cv::LINE_AA);
  cv::putText(picture, "0", {kLeft_px, kTop_px + kBar_px + 16}, cv::FONT_HERSHEY_SIMPLEX, 0.5, kInk, 1,
              cv::LINE_AA);
}

cv::Mat drawLocalMap(const LocalMap& map) {
  cv::Mat picture = emptyFloor();
  const std::size_t rays = map.scan.range_m.size();
  Polygon seen;
  for (std::size_t i = 0; i < rays; ++i) {
    const double phi = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(rays);
    seen.push_back(map.scan.origin_m +
                   static_cast<double>(map.scan.range_m[i]) * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
  }
  if (!seen.empty())
    cv::fillPoly(picture, std::vector<std::vector<cv::Point>>{toPicture(seen)}, kFloor, cv::LINE_AA);
  for (const auto& o : map.objects) {
    const auto hull = toPicture(o.hull_m);
    cv::polylines(picture, std::vector<std::vector<cv::Point>>{hull}, true, labelColour(o.label), 2,
                  cv::LINE_AA);
    cv::putText(picture, std::to_string(o.label), toPicture(o.centroid_m), cv::FONT_HERSHEY_SIMPLEX, 0.6,
                kInk, 2, cv::LINE_AA);
    cv::circle(picture, toPicture(o.contact_m), 4, kInk, cv::FILLED, cv::LINE_AA);
  }
  for (std::size_t i = 0; i < rays; ++i)
    if (map.scan.label[i] == RayLabel::kUnknown)
      cv::circle(picture, toPicture(seen[i]), 2, kRed, cv::FILLED, cv::LINE_AA);
  drawPoints(map, picture);
  drawRobot(picture);
  return picture;
}

}  // namespace

void writePicture(const std::string& path, const cv::Mat& picture, std::vector<std::string>& problems) {
  try {
    if (!cv::imwrite(path, picture))
      problems.push_back(path + ": image not written; check the folder and the free disk space");
  } catch (const cv::Exception& error) {
    problems.push_back(path + ": image not written: " + error.err);
  }
}

DebugImages DebugImages::render(const LocalMapper& mapper, const LocalMap& map, const cv::Mat& image) {
  return {drawLabels(mapper, map, image), drawVectors(map, image), drawCorrected(map), drawLocalMap(map)};
}

std::vector<std::string> DebugImages::save(const std::string& prefix) const {
  std::vector<std::string> problems;
  const auto write = [&](const std::string& name, const cv::Mat& picture) {
    writePicture(prefix + "_" + name + ".png", picture, problems);
  };
  write("labels", labels);
  write("vectors", vectors);
  write("corrected", corrected);
  write("local_map", local_map);
  return problems;
}

}  // namespace omnifleet::local_mapper
