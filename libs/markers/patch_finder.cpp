#include "markers/patch_finder.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "markers/blobs.h"
#include "markers/colour_table.h"
#include "markers/hypotheses.h"
#include "markers/layout.h"
#include "markers/template_fit.h"

namespace omnifleet::markers {
namespace {

constexpr TimeNs kMemory_ns = 500000000;  // how long the last position of a robot is used to detect jumps
constexpr double kLeastOutline = 0.6;     // share of the outline that must have contrast
constexpr double kLeastRegion = 0.3;  // share of each region that must be visible: it identifies the robot
constexpr double kFittedTolerance = 1.5;  // chroma tolerance of a fitted colour ÷ that of a pixel
// Bias of the outline where the image does not follow the model (blur, compression, glare), px per unit of
// the residual. Measured in video of real robots: 0.2 to 0.3 px at a residual of 0.12.
constexpr double kScaleBias_px = 2.0;
constexpr double kScaleMargin = 0.02;  // difference of two sizes beyond the variation of prints
constexpr double kSameTurn_rad = 0.5;  // a smaller turn is the same interpretation of an object
constexpr double kOverlap = 0.25;      // share of one marker inside another one: only one can be right
// A second interpretation of the same pixels is rejected if its score is greater by this factor and offset.
constexpr double kScoreFactor = 1.25, kScoreOffset = 0.01;

ColourOptions coloursOf(const FinderOptions& options) {
  return {options.chroma_tolerance, options.min_brightness, options.min_saturation};
}

class TemplateFinder final : public MarkerFinder {
 public:
  TemplateFinder(const lens::Camera& camera, const dataset::MarkerSet& markers, const FinderOptions& options)
      : camera_(camera),
        options_(options),
        height_m_(markers.height_m),
        layout_(markers, coloursOf(options)),
        table_(layout_.colours(), coloursOf(options), layout_.touching()),
        hypotheses_(camera_, height_m_, layout_, table_, options),
        fit_(camera_, height_m_, layout_, table_, {options.pixel_sigma_px, options.scale_sigma}) {
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
      conflicts_ = contested_;
      since_search_ = 0;
    }
    report(bgr, time);
    return detections_;
  }

  const std::vector<Conflict>& conflicts() const override { return conflicts_; }

 private:
  struct Trail {
    Pose2 pose;
    TimeNs time_ns = 0;
    int seen = 0;  ///< consecutive frames with a detection
  };
  struct Candidate {
    std::size_t pattern = 0;
    Detection detection;
    double scale_error = 0.0, scale_sigma = 0.0;  ///< size in the image ÷ expected size − 1
    bool rejected = false;
  };

  bool windowsAround(cv::Size image);
  bool search(const cv::Mat& bgr, TimeNs time, const std::vector<cv::Rect>& windows);
  std::optional<Candidate> examine(const cv::Mat& bgr, const Hypothesis& hypothesis);
  void examineObjects(const cv::Mat& bgr);
  void examineTracks(const cv::Mat& bgr, TimeNs time);
  bool isKnown(const Hypothesis& hypothesis) const;
  bool isMarker(const Fit& fit, const Pattern& pattern) const;
  bool hasColour(const FittedRegion& region, std::uint8_t colour) const;
  bool overlap(const Candidate& a, const Candidate& b) const;
  void rejectOverlapping();
  void chooseOnePerRobot(TimeNs time);
  static const Candidate* bestScaled(const std::vector<const Candidate*>& of_robot);
  const Candidate* continuous(const std::vector<const Candidate*>& of_robot, TimeNs time) const;
  void setPixels(Detection& d) const;
  void refine(const cv::Mat& bgr, Detection& d);
  void report(const cv::Mat& bgr, TimeNs time);
  bool confirmed(const Detection& detection, TimeNs time);

