#include "laser/laser_mapper.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "outline/convex_hull.h"

namespace omnifleet::laser {
namespace {

constexpr std::size_t kMostObjects = 64, kMostRays = 1440;  // limits of a local map on the wire

}  // namespace

Options Options::read(const options::Section& section) {
  Options o;
  o.segments = SegmentOptions::read(section.child("segments"));
  section.read("split_sigmas", o.split_sigmas, {0.0, 100.0});
  section.read("split_m", o.split_m, {1e-4, 1.0});
  section.read("hollow_deg", o.hollow_deg, {1.0, 180.0});
  section.read("max_size_m", o.max_size_m, {0.05, 100.0});
  section.read("max_contact_m", o.max_contact_m, {0.1, 100.0});
  section.read("min_beams", o.min_beams, {3, 1000});
  section.finish();
  return o;
}

const LocalMap& LaserMapper::process(const dataset::LaserRow& row, std::uint32_t sequence,
                                     const Motion& wheels) {
  map_.acquired_ns = row.time_ns;
  map_.sequence = sequence;
  map_.camera_height_m = 0.0;
  map_.motion = wheels;
  map_.objects.clear();
  map_.scan = Scan{};
  map_.boundary.clear();
  fault_ = "";
  map_.state = check(row);
  if (map_.state == FrameState::kOk) {
    beams_.set(row, sensor_);
    checkEchoes(row);
  }
  if (map_.state != FrameState::kOk) return map_;
  segments(beams_, sensor_.range_sigma_m, options_.segments, segments_);  // cut at range jumps
  label_.assign(beams_.size(), RayLabel::kUnknown);
  object_.assign(beams_.size(), 0);
  for (const Segment& segment : segments_) {
    splitAtConcaveCorners(segment);  // separate touching objects
    for (const Segment& part : convex_) measure(part);
  }
  fillScan();
  fillBoundary();
  return map_;
}

FrameState LaserMapper::check(const dataset::LaserRow& row) {
  const std::size_t beams = row.range_m.size();
  if (!dataset::problemOf(row, 0).empty()) return FrameState::kNonFinite;
  if (beam_count_ == 0) beam_count_ = beams;
  return beams == beam_count_ ? FrameState::kOk : FrameState::kWrongSize;
}

/// A scan without any echo: the scanner is defective or occluded, or its ranges are not in metres. The room
/// must not appear free.
void LaserMapper::checkEchoes(const dataset::LaserRow& row) {
  const auto is_hit = [](const Beam& beam) { return beam.echo == Echo::kHit; };
  if (std::any_of(beams_.beam.begin(), beams_.beam.end(), is_hit)) return;
  const auto isNumber = [](float range_m) { return std::isfinite(range_m) && range_m > 0.0f; };
  const auto isBeyond = [&](float range_m) {
    return isNumber(range_m) && sensor_.range_max_m > 0.0 && range_m > sensor_.range_max_m;
  };
  const auto numbers = std::count_if(row.range_m.begin(), row.range_m.end(), isNumber),
             beyond = std::count_if(row.range_m.begin(), row.range_m.end(), isBeyond);
  map_.state = FrameState::kDark;
  fault_ = 2 * beyond > numbers
               ? "all ranges exceed range_max_m in sensor.yaml; check that they are in metres"
               : "no beam has an echo; check that the scanner works and is not occluded, and range_max_m in "
                 "sensor.yaml";
}

bool LaserMapper::isConcave(const Piece& before, const Piece& after) const {
  constexpr double kSigmas = 3.0;
  const double least = options_.hollow_deg * M_PI / 180.0;
  return bulge(before, after) < -(least + kSigmas * bulgeSigma(before, after, sensor_.range_sigma_m));
}

void LaserMapper::splitAtConcaveCorners(const Segment& segment) {
  convex_.clear();
  const double tolerance = options_.split_m + options_.split_sigmas * sensor_.range_sigma_m;
  lineChain(beams_, segment, tolerance, pieces_);
  Segment part = segment;
  part.count = 0;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    part.count = segment.first + pieces_[i].last + 1 - part.first;
    const bool last = i + 1 == pieces_.size();
    if (!last && !isConcave(pieces_[i], pieces_[i + 1])) continue;
    part.hidden_after = last ? segment.hidden_after : true;
    convex_.push_back(part);
    part = {segment.first + pieces_[i].last, 0, true, false};
  }
  // A surface all around begins at an arbitrary beam: its first and last parts are one.
  if (segment.count != beams_.size() || convex_.size() < 2) return;
  convex_.back().count += convex_.front().count;
  convex_.back().hidden_after = true;
  convex_.erase(convex_.begin());
}

