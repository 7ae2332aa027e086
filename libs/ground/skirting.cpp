#include "ground/skirting.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace omnifleet::ground {
namespace {

constexpr double kFloor_px = 16.0;  // of floor before the highest board, from which its light is extrapolated
constexpr double kSide_px = 3.0;    // before and beyond a foot that are compared, at most
constexpr double kMixed_px = 1.0;   // beside an edge, where pixels show both sides
constexpr double kLeast_px = 2.0;   // of the highest board, at least
constexpr double kRefine_px = 6.0;  // of a board on which its foot is located by itself
constexpr double kRefined_px = 1.5;      // by which that may differ from where the height places it
constexpr double kLeastVariance = 1e-6;  // of a colour: 0.1 % of the floor's brightness, rounding
constexpr double kMinWidth_m = 0.01, kMaxWidth_m = 0.6;
constexpr double kOffset_m = 0.005;  // between the heights that are compared for single beams
constexpr int kRounds = 4;
constexpr int kBeside = 6;      // beams to both sides that decide together
constexpr float kJump = 0.15f;  // share of the inverse range by which they may differ

}  // namespace

SkirtingOptions SkirtingOptions::read(const options::Section& section) {
  SkirtingOptions o;
  section.read("use", o.use);
  section.read("min_height_m", o.min_height_m, {0.01, 0.5});
  section.read("max_height_m", o.max_height_m, {0.01, 0.5});
  section.read("least_evidence", o.least_evidence, options::kNotNegative);
  section.read("sigma_px", o.sigma_px, {0.01, 5.0});
  section.read("least_lead", o.least_lead, {0.0, 1.0});
  section.read("most_spread_m", o.most_spread_m, options::kPositive);
  section.read("least_beams", o.least_beams, options::kNotNegative);
  section.read("correlated_px", o.correlated_px, {1.0, 1000.0});
  section.read("least_frames", o.least_frames, {1, 1000});
  section.read("memory_frames", o.memory_frames, {1.0, 1000.0});
  section.finish();
  return o;
}

Skirting::Skirting(double camera_height_m, const FloorBoundary& floor, const SkirtingOptions& options)
    : camera_m_(camera_height_m),
      floor_(floor),
      options_(options),
      profiles_(floor.paths().size()),
      heights_(kHeights),
      widths_(kWidths),
      frame_(kHeights + kWidths),
      steps_(floor.paths().size() * kOffsets),
      evidence_(floor.paths().size() * kOffsets),
      places_(floor.paths().size()),
      moved_(floor.paths().size()) {
  // A board as high as the camera would hide its own foot.
  options_.max_height_m = std::min(options_.max_height_m, 0.5 * camera_m_);
  options_.use = options_.use && options_.min_height_m < options_.max_height_m;
}

double Skirting::heightAt(double index) const {
  return options_.min_height_m + (options_.max_height_m - options_.min_height_m) * index / (kHeights - 1);
}

/// Evenly spaced by ratio.
double Skirting::widthAt(int index) const {
  return kMinWidth_m * std::pow(kMaxWidth_m / kMinWidth_m, static_cast<double>(index) / (kWidths - 1));
}

/// Inverse range of the foot of a board, relative to that of its upper edge.
double Skirting::factor(double height_m) const {
  return camera_m_ / (camera_m_ - height_m);
}