  lens::Camera camera_;
  FinderOptions options_;
  double height_m_;
  Layout layout_;
  ColourTable table_;
  BlobFinder blobs_;
  HypothesisFinder hypotheses_;
  TemplateFit fit_;
  int since_search_ = 1 << 20;  ///< frames since the last search of the whole image
  std::vector<cv::Rect> windows_;
  std::vector<Candidate> candidates_;
  std::vector<Detection> detections_;
  std::vector<Conflict> contested_,
      conflicts_;  ///< of the last search, of the last search of the whole image
  std::map<std::string, Trail> trails_;
  TimeNs last_ns_ = 0;  ///< time of the previous frame
};

/// Sets the windows that can contain the robots. False unless all robots were found in the last frame.
bool TemplateFinder::windowsAround(cv::Size image) {
  constexpr int kMargin_px = 8;  // margin around a marker for the fit
  windows_.clear();
  const double reach = layout_.reach() + options_.window_m;
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
  return !windows_.empty() && windows_.size() == layout_.patterns().size();
}

/// Detects robots in the windows. False if a robot found in the last frame is missing.
bool TemplateFinder::search(const cv::Mat& bgr, TimeNs time, const std::vector<cv::Rect>& windows) {
  constexpr int kLeastArea_px = 6;
  candidates_.clear();
  for (const Hypothesis& hypothesis : hypotheses_.find(bgr, blobs_.find(bgr, table_, kLeastArea_px, windows)))
    if (!isKnown(hypothesis))
      if (auto candidate = examine(bgr, hypothesis)) candidates_.push_back(std::move(*candidate));
  if (layout_.isConnected()) examineObjects(bgr);
  examineTracks(bgr, time);
  rejectOverlapping();
  chooseOnePerRobot(time);
  return std::all_of(trails_.begin(), trails_.end(), [&](const auto& trail) {
    return trail.second.time_ns != last_ns_ ||
           std::any_of(detections_.begin(), detections_.end(),
                       [&](const Detection& d) { return d.robot == trail.first; });
  });
}

/// Fits the marker of a hypothesis. Empty if the image shows another object.
std::optional<TemplateFinder::Candidate> TemplateFinder::examine(const cv::Mat& bgr,
                                                                 const Hypothesis& hypothesis) {
  const Pattern& pattern = layout_.patterns()[hypothesis.pattern];
  const auto fit = fit_.fit(bgr, pattern, hypothesis.map_from_base, hypothesis.error_px);
  if (!fit || !isMarker(*fit, pattern)) return std::nullopt;
  Candidate candidate;
  candidate.pattern = hypothesis.pattern;
  Detection& d = candidate.detection;
  d.robot = pattern.robot;
  d.map_from_base = fit->map_from_base;
  d.covariance = fit->covariance;
  candidate.scale_error = std::abs(fit->scale - 1.0);
  candidate.scale_sigma = fit->scale_sigma;
  d.blur_px = {fit->luma_blur_px, fit->chroma_blur_px};
  d.score = fit->rms + fit->misfit;
  d.scale = fit->scale;
  setPixels(d);
  return candidate;
}

void TemplateFinder::setPixels(Detection& d) const {
  const auto pixelOf = [&](const Rectangle& rectangle) {
    const Eigen::Vector2d p = d.map_from_base * rectangle.centre_m;
    return camera_.pixelFromPoint({p.x(), p.y(), height_m_}).value_or(Eigen::Vector2d(-1, -1));
  };
  const auto& rectangles = layout_.rectangles();
  d.team_px = pixelOf(rectangles[rectangles.size() - 2]);
  d.individual_px = pixelOf(rectangles.back());
}

/// Cameras mix light at an edge before their tone curve makes grey levels of it. A fit to the levels moves
/// each edge into its darker side, and a marker with a dark and a bright surround on opposite sides with
/// them.
void TemplateFinder::refine(const cv::Mat& bgr, Detection& d) {
  constexpr double kDarkest = 40.0;  // grey levels
  if (options_.tone_gamma == 1.0) return;
  const auto pattern = std::find_if(layout_.patterns().begin(), layout_.patterns().end(),
                                    [&](const Pattern& p) { return p.robot == d.robot; });
  double brightness = 0.0;
  for (const Eigen::Vector2d& at : {d.team_px, d.individual_px}) {
    const auto* pixel = bgr.ptr<std::uint8_t>(std::clamp(cvRound(at.y()), 0, bgr.rows - 1)) +
                        3 * std::clamp(cvRound(at.x()), 0, bgr.cols - 1);
    brightness += 0.5 * std::max({pixel[0], pixel[1], pixel[2]});
  }
  const Tone tone(options_.tone_gamma, std::max(kDarkest, brightness));
  const auto refit = fit_.refit(bgr, *pattern, d.map_from_base, d.blur_px, d.scale, tone);
  if (!refit) return;
  d.map_from_base = refit->map_from_base;
  d.covariance = refit->covariance;
  setPixels(d);
}

/// Searches markers in the objects that contain no candidate yet.
void TemplateFinder::examineObjects(const cv::Mat& bgr) {
  constexpr int kLeastObject_px = 20;
  const std::size_t known = candidates_.size();
  for (const Blob& object : blobs_.objects(kLeastObject_px)) {
    const auto place = hypotheses_.placeOf(object);
    if (!place) continue;
    const bool explained =
        std::any_of(candidates_.begin(), candidates_.begin() + static_cast<std::ptrdiff_t>(known),
                    [&](const Candidate& c) {
                      return layout_.bounds().contains(c.detection.map_from_base.inverse() * *place);
                    });
    if (explained) continue;
    for (const Hypothesis& hypothesis : hypotheses_.findInObject(bgr, object))
      if (!isKnown(hypothesis))
        if (auto candidate = examine(bgr, hypothesis)) candidates_.push_back(std::move(*candidate));
  }
}

/// Fits the markers of robots without a candidate at their last places. The light on a marker changes, at the
/// image border too, so that its pixels leave the tolerance of their colour for some frames. What is accepted
/// is the same.
void TemplateFinder::examineTracks(const cv::Mat& bgr, TimeNs time) {
  constexpr double kMotion_px = 4.0;  // between two frames, within reach of the fit
  for (std::size_t p = 0; p < layout_.patterns().size(); ++p) {
    const auto trail = trails_.find(layout_.patterns()[p].robot);
    if (trail == trails_.end() || time - trail->second.time_ns > kMemory_ns) continue;
    if (std::any_of(candidates_.begin(), candidates_.end(),
                    [p](const Candidate& c) { return c.pattern == p; }))
      continue;
    if (auto candidate = examine(bgr, {p, trail->second.pose, kMotion_px, 0.0}))
      candidates_.push_back(std::move(*candidate));
  }
}

/// Whether the fit of an earlier hypothesis ended here.
bool TemplateFinder::isKnown(const Hypothesis& hypothesis) const {
  return std::any_of(candidates_.begin(), candidates_.end(), [&](const Candidate& c) {
    const Pose2 apart = c.detection.map_from_base.inverse() * hypothesis.map_from_base;
    return c.pattern == hypothesis.pattern && std::abs(apart.theta_rad) < kSameTurn_rad &&
           apart.translation().norm() < 0.5 * layout_.bounds().half_m.minCoeff();
  });
}

bool TemplateFinder::isMarker(const Fit& fit, const Pattern& pattern) const {
  if (fit.rms > options_.max_fit_rms || fit.misfit > options_.max_misfit || fit.outline < kLeastOutline)
    return false;
  const double half_px = layout_.bounds().half_m.minCoeff() / fit.metres_per_px;
  const double scale_error =
      options_.max_scale_error + 2.0 * fit.scale_sigma + kScaleBias_px * fit.rms / half_px;
  if (std::abs(fit.scale - 1.0) > scale_error) return false;
  for (std::size_t i = 0; i < fit.regions.size(); ++i)
    if (fit.regions[i].visible < kLeastRegion || !hasColour(fit.regions[i], pattern.colours[i])) return false;
  return fit.covariance.allFinite();
}

/// Whether the fitted colour is nearest to this class of all and within the tolerance.
bool TemplateFinder::hasColour(const FittedRegion& region, std::uint8_t colour) const {
  dataset::Rgb rgb;
  for (std::size_t c = 0; c < 3; ++c)
    rgb[c] = cv::saturate_cast<std::uint8_t>(region.bgr[static_cast<Eigen::Index>(2 - c)]);
  const auto& colours = layout_.colours();
  const double own = chromaDistance(rgb, colours[colour - 1U]);
  return own < kFittedTolerance * options_.chroma_tolerance &&
         std::all_of(colours.begin(), colours.end(),
                     [&](const dataset::Rgb& other) { return own <= chromaDistance(rgb, other); });
}

bool TemplateFinder::overlap(const Candidate& a, const Candidate& b) const {
  const Pose2 b_from_a = b.detection.map_from_base.inverse() * a.detection.map_from_base;
  const auto& points = layout_.patterns()[a.pattern].points;
  const auto inside = std::count_if(points.begin(), points.end(), [&](const LabelledPoint& point) {
    return layout_.bounds().contains(b_from_a * point.place_m);
  });
  return static_cast<double>(inside) > kOverlap * static_cast<double>(points.size());
}

/// Of overlapping candidates the best one is kept. None is kept if another robot or heading is about as good.
void TemplateFinder::rejectOverlapping() {
  std::stable_sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
    return a.detection.score < b.detection.score;
  });
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    if (candidates_[i].rejected) continue;
    Candidate& best = candidates_[i];
    bool ambiguous = false;
    for (std::size_t j = i + 1; j < candidates_.size(); ++j) {
      Candidate& other = candidates_[j];
      if (other.rejected || !overlap(best, other)) continue;
      other.rejected = true;
      const Pose2 apart = best.detection.map_from_base.inverse() * other.detection.map_from_base;
      const bool differs = other.pattern != best.pattern || std::abs(apart.theta_rad) > kSameTurn_rad;
      ambiguous = ambiguous ||
                  (differs && other.detection.score < kScoreFactor * best.detection.score + kScoreOffset);
    }
    best.rejected = ambiguous;
  }
  candidates_.erase(
      std::remove_if(candidates_.begin(), candidates_.end(), [](const Candidate& c) { return c.rejected; }),
      candidates_.end());
}

