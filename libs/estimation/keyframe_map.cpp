#include "estimation/keyframe_map.h"

#include "estimation/boundary_correction.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <bitset>
#include <cmath>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

namespace omnifleet::estimation {
namespace {

constexpr double kPairChi2 = 4.0;    // mean χ² above which two scans do not show the same place
constexpr double kOpen_m = 0.5;      // σ of a direction that a pair of scans leaves open
constexpr double kExact = 1e-8;      // m², rad²; no clock is better
constexpr double kMoved_m = 0.0005;  // of a keyframe: less is no news

/// m, length that the distances of scans are measured by. A scan without lines has 1 m.
double rangeOf(const scan::LineScan& scan) {
  return scan.meanRangeM() > 0 ? scan.meanRangeM() : 1.0;
}

double placeVariance(const Eigen::Matrix3d& covariance) {
  return 0.5 * covariance.topLeftCorner<2, 2>().trace();
}

}  // namespace

Eigen::Matrix3d scanByBase(const Pose2& base_from_scan) {
  Eigen::Matrix3d j = Eigen::Matrix3d::Identity();
  j(0, 2) = -base_from_scan.y_m;
  j(1, 2) = base_from_scan.x_m;
  return j;
}

KeyframeOptions KeyframeOptions::read(const options::Section& section) {
  KeyframeOptions o;
  section.read("spacing_m", o.spacing_m, {0.02, 10.0});
  section.read("references", o.references, {1, 64});
  section.read("reach", o.reach, {0.1, 100.0});
  section.read("trust_m", o.trust_m, {0.001, 10.0});
  section.read("pair_reach", o.pair_reach, {0.05, 100.0});
  section.read("pairs", o.pairs, {1, 1000});
  section.read("pair_matched", o.pair_matched, {0.0, 1.0});
  section.read("calibrates", o.calibrates, {0.0, 1.0});
  section.read("least_overlap", o.least_overlap, {0.0, 1.0});
  section.read("same_view", o.same_view, {0.0, 1.0});
  section.read("min_lines", o.min_lines, {10, 1440});
  section.read("sigma_share", o.sigma_share, {0.0, 10.0});
  section.read("sigma_growth", o.sigma_growth, {0.0, 1000.0});
  section.read("sigma_turn", o.sigma_turn, {0.0, 10.0});
  section.read("least_baseline_m", o.least_baseline_m, options::kNotNegative);
  section.read("correlated", o.correlated, {1.0, 1e6});
  section.finish();
  return o;
}

std::vector<KeyframeMap::Id> KeyframeMap::nearest(const Viewpoint& at, const std::vector<Id>& candidates,
                                                  int most) const {
  std::vector<std::pair<double, Id>> by_distance;
  for (const Id k : candidates) {
    const double distance = (pose(k).translation() - at.map_from_base.translation()).norm();
    if (distance <= reachM(k) && overlap(at, k) >= options_.least_overlap)
      by_distance.emplace_back(distance, k);
  }
  const auto count =
      std::min(by_distance.size(), static_cast<std::size_t>(most > 0 ? most : options_.references));
  std::partial_sort(by_distance.begin(), by_distance.begin() + static_cast<std::ptrdiff_t>(count),
                    by_distance.end());
  std::vector<Id> ids;
  for (std::size_t i = 0; i < count; ++i) ids.push_back(by_distance[i].second);
  return ids;
}

/// Which keyframes are known relative to one of them (Dijkstra's algorithm over variances). The wheels' own
/// way has places beside the keyframes: a clock that is wrong about each frame counts once, however long the
/// way.
std::vector<bool> KeyframeMap::related(Id from, double variance_m2) const {
  const double most_m2 = options_.trust_m * options_.trust_m;
  using Entry = std::pair<double, std::size_t>;  // 2·id: a keyframe; 2·id + 1: where the wheels were then
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  std::vector<double> best(2 * keyframes_.size(), std::numeric_limits<double>::infinity());
  std::vector<bool> known(keyframes_.size(), false);
  const auto reach = [&](std::size_t place, double variance) {
    if (variance > most_m2 || variance >= best[place]) return;
    best[place] = variance;
    open.emplace(variance, place);
  };
  reach(2 * std::size_t{from}, std::min(variance_m2, most_m2));  // the keyframe itself is always known
  while (!open.empty()) {
    const auto [variance, place] = open.top();
    open.pop();
    if (variance > best[place]) continue;
    const Id id = static_cast<Id>(place / 2);
    const Keyframe& at = keyframes_[id];
    const bool is_keyframe = place % 2 == 0;
    if (is_keyframe) known[id] = true;
    if (at.odometry) reach(place ^ 1U, variance + placeVariance(jitter(id)));
    for (const Edge& edge : is_keyframe ? at.edges : at.ways)
      reach(2 * std::size_t{edge.to} + (is_keyframe ? 0 : 1), variance + edge.variance_m2);
  }
  return known;
}

std::vector<KeyframeMap::Id> KeyframeMap::references(Id from, double variance_m2, const Viewpoint& at,
                                                     int count) const {
  const std::vector<bool> known = related(from, variance_m2);
  std::vector<Id> ids;
  for (Id k = 0; k < keyframes_.size(); ++k)
    if (known[k]) ids.push_back(k);
  return nearest(at, ids, count);
}

std::vector<KeyframeMap::Id> KeyframeMap::references(double variance_m2, const Viewpoint& at) const {
  std::vector<Id> known;
  for (Id k = 0; k < keyframes_.size(); ++k)
    if (variance_m2 + placeVariance(covariance(k)) <= options_.trust_m * options_.trust_m) known.push_back(k);
  return nearest(at, known);
}

std::vector<KeyframeMap::Id> KeyframeMap::all() const {
  std::vector<Id> ids(keyframes_.size());
  std::iota(ids.begin(), ids.end(), Id{0});
  return ids;
}

std::vector<KeyframeMap::Id> KeyframeMap::unrelated(Id from, double variance_m2, const Pose2& map_from_base,
                                                    double radius_m) const {
  const std::vector<bool> known = related(from, variance_m2);
  std::vector<Id> ids;
  for (Id k = 0; k < keyframes_.size(); ++k) {
    const double distance_m = (pose(k).translation() - map_from_base.translation()).norm();
    if (!known[k] && distance_m <= radius_m) ids.push_back(k);
  }
  return ids;
}

scan::Reference KeyframeMap::reference(Id keyframe) const {
  const Keyframe& k = keyframes_[keyframe];
  return {&k.scan, pose(keyframe) * k.source.base_from_scan};
}

const Eigen::Matrix3d& KeyframeMap::covariance(Id keyframe) const {
  if (!covariance_[keyframe]) covariance_[keyframe] = graph_.covariance(keyframes_[keyframe].node);
  return *covariance_[keyframe];
}

/// Share of the bearings that a frame has measured which the keyframe has measured, too.
double KeyframeMap::overlap(const Viewpoint& at, Id keyframe) const {
  constexpr double kSectors = 64.0;
  if (at.sectors == 0 || keyframes_[keyframe].sectors == 0) return 1.0;
  const double turn = wrapAngle(at.map_from_base.theta_rad - pose(keyframe).theta_rad);
  const auto by = static_cast<unsigned>(std::lround(turn * kSectors / (2.0 * M_PI)) + 64) % 64;
  const std::uint64_t turned = by == 0 ? at.sectors : (at.sectors << by) | (at.sectors >> (64 - by));
  return static_cast<double>(std::bitset<64>(turned & keyframes_[keyframe].sectors).count()) /
         static_cast<double>(std::bitset<64>(at.sectors).count());
}

bool KeyframeMap::wants(const Viewpoint& at, const std::vector<Id>& references,
                        const scan::LineScan& scan) const {
  if (scan.lines() < static_cast<std::size_t>(options_.min_lines)) return false;
  return std::none_of(references.begin(), references.end(), [&](Id k) {
    return (pose(k).translation() - at.map_from_base.translation()).norm() < options_.spacing_m &&
           overlap(at, k) >= options_.same_view;
  });
}

Eigen::Matrix3d systematicCovariance(const scan::LineScan& scan, double distance_m,
                                     const KeyframeOptions& options) {
  const double range_m = rangeOf(scan), ranges = distance_m / range_m,
               m = options.sigma_share * scan.medianSigmaM() * (1.0 + options.sigma_growth * ranges * ranges),
               rad = options.sigma_turn * m / range_m;
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

Eigen::Matrix3d KeyframeMap::systematic(Id keyframe, double distance_m) const {
  return systematicCovariance(keyframes_[keyframe].scan, distance_m, options_);
}

double KeyframeMap::reachM(Id keyframe) const {
  return options_.reach * rangeOf(keyframes_[keyframe].scan);
}

double KeyframeMap::reachM() const {
  double reach_m = 0.0;
  for (Id k = 0; k < keyframes_.size(); ++k) reach_m = std::max(reach_m, reachM(k));
  return reach_m;
}

KeyframeMap::Id KeyframeMap::add(const Pose2& map_from_base, Source source, const scan::LineScan& scan,
                                 const Held& held, const std::vector<Id>& references) {
  const Id id = static_cast<Id>(keyframes_.size()), node = graph_.add(map_from_base);
  graph_.setCamera(source.camera, source.assumed);
  scan::BeamFields fields;
  if (source.rich) fields = beamFields(scan, source.camera_height_m, source.lens);
  keyframes_.push_back({node, {}, 0, std::move(source), scan, std::move(fields), scan.sectors(), {}, {}});
  keyframes_.back().scan.compact();
  if (held.odometry) chainOdometry(id, *held.odometry);
  // A match of the frame says again what those of the pairs say, which follow the calibration.
  const bool paired = constrainPairs(id, references);
  if (held.previous && !paired)
    relate(*held.previous, id, held.previous_from_this, held.covariance);
  else if (!held.previous && !held.odometry)
    graph_.addAbsolute(node, map_from_base, held.covariance);
  solve();
  return id;
}

Eigen::Matrix3d KeyframeMap::jitter(Id keyframe) const {
  const std::uint32_t robot = keyframes_[keyframe].source.camera;
  const Eigen::Matrix3d exact = kExact * Eigen::Matrix3d::Identity();
  return robot < jitter_.size() ? Eigen::Matrix3d(jitter_[robot] + exact) : exact;
}

void KeyframeMap::setJitter(std::uint32_t robot, const Eigen::Matrix3d& covariance) {
  if (jitter_.size() <= robot) jitter_.resize(robot + 1, Eigen::Matrix3d::Zero());
  jitter_[robot] = covariance;
  for (Id k = 0; k < keyframes_.size(); ++k) {
    const Keyframe& keyframe = keyframes_[k];
    if (keyframe.odometry && keyframe.source.camera == robot)
      graph_.setCovariance(keyframe.beside, jitter(k));
  }
}

/// Where the odometry was when a keyframe was taken.
scan::KeyframeGraph::Id KeyframeMap::odometryNode(Id keyframe) {
  Keyframe& k = keyframes_[keyframe];
  if (k.odometry) return *k.odometry;
  k.odometry = graph_.add(pose(keyframe));
  k.beside = graph_.addRelative(*k.odometry, k.node, {}, jitter(keyframe));
  return *k.odometry;
}

void KeyframeMap::chainOdometry(Id id, const Odometry& odometry) {
  const auto from = odometryNode(odometry.previous), to = odometryNode(id);
  graph_.addRelative(from, to, odometry.previous_from_this, odometry.covariance);
  const double variance_m2 = placeVariance(odometry.covariance);
  keyframes_[odometry.previous].ways.push_back({id, variance_m2});
  keyframes_[id].ways.push_back({odometry.previous, variance_m2});
}

void KeyframeMap::assume(std::uint32_t camera, const Eigen::Vector4d& error) {
  Boundary corrected;
  for (Keyframe& k : keyframes_) {
    if (k.source.camera != camera) continue;
    k.source.assumed = error;
    correctBoundary(k.source.seen, error, k.source.camera_height_m, k.source.lens, corrected);
    k.scan.fit(corrected, k.source.usable);
    k.scan.compact();
    if (k.source.rich) k.fields = beamFields(k.scan, k.source.camera_height_m, k.source.lens);
  }
  graph_.setCamera(camera, error);
  solve();
}

scan::CameraEvidence KeyframeMap::cameraEvidence() const {
  scan::CameraEvidence evidence = graph_.cameraEvidence();
  evidence.information /= options_.correlated;
  evidence.gradient /= options_.correlated;
  return evidence;
}

KeyframeMap::Id KeyframeMap::append(const KeyframeMap& other, const Pose2& map_from_other,
                                    const Eigen::Matrix3d& covariance) {
  const Id first = static_cast<Id>(keyframes_.size());
  const std::vector<Id> before = all();
  const scan::KeyframeGraph::Appended in_graph = graph_.append(other.graph_, map_from_other);
  if (jitter_.size() < other.jitter_.size()) jitter_.resize(other.jitter_.size(), Eigen::Matrix3d::Zero());
  for (const Keyframe& k : other.keyframes_) {
    keyframes_.push_back(k);
    Keyframe& copy = keyframes_.back();
    copy.node += in_graph.pose;
    if (copy.odometry) copy.odometry = *copy.odometry + in_graph.pose;
    copy.beside += in_graph.constraint;
    for (Edge& edge : copy.edges) edge.to += first;
    for (Edge& way : copy.ways) way.to += first;
    if (copy.source.camera < other.jitter_.size())
      jitter_[copy.source.camera] = other.jitter_[copy.source.camera];
  }
  bool paired = false;
  for (Id id = first; id < keyframes_.size(); ++id)
    paired =
        constrainPairs(id, nearest({pose(id), keyframes_[id].sectors}, before, options_.pairs)) || paired;
  if (!paired) relateNearest(first, covariance);
  solve();
  return first;
}

/// Relates the nearest two keyframes of those before `first` and those from it on as they lie.
void KeyframeMap::relateNearest(Id first, const Eigen::Matrix3d& covariance) {
  double least = std::numeric_limits<double>::infinity();
  std::pair<Id, Id> best;
  for (Id a = 0; a < first; ++a) {
    for (Id b = first; b < keyframes_.size(); ++b) {
      const double distance = (pose(a).translation() - pose(b).translation()).norm();
      if (distance < least) least = distance, best = {a, b};
    }
  }
  if (std::isfinite(least))
    relate(best.first, best.second, pose(best.first).inverse() * pose(best.second), covariance);
}

void KeyframeMap::closeLoop(Id from, Id to, const Pose2& from_to, const Eigen::Matrix3d& covariance) {
  relate(from, to, from_to, covariance);
  solve();
}

void KeyframeMap::relate(Id from, Id to, const Pose2& from_to, const Eigen::Matrix3d& covariance,
                         const scan::CameraDependence* cameras) {
  graph_.addRelative(keyframes_[from].node, keyframes_[to].node, from_to, covariance, cameras);
  const double variance_m2 = placeVariance(covariance);
  keyframes_[from].edges.push_back({to, variance_m2});
  keyframes_[to].edges.push_back({from, variance_m2});
}

void KeyframeMap::solve() {
  revision_ += graph_.optimise() > kMoved_m ? 1 : 0;
  covariance_.assign(keyframes_.size(), std::nullopt);
}

/// Relative poses to the nearest neighbours whose place is known, each by its own match. The n matches of one
/// scan share its noise: together they are as good as one with a scan of 1/n of the noise.
bool KeyframeMap::constrainPairs(Id id, const std::vector<Id>& known) {
  const Keyframe& added = keyframes_[id];
  const Pose2 map_from_scan = pose(id) * added.source.base_from_scan,
              scan_from_base = added.source.base_from_scan.inverse();
  const Eigen::Matrix3d prior = Eigen::Vector3d(1e3, 1e3, 1e4).asDiagonal();  // 3 cm, 0.6°
  const Eigen::Matrix3d scan_by_base = scanByBase(added.source.base_from_scan);
  std::vector<std::pair<Id, scan::Match>> pairs;
  for (const Id k : known) {
    const double distance_m = (pose(k).translation() - pose(id).translation()).norm();
    if (k == id || distance_m > options_.pair_reach * rangeOf(keyframes_[k].scan)) continue;
    const scan::Match match = matcher_.match(added.scan, map_from_scan, prior, {reference(k)});
    if (match.valid && match.matched >= options_.pair_matched && match.chi2 <= kPairChi2)
      pairs.emplace_back(k, match);
  }
  const double noise = static_cast<double>(pairs.size()) + 1.0;
  for (const auto& [k, match] : pairs) {
    const scan::Reference other = reference(k);
    const double distance_m = (pose(k).translation() - pose(id).translation()).norm();
    const Pose2 from_to = pose(k).inverse() * match.map_from_scan * scan_from_base;
    Eigen::Matrix3d information = scan_by_base.transpose() * match.information * scan_by_base / noise;
    information.diagonal().array() += 1.0 / (kOpen_m * kOpen_m);
    const Eigen::Matrix3d covariance = information.inverse() + systematic(k, distance_m);
    if (added.fields.empty() || keyframes_[k].fields.empty()) {
      relate(k, id, from_to, covariance);
      continue;
    }
    const scan::CalibrationTerms terms =
        matcher_.calibrationTerms(added.scan, match.map_from_scan, other, added.fields, keyframes_[k].fields);
    scan::CameraDependence cameras;
    cameras.from_camera = keyframes_[k].source.camera;
    cameras.to_camera = added.source.camera;
    cameras.assumed << added.source.assumed, keyframes_[k].source.assumed;
    cameras.by_error = scan_by_base.inverse() * terms.pose_by_error;
    if (distance_m >= options_.least_baseline_m && match.matched >= options_.calibrates) {
      cameras.information = terms.information / match.scatter;
      cameras.gradient = terms.gradient / match.scatter;
    }
    relate(k, id, from_to, covariance, &cameras);
  }
  return !pairs.empty();
}

}  // namespace omnifleet::estimation