/// Sets the profile of a bearing. The floor's light is a line per channel through the floor before the
/// highest board; the profile holds cumulative deviations from it, relative to the floor's brightness.
void Skirting::readProfile(const cv::Mat& image, const Boundary& boundary, std::size_t bearing) {
  Profile& profile = profiles_[bearing];
  profile.count = 0;
  const float inverse = boundary.inverse_m[bearing];
  if (inverse <= 0.0f) return;
  const BearingPaths& paths = floor_.paths();
  const BearingPaths::Path& path = paths[bearing];
  profile.end = paths.placeOf(path, inverse) - kMixed_px;
  const double highest =
      paths.placeOf(path, static_cast<float>(inverse * factor(options_.max_height_m))) - kMixed_px;
  const int floor_end = static_cast<int>(highest), last = static_cast<int>(profile.end + 0.5);
  profile.first = floor_end - static_cast<int>(kFloor_px);
  if (profile.first < 0 || profile.end - highest < kLeast_px) return;
  colours_.clear();
  for (int k = profile.first; k <= last; ++k) {
    const cv::Vec3f colour = paths.colour(image, path, k);
    colours_.emplace_back(colour[0], colour[1], colour[2]);
  }
  const auto n = static_cast<std::size_t>(kFloor_px);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), moment = Eigen::Vector3d::Zero();
  double squares = 0.0;
  const double middle = 0.5 * static_cast<double>(n - 1);
  for (std::size_t k = 0; k < n; ++k) {
    const double x = static_cast<double>(k) - middle;
    sum += colours_[k];
    moment += x * colours_[k];
    squares += x * x;
  }
  const Eigen::Vector3d level = sum / static_cast<double>(n), slope = moment / squares;
  const double brightness = std::max(1.0, level.mean());
  profile.begin = sums_.size();
  sums_.emplace_back(0.0, 0.0, 0.0);
  for (std::size_t k = 0; k < colours_.size(); ++k) {
    const Eigen::Vector3d deviation =
        (colours_[k] - level - (static_cast<double>(k) - middle) * slope) / brightness;
    sums_.push_back(sums_.back() + deviation);
    if (k < n) {
      texture_ += deviation * deviation.transpose();
      ++textured_;
    }
  }
  profile.count = sums_.size() - profile.begin;
}

/// Mean of the deviations between two places of a profile. Sample k covers [k − ½, k + ½).
Eigen::Vector3d Skirting::mean(const Profile& profile, double from, double to) const {
  const auto until = [&](double place) -> Eigen::Vector3d {
    const double i = std::clamp(place - profile.first + 0.5, 0.0, static_cast<double>(profile.count) - 1.001);
    const auto k = profile.begin + static_cast<std::size_t>(i);
    const double f = i - std::floor(i);
    return sums_[k] * (1.0 - f) + sums_[k + 1] * f;
  };
  return (until(to) - until(from)) / (to - from);
}

/// The step of colour at a foot: mean of the board less that of the floor before it. Weight 0: not in the
/// profile.
Skirting::Sum Skirting::stepAt(const Profile& profile, double foot) const {
  Sum step;
  const double beyond = foot + kMixed_px, length_px = std::min(kSide_px, profile.end - beyond),
               before = foot - kMixed_px, earlier = before - kSide_px - 2.0 * kMixed_px;
  if (length_px < 1.0 || earlier - kSide_px < profile.first) return step;
  step.weight_px = length_px * kSide_px / (length_px + kSide_px);
  const Eigen::Vector3d floor = mean(profile, before - kSide_px, before),
                        drift = floor - mean(profile, earlier - kSide_px, earlier);
  step.change = step.weight_px * (mean(profile, beyond, beyond + length_px) - floor - drift);
  return step;
}

/// Nats: log likelihood ratio of a step to the mean deviation against none.
double Skirting::evidenceOf(const Sum& sum) const {
  if (sum.weight_px <= 0.0) return 0.0;
  return 0.5 * sum.change.dot(information_ * sum.change) / sum.weight_px / options_.correlated_px;
}

/// Cosine between a beam and the normal of what it ends at; 0: unknown.
double Skirting::incidence(const Boundary& boundary, std::size_t bearing) const {
  const std::size_t n = profiles_.size();
  const auto at = [&](std::size_t i) -> Eigen::Vector2d {
    const double angle = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(n);
    return Eigen::Vector2d(std::cos(angle), std::sin(angle)) / boundary.inverse_m[i];
  };
  const std::size_t left = (bearing + 3) % n, right = (bearing + n - 3) % n;
  if (boundary.inverse_m[left] <= 0.0f || boundary.inverse_m[right] <= 0.0f) return 0.0;
  const Eigen::Vector2d along = (at(left) - at(right)).normalized(), beam = at(bearing).normalized();
  return std::abs(along.x() * beam.y() - along.y() * beam.x());
}