/// The candidate that continues the track of the robot, if it is clearly nearer than the others.
const TemplateFinder::Candidate* TemplateFinder::continuous(const std::vector<const Candidate*>& of_robot,
                                                            TimeNs time) const {
  const auto trail = trails_.find(of_robot.front()->detection.robot);
  if (trail == trails_.end() || time - trail->second.time_ns > kMemory_ns) return nullptr;
  const Candidate* nearest = nullptr;
  double least = options_.gate_m, second = 1e9;
  for (const Candidate* candidate : of_robot) {
    const double jump =
        (trail->second.pose.translation() - candidate->detection.map_from_base.translation()).norm();
    if (jump <= least) {
      second = nearest != nullptr ? least : second;
      least = jump;
      nearest = candidate;
    } else {
      second = std::min(second, jump);
    }
  }
  return second > 2.0 * least ? nearest : nullptr;
}

/// The candidate whose size is right while the sizes of all others are wrong: copies that lie on the floor.
const TemplateFinder::Candidate* TemplateFinder::bestScaled(const std::vector<const Candidate*>& of_robot) {
  const Candidate* best = *std::min_element(
      of_robot.begin(), of_robot.end(),
      [](const Candidate* a, const Candidate* b) { return a->scale_error < b->scale_error; });
  const bool clear = std::all_of(of_robot.begin(), of_robot.end(), [best](const Candidate* other) {
    return other == best || other->scale_error - best->scale_error >
                                kScaleMargin + 2.0 * std::hypot(best->scale_sigma, other->scale_sigma);
  });
  return clear ? best : nullptr;
}

