#include "markers/patch_finder.h"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "markers/blobs.h"
#include "markers/colour_table.h"
#include "markers/pairing.h"
#include "markers/rectangle_fit.h"
#include "markers/sub_pixel.h"

namespace omnifleet::markers {
namespace {

constexpr TimeNs kMemory_ns = 500000000;  // how long a robot's last place is held against a jump

class PatchFinder final : public MarkerFinder {
 public:
  PatchFinder(const lens::Camera& camera, const dataset::MarkerSet& markers, const FinderOptions& options)
      : camera_(camera),
        options_(options),
        height_m_(markers.height_m),
        pairs_(markers, options),
        fit_(markers, options),
        table_(pairs_.colours(), {options.chroma_tolerance, options.min_brightness, options.min_saturation}) {
    if (!(markers.height_m < camera.height())) {
      throw options::Error("markers: height_m: must be below the ceiling camera");
    }
  }

  const std::vector<Detection>& find(const cv::Mat& bgr, TimeNs time) override {
    if (bgr.type() != CV_8UC3 || bgr.cols != camera_.model().image_width_px ||
        bgr.rows != camera_.model().image_height_px) {
      throw std::runtime_error("markers: the image is not BGR or not of the camera's size");
    }
    collectPatches(bgr);
    pairs_.find(patches_, candidates_);
    preferContinuity(time);
    choose(time);
    return detections_;
  }

 private:
  struct Trail {
    Pose2 pose;
    TimeNs time_ns = 0;
    int seen = 0;  ///< frames in a row
  };

  void collectPatches(const cv::Mat& bgr);
  void preferContinuity(TimeNs time);
  void choose(TimeNs time);
  bool confirmed(const Detection& detection, TimeNs time);

  lens::Camera camera_;
  FinderOptions options_;
  double height_m_;
  PatchPairs pairs_;
  RectangleFit fit_;
  ColourTable table_;
  BlobFinder blobs_;
  std::vector<Patch> patches_;
  std::vector<Pair> candidates_;
  std::vector<Detection> detections_;
  std::map<std::string, Trail> trails_;
};

void PatchFinder::collectPatches(const cv::Mat& bgr) {
  constexpr int kLeastArea_px = 6;
  patches_.clear();
  const int right = bgr.cols - 1 - options_.border_px, bottom = bgr.rows - 1 - options_.border_px;
  for (const Blob& blob : blobs_.find(bgr, table_, kLeastArea_px)) {
    auto patch = refine(bgr, table_, blob, camera_, height_m_);
    if (!patch) continue;
    patch->cut = blob.left < options_.border_px || blob.top < options_.border_px || blob.right > right ||
                 blob.bottom > bottom;
    patches_.push_back(std::move(*patch));
  }
}

/// A pair where its robot just was beats an equal one elsewhere.
void PatchFinder::preferContinuity(TimeNs time) {
  for (Pair& pair : candidates_) {
    const auto trail = trails_.find(pair.detection.robot);
    if (trail == trails_.end() || time - trail->second.time_ns > kMemory_ns) continue;
    const double jump =
        (trail->second.pose.translation() - pair.detection.map_from_base.translation()).norm();
    pair.detection.score += std::min(4.0, (jump / options_.gate_m) * (jump / options_.gate_m));
  }
  std::stable_sort(candidates_.begin(), candidates_.end(),
                   [](const Pair& a, const Pair& b) { return a.detection.score < b.detection.score; });
}

bool PatchFinder::confirmed(const Detection& detection, TimeNs time) {
  Trail& trail = trails_[detection.robot];
  const bool recent = trail.seen > 0 && time - trail.time_ns <= kMemory_ns;
  const double jump = (trail.pose.translation() - detection.map_from_base.translation()).norm();
  trail.seen = recent && jump <= options_.gate_m ? trail.seen + 1 : 1;
  trail.pose = detection.map_from_base;
  trail.time_ns = time;
  // After a jump the robot must be seen twice at its new place.
  const bool jumped = recent && jump > options_.gate_m;
  return trail.seen >= options_.confirm_frames && !jumped;
}

void PatchFinder::choose(TimeNs time) {
  std::set<std::size_t> used;
  std::set<std::string> robots;
  detections_.clear();
  for (const Pair& pair : candidates_) {
    if (used.count(pair.team) > 0 || used.count(pair.individual) > 0) continue;
    if (!robots.insert(pair.detection.robot).second) continue;
    used.insert(pair.team);
    used.insert(pair.individual);
    Detection detection = pair.detection;
    if (!fit_.refine(patches_[pair.team], patches_[pair.individual], detection)) continue;
    if (confirmed(detection, time)) detections_.push_back(std::move(detection));
  }
  std::sort(detections_.begin(), detections_.end(),
            [](const Detection& a, const Detection& b) { return a.robot < b.robot; });
}

}  // namespace

FinderOptions FinderOptions::read(const options::Section& section) {
  FinderOptions o;
  section.read("chroma_tolerance", o.chroma_tolerance, {0.01, 1.0});
  section.read("min_brightness", o.min_brightness, {0.0, 255.0});
  section.read("min_saturation", o.min_saturation, {0.0, 1.0});
  section.read("distance_tolerance_m", o.distance_tolerance_m, options::kPositive);
  section.read("min_area_ratio", o.min_area_ratio, {0.0, 1.0});
  section.read("max_area_ratio", o.max_area_ratio, {1.0, 100.0});
  section.read("border_px", o.border_px, {0, 1000});
  section.read("max_fit_rms", o.max_fit_rms, {0.0, 1.0});
  section.read("pixel_sigma_px", o.pixel_sigma_px, options::kPositive);
  section.read("gate_m", o.gate_m, options::kPositive);
  section.read("confirm_frames", o.confirm_frames, {1, 1000});
  section.finish();
  return o;
}

std::unique_ptr<MarkerFinder> MarkerFinder::make(const lens::Camera& camera,
                                                 const dataset::MarkerSet& markers,
                                                 const FinderOptions& options) {
  switch (markers.kind) {
    case dataset::MarkerKind::kPatches:
      return std::make_unique<PatchFinder>(camera, markers, options);
    case dataset::MarkerKind::kCoverTailHead:
      break;
  }
  throw options::Error("markers: kind: only 'patches' has a finder");
}

}  // namespace omnifleet::markers