void Skirting::addEvidence(const Boundary& boundary) {
  const BearingPaths& paths = floor_.paths();
  std::fill(frame_.begin(), frame_.end(), Sum{});
  for (std::size_t i = 0; i < profiles_.size(); ++i) {
    const Profile& profile = profiles_[i];
    if (profile.count == 0) continue;
    const double inverse = boundary.inverse_m[i], cosine = incidence(boundary, i);
    const auto add = [&](double inverse_there, Sum& sum) {
      const Sum step = stepAt(profile, paths.placeOf(paths[i], static_cast<float>(inverse_there)));
      sum.change += step.change;
      sum.weight_px += step.weight_px;
    };
    for (int h = 0; h < kHeights; ++h)
      add(inverse * factor(heightAt(h)), frame_[static_cast<std::size_t>(h)]);
    for (int w = 0; cosine > 0.1 && w < kWidths; ++w) {
      const double range_m = 1.0 / inverse - widthAt(w) / cosine;
      if (range_m > 0.0) add(1.0 / range_m, frame_[static_cast<std::size_t>(kHeights + w)]);
    }
  }
  ++frames_;
  const double share = 1.0 / std::min<double>(frames_, options_.memory_frames);
  for (std::size_t k = 0; k < frame_.size(); ++k) {
    Sum& sum = k < kHeights ? heights_[k] : widths_[k - kHeights];
    sum.change += (frame_[k].change - sum.change) * share;
    sum.weight_px += (frame_[k].weight_px - sum.weight_px) * share;
  }
}

/// Index of the height with most evidence: the vertex of the parabola through the greatest and its
/// neighbours.
double Skirting::bestHeight(const std::vector<Sum>& sums) const {
  int index = 0;
  double best = 0.0;
  for (int h = 0; h < kHeights; ++h) {
    const double evidence = evidenceOf(sums[static_cast<std::size_t>(h)]);
    if (evidence <= best) continue;
    best = evidence;
    index = h;
  }
  if (index == 0 || index + 1 == kHeights) return index;
  const double before = evidenceOf(sums[static_cast<std::size_t>(index - 1)]),
               after = evidenceOf(sums[static_cast<std::size_t>(index + 1)]),
               bend = before - 2.0 * best + after;
  return bend < 0.0 ? index + std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : index;
}

/// Sets the height with most evidence, if that suffices, exceeds the evidence of each width, and single
/// frames give the same height. Half of the evidence suffices for boards that are known, so that ends do not
/// alternate.
bool Skirting::decide() {
  const double least = height_m_ > 0.0 ? 0.5 * options_.least_evidence : options_.least_evidence;
  height_m_ = 0.0;
  const double index = bestHeight(heights_);
  const Sum& sum = heights_[static_cast<std::size_t>(std::lround(index))];
  double width = 0.0;
  for (const Sum& other : widths_) width = std::max(width, evidenceOf(other));
  const double off_m = heightAt(bestHeight(frame_)) - heightAt(index);
  variance_m2_ += (off_m * off_m - variance_m2_) / std::min<double>(frames_, options_.memory_frames);
  if (frames_ < options_.least_frames) return false;
  const double evidence = evidenceOf(sum), lead = evidence - width;
  if (lead < least || lead < options_.least_lead * evidence ||
      std::sqrt(variance_m2_) > options_.most_spread_m)
    return false;
  height_m_ = heightAt(index);
  change_ = sum.change / sum.weight_px;
  return true;
}

/// Log likelihood ratios of a board against none for each beam, over heights around that of the boards,
/// together with the beams beside it and the spread of the heights. Not all beams end at a board, so its
/// change of colour is the mean of those that do, found in turn with which they are (expectation maximization
/// with hard decisions).
void Skirting::compareBeams(const Boundary& boundary) {
  const BearingPaths& paths = floor_.paths();
  const std::size_t n = profiles_.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (int o = 0; o < kOffsets; ++o) {
      Sum& step = steps_[i * kOffsets + static_cast<std::size_t>(o)];
      step = {};
      if (profiles_[i].count == 0) continue;
      const auto foot = static_cast<float>(boundary.inverse_m[i] * factor(height_m_ + offsetAt(o)));
      step = stepAt(profiles_[i], paths.placeOf(paths[i], foot));
    }
  }
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t k = 0; k < steps_.size(); ++k)
      evidence_[k] = change_.dot(information_ * (steps_[k].change - 0.5 * steps_[k].weight_px * change_)) /
                     options_.correlated_px;
    Sum sum;
    for (std::size_t i = 0; i < n; ++i) {
      placeBeam(boundary, i);
      if (places_[i].evidence <= 0.0) continue;
      const Sum& step = steps_[i * kOffsets + static_cast<std::size_t>(std::lround(places_[i].offset))];
      sum.change += step.change;
      sum.weight_px += step.weight_px;
    }
    if (sum.weight_px <= 0.0) return;
    change_ = sum.change / sum.weight_px;
  }
}