void TemplateFinder::chooseOnePerRobot(TimeNs time) {
  detections_.clear();
  contested_.clear();
  for (std::size_t p = 0; p < layout_.patterns().size(); ++p) {
    std::vector<const Candidate*> of_robot;
    for (const Candidate& candidate : candidates_)
      if (candidate.pattern == p) of_robot.push_back(&candidate);
    if (of_robot.empty()) continue;
    const Candidate* chosen = of_robot.front();
    if (of_robot.size() > 1) {
      chosen = continuous(of_robot, time);
      if (chosen == nullptr) chosen = bestScaled(of_robot);
      Conflict conflict{layout_.patterns()[p].robot, {}, chosen != nullptr};
      for (const Candidate* candidate : of_robot)
        conflict.map_from_base.push_back(candidate->detection.map_from_base);
      contested_.push_back(std::move(conflict));
    }
    if (chosen != nullptr) detections_.push_back(chosen->detection);
  }
}

bool TemplateFinder::confirmed(const Detection& detection, TimeNs time) {
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

void TemplateFinder::report(const cv::Mat& bgr, TimeNs time) {
  detections_.erase(std::remove_if(detections_.begin(), detections_.end(),
                                   [&](const Detection& d) { return !confirmed(d, time); }),
                    detections_.end());
  last_ns_ = time;
  std::sort(detections_.begin(), detections_.end(),
            [](const Detection& a, const Detection& b) { return a.robot < b.robot; });
  for (Detection& d : detections_) refine(bgr, d);
  Eigen::Vector2d blur_px(0.0, 0.0);
  for (const Detection& d : detections_) blur_px += d.blur_px / static_cast<double>(detections_.size());
  if (!detections_.empty()) fit_.expectBlur(blur_px);
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
  section.read("max_misfit", o.max_misfit, {0.0, 1.0});
  section.read("max_scale_error", o.max_scale_error, {0.0, 0.3});
  section.read("scale_sigma", o.scale_sigma, {1e-4, 0.3});
  section.read("tone_gamma", o.tone_gamma, {1.0, 3.0});
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
  return std::make_unique<TemplateFinder>(camera, markers, options);
}

}  // namespace omnifleet::markers
