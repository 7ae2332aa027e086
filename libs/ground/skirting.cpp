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
constexpr std::size_t kStride = 4;   // beams from one in the search to the next; other ones in each frame
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
  section.read("least_agree", o.least_agree, {0.0, 1.0});
  section.read("artefact_px", o.artefact_px, options::kNotNegative);
  section.read("least_beams", o.least_beams, options::kNotNegative);
  section.read("correlated_px", o.correlated_px, {1.0, 1000.0});
  section.read("least_parallax", o.least_parallax, options::kNotNegative);
  section.read("least_refuted", o.least_refuted, options::kNotNegative);
  o.parallax = scan::EdgeParallaxOptions::read(section.child("parallax"));
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
      votes_(kHeights),
      parallax_(options.parallax),
      followed_(floor.paths().size()),
      steps_(floor.paths().size() * kOffsets),
      evidence_(floor.paths().size() * kOffsets),
      places_(floor.paths().size()),
      ends_(floor.paths().size()) {
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
  profile.is_narrow = false;
  const float inverse = boundary.inverse_m[bearing];
  if (inverse <= 0.0f) return;
  const BearingPaths& paths = floor_.paths();
  const BearingPaths::Path& path = paths[bearing];
  profile.end = paths.placeOf(path, inverse) - kMixed_px;
  const double highest =
      paths.placeOf(path, static_cast<float>(inverse * factor(options_.max_height_m))) - kMixed_px;
  const int floor_end = static_cast<int>(highest), last = static_cast<int>(profile.end + 0.5);
  profile.first = floor_end - static_cast<int>(kFloor_px);
  profile.is_narrow = profile.end - highest < kLeast_px;
  if (profile.first < 0 || profile.is_narrow) return;
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

/// Nats: log likelihood ratio of a step to the mean deviation against none, for all beams.
double Skirting::evidenceOf(const Sum& sum) const {
  if (sum.weight_px <= 0.0) return 0.0;
  return 0.5 * kStride * sum.change.dot(information_ * sum.change) / sum.weight_px / options_.correlated_px;
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

std::size_t Skirting::firstBeam() const {
  return static_cast<std::size_t>(frames_) % kStride;
}

void Skirting::addEvidence(const Boundary& boundary) {
  const BearingPaths& paths = floor_.paths();
  for (Search* search : {&wide_, &all_}) std::fill(search->frame.begin(), search->frame.end(), Sum{});
  for (std::size_t i = firstBeam(); i < profiles_.size(); i += kStride) {
    const Profile& profile = profiles_[i];
    if (profile.count == 0) continue;
    const double inverse = boundary.inverse_m[i], cosine = incidence(boundary, i);
    const double last = profile.end + kMixed_px - options_.artefact_px;
    const auto addAt = [&](double place, int hypothesis) {
      const Sum step = stepAt(profile, place);
      for (Search* search : {&wide_, &all_}) {
        if (search == &wide_ && place > last) continue;
        Sum& sum = search->frame[static_cast<std::size_t>(hypothesis)];
        sum.change += step.change;
        sum.weight_px += step.weight_px;
      }
    };
    const auto add = [&](double inverse_there, int hypothesis) {
      addAt(paths.placeOf(paths[i], static_cast<float>(inverse_there)), hypothesis);
    };
    for (int h = 0; h < kHeights; ++h) add(inverse * factor(heightAt(h)), h);
    for (int w = 0; cosine > 0.1 && w < kWidths; ++w) {
      const double range_m = 1.0 / inverse - widthAt(w) / cosine;
      if (range_m > 0.0) add(1.0 / range_m, kHeights + w);
    }
    for (int p = 0; p < kPixels; ++p) addAt(last - p, kHeights + kWidths + p);
  }
  ++frames_;
  const double share = 1.0 / std::min<double>(frames_, options_.memory_frames);
  for (Search* search : {&wide_, &all_}) {
    for (std::size_t k = 0; k < search->sums.size(); ++k) {
      Sum& sum = search->sums[k];
      sum.change += (search->frame[k].change - sum.change) * share;
      sum.weight_px += (search->frame[k].weight_px - sum.weight_px) * share;
    }
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

/// Adds the height that this frame gives by itself. @return share of the frames with the same height as
/// given; sets their variance
double Skirting::vote(double height_m) {
  const auto index = static_cast<std::size_t>(std::lround(bestHeight(all_.frame)));
  const double share = 1.0 / options_.memory_frames;
  for (double& votes : votes_) votes *= 1.0 - share;
  if (evidenceOf(all_.frame[index]) >= options_.least_evidence) votes_[index] += 1.0;
  double all = 0.0, same = 0.0, squares_m2 = 0.0;
  for (std::size_t h = 0; h < votes_.size(); ++h) {
    const double off_m = heightAt(static_cast<double>(h)) - height_m;
    all += votes_[h];
    if (std::abs(off_m) > options_.most_spread_m) continue;
    same += votes_[h];
    squares_m2 += votes_[h] * off_m * off_m;
  }
  variance_m2_ = same > 0.0 ? squares_m2 / same : 0.0;
  return all > 0.0 ? same / all : 0.0;
}

/// Sets the height with most evidence, if that suffices, exceeds the evidence of each strip on the floor, and
/// single frames give the same height. Half of the evidence suffices for boards that are proposed, so that
/// ends do not alternate.
bool Skirting::propose() {
  const double least = proposed_m_ > 0.0 ? 0.5 * options_.least_evidence : options_.least_evidence;
  proposed_m_ = 0.0;
  const double index = bestHeight(all_.sums);
  const Sum& sum = all_.sums[static_cast<std::size_t>(std::lround(index))];
  const double evidence = evidenceOf(sum), lead = evidence - most(all_, kHeights, kHeights + kWidths),
               agree = vote(heightAt(index));
  if (lead < least || lead < options_.least_lead * evidence || agree < options_.least_agree) return false;
  if (index <= 0.0 || index >= kHeights - 1.0) return false;  // more evidence may lie beyond
  proposed_m_ = heightAt(index);
  change_ = sum.change / sum.weight_px;
  return true;
}

double Skirting::most(const Search& search, int from, int to) const {
  double evidence = 0.0;
  for (int k = from; k < to; ++k)
    evidence = std::max(evidence, evidenceOf(search.sums[static_cast<std::size_t>(k)]));
  return evidence;
}

/// Whether boards that are wider than what blur and compression colour give the proposed height, rather than
/// strips of one width in the image.
bool Skirting::isWide() const {
  const double least = height_m_ > 0.0 ? 0.5 * options_.least_evidence : options_.least_evidence;
  const double index = bestHeight(wide_.sums),
               evidence = evidenceOf(wide_.sums[static_cast<std::size_t>(std::lround(index))]),
               lead = evidence - most(wide_, kHeights + kWidths, kHypotheses);
  return lead >= least && lead >= options_.least_lead * evidence &&
         std::abs(heightAt(index) - proposed_m_) < options_.most_spread_m;
}

/// Nats, for upper edges as high as the proposed boards against edges on the floor, by their parallax.
double Skirting::parallaxEvidence(const Boundary& boundary) {
  if (std::abs(proposed_m_ - parallax_height_m_) > options_.most_spread_m) {
    parallax_.restart();
    parallax_height_m_ = proposed_m_;
  }
  for (std::size_t i = 0; i < followed_.size(); ++i) followed_[i] = places_[i].evidence > 0.0;
  parallax_.add(boundary, followed_);
  const double board = factor(proposed_m_) - 1.0, excess = parallax_.excess(), sigma = parallax_.sigma();
  return 0.5 * board * (2.0 * excess - board) / (sigma * sigma);
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
      const auto foot = static_cast<float>(boundary.inverse_m[i] * factor(proposed_m_ + offsetAt(o)));
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

/// The end of a beam at a board: where height and the beams beside it place the foot, or at the edge there.
void Skirting::moveToFoot(const cv::Mat& image, std::size_t i, Boundary& boundary) {
  const BearingPaths& paths = floor_.paths();
  const auto inverse =
      static_cast<float>(boundary.inverse_m[i] * factor(height_m_ + offsetAt(places_[i].offset)));
  const double foot = paths.placeOf(paths[i], inverse);
  boundary.inverse_m[i] = inverse;
  boundary.sigma[i] = static_cast<float>(options_.sigma_px) * std::abs(paths.slopeAt(paths[i], foot));
  if (profiles_[i].end - foot < kRefine_px) return;
  const auto edge = floor_.refine(i, static_cast<int>(std::lround(foot)), image);
  if (!edge || std::abs(paths.placeOf(paths[i], edge->inverse_m) - foot) > kRefined_px) return;
  boundary.inverse_m[i] = edge->inverse_m;
  boundary.sigma[i] = edge->sigma;
}

const std::vector<Skirting::End>& Skirting::apply(const cv::Mat& image, const Motion& motion,
                                                  Boundary& boundary) {
  std::fill(ends_.begin(), ends_.end(), End::kOther);
  if (!options_.use || boundary.inverse_m.size() != profiles_.size()) return ends_;
  const Pose2 base_from_scan{boundary.origin_m.x(), boundary.origin_m.y(), 0.0};
  if (motion.valid)
    parallax_.move(base_from_scan.inverse() * motion.previous_from_current * base_from_scan);
  else
    parallax_.forget();
  sums_.clear();
  texture_ = Eigen::Matrix3d::Zero();
  textured_ = 0;
  const std::size_t first = firstBeam();
  for (std::size_t i = first; i < profiles_.size(); i += kStride) readProfile(image, boundary, i);
  if (textured_ == 0) return ends_;
  information_ = (texture_ / textured_ + kLeastVariance * Eigen::Matrix3d::Identity()).inverse();
  addEvidence(boundary);
  const bool is_proposed = propose();
  bool is_known = is_proposed && isWide();
  height_m_ = 0.0;
  if (!is_proposed) return ends_;
  for (std::size_t i = 0; i < profiles_.size(); ++i)
    if (i % kStride != first) readProfile(image, boundary, i);
  compareBeams(boundary);
  if (!is_known) {
    const double evidence = parallaxEvidence(boundary);
    if (evidence <= -options_.least_refuted) return ends_;
    is_known = evidence >= options_.least_parallax;
  }
  const bool is_settled = frames_ >= options_.least_frames;  // before, only σ allows for boards
  is_known = is_known && is_settled;
  if (is_known) height_m_ = proposed_m_;
  for (std::size_t i = 0; i < ends_.size(); ++i) {
    const double evidence = places_[i].evidence, upper = boundary.inverse_m[i];
    const bool is_near = profiles_[i].count == 0 && !profiles_[i].is_narrow;  // too little floor before it
    if (upper <= 0.0 || is_near || evidence <= -options_.least_beams) continue;
    if (is_known && evidence >= options_.least_beams) {
      ends_[i] = End::kFoot;
      moveToFoot(image, i, boundary);
    } else {
      if (is_settled) ends_[i] = End::kUndecided;
      boundary.sigma[i] = static_cast<float>(std::hypot(boundary.sigma[i], 0.5 * upper * (factor() - 1.0)));
    }
  }
  return ends_;
}

}  // namespace omnifleet::ground