double Skirting::offsetAt(double index) const {
  return (index - 0.5 * (kOffsets - 1)) * kOffset_m;
}

/// The most likely foot of a beam: sums over the beams beside it, maximum over the heights.
void Skirting::placeBeam(const Boundary& boundary, std::size_t bearing) {
  const std::size_t n = profiles_.size();
  std::array<double, kOffsets> sums{};
  const float own = boundary.inverse_m[bearing];
  for (int d = -kBeside; d <= kBeside; ++d) {
    const std::size_t k = (bearing + n + static_cast<std::size_t>(d + static_cast<int>(n))) % n;
    if (std::abs(boundary.inverse_m[k] - own) > kJump * own) continue;
    for (std::size_t o = 0; o < kOffsets; ++o) sums[o] += evidence_[k * kOffsets + o];
  }
  const double variance = std::max(variance_m2_, kOffset_m * kOffset_m);
  for (int o = 0; o < kOffsets; ++o)
    sums[static_cast<std::size_t>(o)] -= 0.5 * offsetAt(o) * offsetAt(o) / variance;
  const auto best = std::max_element(sums.begin(), sums.end());
  Place& place = places_[bearing];
  place.evidence = profiles_[bearing].count > 0 ? *best : 0.0;
  place.offset = static_cast<double>(best - sums.begin());
  if (best == sums.begin() || best + 1 == sums.end()) return;
  const double bend = *(best - 1) - 2.0 * *best + *(best + 1);
  if (bend < 0.0) place.offset += std::clamp(0.5 * (*(best - 1) - *(best + 1)) / bend, -0.5, 0.5);
}

const std::vector<std::uint8_t>& Skirting::apply(const cv::Mat& image, Boundary& boundary) {
  std::fill(moved_.begin(), moved_.end(), std::uint8_t{0});
  if (!options_.use || boundary.inverse_m.size() != profiles_.size()) return moved_;
  sums_.clear();
  texture_ = Eigen::Matrix3d::Zero();
  textured_ = 0;
  for (std::size_t i = 0; i < profiles_.size(); ++i) readProfile(image, boundary, i);
  if (textured_ == 0) return moved_;
  information_ = (texture_ / textured_ + kLeastVariance * Eigen::Matrix3d::Identity()).inverse();
  addEvidence(boundary);
  if (!decide()) return moved_;
  compareBeams(boundary);
  const BearingPaths& paths = floor_.paths();
  const std::size_t n = profiles_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Place& place = places_[i];
    const double upper = boundary.inverse_m[i], inverse = upper * factor(height_m_ + offsetAt(place.offset));
    if (upper <= 0.0) continue;
    if (std::abs(place.evidence) < options_.least_beams) {  // it may end at the foot or at the upper edge
      boundary.sigma[i] =
          static_cast<float>(std::hypot(boundary.sigma[i], 0.5 * upper * (factor(height_m_) - 1.0)));
      continue;
    }
    if (place.evidence < 0.0) continue;
    moved_[i] = 1;
    const double foot = paths.placeOf(paths[i], static_cast<float>(inverse));
    boundary.inverse_m[i] = static_cast<float>(inverse);
    boundary.sigma[i] = static_cast<float>(options_.sigma_px) * std::abs(paths.slopeAt(paths[i], foot));
    if (profiles_[i].end - foot < kRefine_px) continue;
    const auto edge = floor_.refine(i, static_cast<int>(std::lround(foot)), image);
    if (!edge || std::abs(paths.placeOf(paths[i], edge->inverse_m) - foot) > kRefined_px) continue;
    boundary.inverse_m[i] = edge->inverse_m;
    boundary.sigma[i] = edge->sigma;
  }
  return moved_;
}

}  // namespace omnifleet::ground
