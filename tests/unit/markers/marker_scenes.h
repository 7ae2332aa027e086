#pragma once

#include <Eigen/Dense>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "markers/patch_finder.h"
#include "painted_robots.h"

namespace omnifleet::markers {

/// A kind of images with robots at random poses.
struct Scene {
  lens::CameraModel camera = ceilingCamera();
  Imaging imaging;
  Body body = Body::kPlate;
  bool decoys = false;
  FinderOptions options;
};

inline Scene hardScene(Body body) {
  Scene scene;
  scene.camera = tiltedCamera();
  scene.imaging.gain = 0.55;
  scene.imaging.noise = 6.0;
  scene.imaging.blur_px = 0.8;
  scene.imaging.jpeg_quality = 90;
  scene.imaging.uneven = 0.3;
  scene.body = body;
  scene.decoys = true;
  return scene;
}

/// Errors over all robots of several images.
struct Accuracy {
  int asked = 0, found = 0;
  int wrong = 0;  ///< more than 3 cm or 17° off: another object, robot or heading
  double mean_m = 0.0, mean_rad = 0.0, worst_m = 0.0, worst_rad = 0.0, nees = 0.0;
};

/// Places robots 36 cm apart and at least 30 px inside the image.
class Places {
 public:
  Places(const Painter& painter, double height_m, int seed)
      : painter_(painter), height_m_(height_m), random_(static_cast<unsigned>(7 * seed + 3)) {}
  Pose2 next() {
    std::uniform_real_distribution<double> x(-1.2, 1.6), y(-1.2, 1.0), heading(-M_PI, M_PI);
    for (;;) {
      Pose2 pose;
      pose.x_m = x(random_), pose.y_m = y(random_), pose.theta_rad = heading(random_);
      const auto pixel = painter_.camera.pixelFromPoint({pose.x_m, pose.y_m, height_m_});
      bool good = pixel && pixel->x() > 30 && pixel->x() < 610 && pixel->y() > 30 && pixel->y() < 450;
      for (const Pose2& p : taken_) good = good && (p.translation() - pose.translation()).norm() > 0.36;
      if (!good) continue;
      taken_.push_back(pose);
      return pose;
    }
  }

 private:
  const Painter& painter_;
  double height_m_;
  std::mt19937 random_;
  std::vector<Pose2> taken_;
};

/// Cards in the colours of the markers: a small marker and single cards on the floor, and a wrong arrangement
/// at the height of the markers.
inline void paintDecoys(Painter& painter, const dataset::MarkerSet& set, Places& places) {
  const bool patches = set.kind == dataset::MarkerKind::kPatches;
  const dataset::RobotColours &first = set.robots.begin()->second,
                              &last = std::prev(set.robots.end())->second;
  const dataset::Rgb a = patches ? set.team : first.tail, b = patches ? first.individual : first.head,
                     c = patches ? last.individual : last.head;
  painter.marker(set, set.robots.begin()->first, places.next(), 0.0, 0.8);
  painter.rectangle(places.next(), 0.0, {0, 0}, {0.12, 0.10}, a);
  painter.rectangle(places.next(), 0.0, {0, 0}, {0.05, 0.04}, b);
  const Pose2 pile = places.next();
  painter.rectangle(pile, set.height_m, {0, 0}, {0.16, 0.14}, b);
  painter.rectangle(pile, set.height_m, {0.06, 0}, {0.09, 0.12}, c);
  painter.rectangle(pile, set.height_m, {-0.05, 0.03}, {0.05, 0.04}, a);
}

/// Finds all robots of a set in one image per seed. Prints the figures.
inline Accuracy measure(const dataset::MarkerSet& set, const Scene& scene, int first_seed, int count,
                        const char* name) {
  Accuracy a;
  for (int seed = first_seed; seed < first_seed + count; ++seed) {
    Painter painter(scene.camera);
    Places places(painter, set.height_m, seed);
    if (scene.decoys) paintDecoys(painter, set, places);
    std::map<std::string, Pose2> truth;
    for (const auto& [robot, unused] : set.robots) {
      truth[robot] = places.next();
      painter.robot(set, robot, truth[robot], scene.body);
    }
    Imaging imaging = scene.imaging;
    imaging.seed = seed + 1;
    a.asked += static_cast<int>(truth.size());
    const auto finder = MarkerFinder::make(painter.camera, set, scene.options);
    for (const Detection& d : finder->find(painter.image(imaging), 0)) {
      const Pose2 e = d.map_from_base.inverse() * truth.at(d.robot);
      const double m = e.translation().norm(), rad = std::abs(e.theta_rad);
      if (m > 0.03 || rad > 0.3) {
        ++a.wrong;
        continue;
      }
      ++a.found;
      a.mean_m += m, a.mean_rad += rad;
      a.worst_m = std::max(a.worst_m, m), a.worst_rad = std::max(a.worst_rad, rad);
      a.nees += e.vector().dot(d.covariance.inverse() * e.vector());
    }
  }
  const double n = std::max(1, a.found);
  a.mean_m /= n, a.mean_rad /= n, a.nees /= n;
  constexpr double kDeg = 180.0 / M_PI;
  std::printf("%-36s %3d of %3d found, %d wrong, mean %.2f mm %.2f deg, worst %.2f mm %.2f deg, NEES %.1f\n",
              name, a.found, a.asked, a.wrong, 1e3 * a.mean_m, kDeg * a.mean_rad, 1e3 * a.worst_m,
              kDeg * a.worst_rad, a.nees);
  return a;
}

/// Measures hard scenes of a tone curve, 1: none, that the finder is given. Seeds 1000–1007, or those of
/// OMNIFLEET_SEEDS=FIRST-LAST.
inline Accuracy measureHard(const dataset::MarkerSet& set, Body body, double gamma, const char* name) {
  int first = 1000, last = 1007;
  if (const char* seeds = std::getenv("OMNIFLEET_SEEDS")) std::sscanf(seeds, "%d-%d", &first, &last);
  Scene scene = hardScene(body);
  scene.imaging.tone_curve = gamma > 1.0;
  scene.options.tone_gamma = gamma;
  static const char* const kBodies[] = {"plate", "rim", "box", "floating"};
  const std::string title =
      std::string(name) + ", " + kBodies[static_cast<int>(body)] + (gamma > 1.0 ? ", tone curve" : "");
  return measure(set, scene, first, last - first + 1, title.c_str());
}

}  // namespace omnifleet::markers