void LaserMapper::measure(const Segment& segment) {
  const double tolerance = options_.split_m + options_.split_sigmas * sensor_.range_sigma_m;
  lineChain(beams_, segment, tolerance, pieces_);
  facingSide(beams_, segment, pieces_, sensor_.range_sigma_m, {}, side_);
  if (side_.length_m > options_.max_size_m || segment.count == beams_.size()) {
    label(segment, RayLabel::kObstacle, 0);  // a wall
  } else if (static_cast<int>(segment.count) >= options_.min_beams &&
             side_.nearest_m.norm() <= options_.max_contact_m && map_.objects.size() < kMostObjects) {
    addObject(segment);
  }
}

void LaserMapper::addObject(const Segment& segment) {
  const Eigen::Vector2d origin = sensor_.baseFromLaser().translation();
  ObjectObservation object;
  object.label = static_cast<std::uint16_t>(map_.objects.size() + 1);
  for (Eigen::Vector2d& p : side_.outline_m) p += origin;
  object.hull_m = outline::convexHull(side_.outline_m);
  object.centroid_m = side_.mean_m + origin;
  object.contact_m = side_.nearest_m + origin;
  object.supports = side_.supports;
  object.truncated = segment.hidden_before || segment.hidden_after;
  map_.objects.push_back(std::move(object));
  label(segment, RayLabel::kUnknown, map_.objects.back().label);
}

void LaserMapper::label(const Segment& segment, RayLabel kind, std::uint16_t object) {
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
    label_[i % beams_.size()] = kind;
    object_[i % beams_.size()] = object;
  }
}

void LaserMapper::fillScan() {
  const double turn = std::round(2.0 * M_PI / beams_.spacing_rad);
  const auto rays = static_cast<std::size_t>(std::clamp(turn, 8.0, static_cast<double>(kMostRays)));
  map_.scan.origin_m = sensor_.baseFromLaser().translation();
  map_.scan.range_m.resize(rays);
  resample(beams_, label_, object_, sensor_.range_sigma_m, map_.scan);
}

/// Echoes as inverse ranges. σ of a range, σ_r, is σ_r/r² in inverse range.
void LaserMapper::fillBoundary() {
  const Scan& scan = map_.scan;
  const std::size_t rays = scan.range_m.size();
  Boundary& boundary = map_.boundary;
  boundary.origin_m = scan.origin_m;
  boundary.inverse_m.assign(rays, 0.0f);
  boundary.sigma.assign(rays, 0.0f);
  for (std::size_t i = 0; i < rays; ++i) {
    const bool hit = scan.label[i] == RayLabel::kObstacle || scan.label[i] == RayLabel::kUnknown;
    if (!hit || !(scan.range_m[i] > 0.0f)) continue;
    boundary.inverse_m[i] = 1.0f / scan.range_m[i];
    boundary.sigma[i] = scan.sigma_m[i] * boundary.inverse_m[i] * boundary.inverse_m[i];
  }
}

void resample(const Beams& beams, const std::vector<RayLabel>& label,
              const std::vector<std::uint16_t>& object, double range_sigma_m, Scan& scan) {
  const std::size_t rays = scan.range_m.size(), n = beams.size();
  scan.range_m.assign(rays, 0.0f);
  scan.sigma_m.assign(rays, static_cast<float>(range_sigma_m));
  scan.label.assign(rays, RayLabel::kInvalid);
  scan.object.assign(rays, 0);
  for (std::size_t i = 0; i < rays; ++i) {
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(rays);
    double turn = std::fmod(bearing - beams.beam.front().bearing_rad, 2.0 * M_PI);
    if (turn < 0.0) turn += 2.0 * M_PI;
    if (turn > 2.0 * M_PI - 0.5 * beams.spacing_rad) turn -= 2.0 * M_PI;  // just before the first beam
    const double place = turn / beams.spacing_rad;
    const auto nearest = static_cast<long>(std::lround(place));
    if (nearest >= static_cast<long>(n) && !(beams.closed && nearest == static_cast<long>(n))) continue;
    const std::size_t k = static_cast<std::size_t>(nearest) % n;
    const Beam& beam = beams.beam[k];
    if (beam.echo == Echo::kBlind) continue;
    scan.label[i] = beam.echo == Echo::kNone ? RayLabel::kFloorEnd : label[k];
    scan.object[i] = object[k];
    scan.range_m[i] = static_cast<float>(beam.range_m);
    const double beyond = place - static_cast<double>(nearest);
    const bool has_next = beams.closed || (beyond < 0.0 ? k > 0 : k + 1 < n);
    const std::size_t other = beyond < 0.0 ? (k + n - 1) % n : (k + 1) % n;
    const bool same = has_next && beam.echo == Echo::kHit && beams.beam[other].echo == Echo::kHit &&
                      object[other] == object[k] && label[other] == label[k];
    constexpr double kOneSurface =
        0.2;  // largest relative step of the range between two beams of one surface
    if (!same || std::abs(beams.beam[other].range_m - beam.range_m) > kOneSurface * beam.range_m) continue;
    const double share = std::abs(beyond);
    scan.range_m[i] =
        static_cast<float>(1.0 / ((1.0 - share) / beam.range_m + share / beams.beam[other].range_m));
  }
}

}  // namespace omnifleet::laser
