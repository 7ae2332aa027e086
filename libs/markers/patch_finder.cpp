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

constexpr TimeNs kMemory_ns = 500000000;  // how long the last position of a robot is used to detect jumps

class PatchFinder final : public MarkerFinder {
 public:
  PatchFinder(const lens::Camera& camera, const dataset::MarkerSet& markers, const FinderOptions& options)
      : camera_(camera),
        options_(options),
        height_m_(markers.height_m),
        pairs_(markers, options),
        fit_(markers, options),
        reach_m_(std::max(markers.team_offset_m.norm(), markers.individual_offset_m.norm()) +
                 0.5 * markers.patch_size_m.norm()),
        robots_(markers.robots.size()),
        table_(pairs_.colours(), {options.chroma_tolerance, options.min_brightness, options.min_saturation}) {
    if (!(markers.height_m < camera.height())) {
      throw options::Error("markers: height_m: must be below the ceiling camera");
    }
  }

  const std::vector<Detection>& find(const cv::Mat& bgr, TimeNs time) override {
    if (bgr.type() != CV_8UC3 || bgr.cols != camera_.model().image_width_px ||
        bgr.rows != camera_.model().image_height_px) {
      throw std::runtime_error("markers: the image must be BGR (CV_8UC3) and have the size of the camera");
    }
    // The whole image is searched every search_every_frames frames, because a robot may appear anywhere. It
    // is also searched at once if a robot is not found near its last position.
    if (++since_search_ >= options_.search_every_frames || !windowsAround(bgr.size()) ||
        !search(bgr, time, windows_)) {
      windows_.assign(1, cv::Rect({0, 0}, bgr.size()));
      search(bgr, time, windows_);
      since_search_ = 0;
    }
    report(time);
    return detections_;
  }

 private:
  struct Trail {
    Pose2 pose;
    TimeNs time_ns = 0;
    int seen = 0;  ///< consecutive frames with a detection
  };

  bool windowsAround(cv::Size image);
  bool search(const cv::Mat& bgr, TimeNs time, const std::vector<cv::Rect>& windows);
  void collectPatches(const cv::Mat& bgr, const std::vector<cv::Rect>& windows);
  void preferContinuity(TimeNs time);
  void choose();
  void report(TimeNs time);
  bool confirmed(const Detection& detection, TimeNs time);

  lens::Camera camera_;
  FinderOptions options_;
  double height_m_;
  PatchPairs pairs_;
  RectangleFit fit_;
  double reach_m_;      ///< m, from base_link to the farthest corner of a patch
  std::size_t robots_;  ///< number of robots in the marker set
  ColourTable table_;
  BlobFinder blobs_;
  int since_search_ = 1 << 20;  ///< frames since the last search of the whole image
  std::vector<cv::Rect> windows_;
  std::vector<Patch> patches_;
  std::vector<Pair> candidates_;
  std::vector<Detection> detections_;
  std::map<std::string, Trail> trails_;
  TimeNs last_ns_ = 0;  ///< time of the previous frame
};

/// Sets the windows that can contain the robots. False unless all robots were found in the last frame.
bool PatchFinder::windowsAround(cv::Size image) {
  constexpr int kMargin_px = 8;  // margin around a patch for sub-pixel refinement
  windows_.clear();
  const double reach = reach_m_ + options_.window_m;
  for (const auto& [robot, trail] : trails_) {
    if (trail.time_ns != last_ns_) continue;
    cv::Rect window;
    for (const double dx : {-reach, reach}) {
      for (const double dy : {-reach, reach}) {
        const Eigen::Vector2d corner = trail.pose.translation() + Eigen::Vector2d(dx, dy);
        const auto pixel = camera_.pixelFromPoint({corner.x(), corner.y(), height_m_});
        if (!pixel) return false;
        const cv::Rect here(cvFloor(pixel->x()) - kMargin_px, cvFloor(pixel->y()) - kMargin_px,
                            2 * kMargin_px + 1, 2 * kMargin_px + 1);
        window = window.empty() ? here : window | here;
      }
    }
    windows_.push_back(window & cv::Rect({0, 0}, image));
  }
  return windows_.size() == robots_ && robots_ > 0;
}

/// Detects robots in the windows. False if a robot found in the last frame is missing.
bool PatchFinder::search(const cv::Mat& bgr, TimeNs time, const std::vector<cv::Rect>& windows) {
  collectPatches(bgr, windows);
  pairs_.find(patches_, candidates_);
  preferContinuity(time);
  choose();
  return std::all_of(trails_.begin(), trails_.end(), [&](const auto& trail) {
    return trail.second.time_ns != last_ns_ ||
           std::any_of(detections_.begin(), detections_.end(),
                       [&](const Detection& d) { return d.robot == trail.first; });
  });
}

void PatchFinder::collectPatches(const cv::Mat& bgr, const std::vector<cv::Rect>& windows) {
  constexpr int kLeastArea_px = 6;
  patches_.clear();
  const int right = bgr.cols - 1 - options_.border_px, bottom = bgr.rows - 1 - options_.border_px;
  for (const Blob& blob : blobs_.find(bgr, table_, kLeastArea_px, windows)) {
    auto patch = refine(bgr, table_, blob, camera_, height_m_);
    if (!patch) continue;
    patch->cut = blob.left < options_.border_px || blob.top < options_.border_px || blob.right > right ||
                 blob.bottom > bottom;
    patches_.push_back(std::move(*patch));
  }
}

/// Prefers a pair near the last position of its robot over an equal one elsewhere.
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
  // After a jump, the robot must be found twice at the new position.
  const bool jumped = recent && jump > options_.gate_m;
  return trail.seen >= options_.confirm_frames && !jumped;
}

void PatchFinder::choose() {
  std::set<std::size_t> used;
  std::set<std::string> robots;
  detections_.clear();
  for (const Pair& pair : candidates_) {
    if (used.count(pair.team) > 0 || used.count(pair.individual) > 0) continue;
    if (!robots.insert(pair.detection.robot).second) continue;
    used.insert(pair.team);
    used.insert(pair.individual);
    Detection detection = pair.detection;
    if (fit_.refine(patches_[pair.team], patches_[pair.individual], detection))
      detections_.push_back(std::move(detection));
  }
}

void PatchFinder::report(TimeNs time) {
  detections_.erase(std::remove_if(detections_.begin(), detections_.end(),
                                   [&](const Detection& d) { return !confirmed(d, time); }),
                    detections_.end());
  last_ns_ = time;
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
  section.read("search_every_frames", o.search_every_frames, {1, 1000});
  section.read("window_m", o.window_m, options::kPositive);
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
  throw options::Error("markers: kind: must be patches; no detector supports the other kinds");
}

}  // namespace omnifleet::markers
