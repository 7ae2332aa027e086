#include "classifier/classifier.h"

#include <algorithm>

#include "tracking/motion_check.h"

namespace omnifleet::classifier {
namespace {

double ownRadius(const std::string& robot, const std::map<std::string, RobotBody>& bodies) {
  const auto own = bodies.find(robot);
  if (own == bodies.end()) throw options::Error("robot '" + robot + "' is not listed in the fleet file");
  double radius = 0.0;
  for (const auto& vertex : own->second.outline()) radius = std::max(radius, vertex.norm());
  return radius;
}

/// Choi's rule uses the flow vectors alone, so pieces of peers are not matched.
tracking::TrackerOptions trackerOptions(const Classifier::Options& options) {
  tracking::TrackerOptions tracker = options.tracker;
  tracker.pieces = options.kind.method != "vectors";
  return tracker;
}

RayLabel rayLabel(ObjectKind kind) {
  switch (kind) {
    case ObjectKind::kObstacle:
      return RayLabel::kObstacle;
    case ObjectKind::kRobot:
      return RayLabel::kRobot;
    case ObjectKind::kUnknown:
      return RayLabel::kUnknown;
  }
  return RayLabel::kUnknown;
}

/// True if most of what the floor's boundary shows is no object: walls and furniture. What seems to be an
/// object there is often a part of these, and does not outvote the wheels.
bool seesRoom(const LocalMap& local_map) {
  const Boundary& boundary = local_map.boundary;
  const Scan& scan = local_map.scan;
  const std::size_t beams = boundary.inverse_m.size(), rays = scan.object.size();
  std::size_t room = 0, objects = 0;
  for (std::size_t i = 0; i < beams; ++i) {
    if (!(boundary.sigma[i] > 0)) continue;
    const bool on_object = rays > 0 && scan.object[i * rays / beams] != 0;
    ++(on_object ? objects : room);
  }
  return room > objects;
}

}  // namespace

Classifier::Options Classifier::Options::read(const options::Section& section) {
  Options o;
  o.tracker = tracking::TrackerOptions::read(section.child("tracker"));
  o.kind = tracking::KindOptions::read(section.child("kind"));
  o.peers = tracking::PeerOptions::read(section.child("peers"));
  o.step_check = scan::StepCheckOptions::read(section.child("step_check"));
  section.read("gap_s", o.gap_s, options::kNotNegative);
  section.read("gap_steps", o.gap_steps, options::kNotNegative);
  section.finish();
  return o;
}

Classifier::Classifier(const Options& options, const std::string& robot,
                       const std::map<std::string, RobotBody>& bodies)
    : paper_centroids_(options.kind.method == "vectors"),
      gap_s_(options.gap_s),
      gap_steps_(options.gap_steps),
      peers_(options.peers, robot, bodies),
      tracker_(trackerOptions(options)),
      judge_(options.kind, ownRadius(robot, bodies)),
      step_check_(options.step_check) {}

/// Returns the local map with the motion corrected by the objects. Where the scans show enough they must
/// agree with the objects: only two kinds of evidence reject the wheels. Heights and points computed from the
/// rejected motion are removed.
const LocalMap& Classifier::withCheckedMotion(const LocalMap& received) {
  if (received.state != FrameState::kOk || paper_centroids_) return received;
  const auto motion = tracking::checkMotion(tracker_.tracks(), received, own_motion_);
  if (!motion) return received;
  const auto judge = [&](const Motion& m) {
    return step_check_.judge(m.since_ns, m.previous_from_current, m.covariance, received.boundary);
  };
  using Verdict = scan::StepCheck::Verdict;
  if (judge(received.motion) == Verdict::kAgrees) return received;
  const double step_s = static_cast<double>(received.acquired_ns - received.motion.since_ns) * 1e-9;
  const bool after_gap = step_s > std::max(gap_s_, gap_steps_ * own_motion_.step_s());
  const bool stands = motion->valid ? judge(*motion) == Verdict::kDiffers : seesRoom(received);
  if (stands && !after_gap) return received;
  corrected_ = received;
  corrected_.motion = *motion;
  for (ObjectObservation& object : corrected_.objects) {
    object.height_m = object.height_sigma_m = 0.0;
    object.vectors.clear();
  }
  return corrected_;
}

const Objects& Classifier::process(const LocalMap& received, const std::vector<PoseEstimate>& poses) {
  const LocalMap& local_map = withCheckedMotion(received);
  const bool seeing = local_map.state == FrameState::kOk;
  copyHeader(local_map);
  const Motion step = local_map.motion.valid ? local_map.motion : asMotion(local_map.floor_motion);
  if (seeing || step.valid) {
    const bool continuous = own_motion_.advance(step, local_map.acquired_ns);
    tracker_.predict(own_motion_, continuous);
  } else {
    tracker_.markUnseen();
  }
  std::vector<tracking::Peer>& peers = peers_.predict(poses, own_motion_);
  if (const PoseEstimate* own = peers_.own()) own_motion_.locate(own->acquired_ns, own->map_from_base);
  if (seeing) {
    tracker_.associate(local_map, own_motion_, peers);
    tracker_.update(local_map, own_motion_, peers);
    judge_.judge(tracker_.tracks(), peers, local_map, own_motion_);
  }
  tracker_.write(local_map, own_motion_, objects_.tracks);
  if (paper_centroids_) placeByCentroids(local_map);
  labelScan(local_map);
  labelBoundary();
  step_check_.remember(received.acquired_ns, received.boundary);
  return objects_;
}

void Classifier::copyHeader(const LocalMap& local_map) {
  objects_.robot = local_map.robot;
  objects_.acquired_ns = local_map.acquired_ns;
  objects_.sequence = local_map.sequence;
  objects_.state = local_map.state;
  objects_.camera_height_m = local_map.camera_height_m;
  objects_.motion = local_map.motion;
  objects_.floor_motion = local_map.floor_motion;
  objects_.scan = local_map.scan;
  objects_.boundary = local_map.boundary;
  objects_.appearance = local_map.appearance;
}

void Classifier::placeByCentroids(const LocalMap& local_map) {
  for (std::size_t i = 0; i < objects_.tracks.size(); ++i) {
    const int blob = tracker_.tracks()[i].blob;
    if (blob >= 0)
      objects_.tracks[i].position_m = local_map.objects[static_cast<std::size_t>(blob)].centroid_m;
  }
}

void Classifier::labelScan(const LocalMap& local_map) {
  Scan& scan = objects_.scan;
  const std::size_t rays = std::min({scan.range_m.size(), scan.label.size(), scan.object.size()});
  for (std::size_t i = 0; i < rays; ++i) {
    const std::uint16_t label = scan.object[i];
    scan.object[i] = 0;
    const bool shows_nothing = scan.label[i] == RayLabel::kInvalid || scan.label[i] == RayLabel::kFloorEnd;
    if (shows_nothing || scan.label[i] == RayLabel::kUndecided || scan.label[i] == RayLabel::kBeyond)
      continue;
    if (scan.label[i] == RayLabel::kObstacle && label == 0)
      continue;  // a wall that the laser mapper has labelled
    scan.label[i] = RayLabel::kUnknown;
    const auto hit = std::find_if(local_map.objects.begin(), local_map.objects.end(),
                                  [&](const ObjectObservation& object) { return object.label == label; });
    if (hit == local_map.objects.end()) continue;
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(scan.range_m.size());
    const Eigen::Vector2d end =
        scan.origin_m + scan.range_m[i] * Eigen::Vector2d(std::cos(bearing), std::sin(bearing));
    const tracking::TrackState* track = tracker_.trackAt(
        static_cast<std::size_t>(hit - local_map.objects.begin()), own_motion_.odomFromBase() * end);
    if (!track) continue;
    scan.label[i] = rayLabel(track->kind);
    scan.object[i] = static_cast<std::uint16_t>(track->id);
  }
}

/// Marks beams that end at robots and at other moving objects: at the near side of their outlines.
void Classifier::labelBoundary() {
  constexpr double kMargin_m = 0.05;    // of outlines
  constexpr double kMoving_mps = 0.08;  // as in the estimator: faster objects are no landmarks
  Boundary& boundary = objects_.boundary;
  const std::size_t beams = boundary.inverse_m.size();
  boundary.moving.assign(beams, 0);
  for (const Track& track : objects_.tracks) {
    const bool moves = track.kind == ObjectKind::kRobot || track.velocity_mps.norm() > kMoving_mps;
    if (!track.visible || !moves || track.hull_m.size() < 3) continue;
    double reach_m = 0.0;
    for (const Eigen::Vector2d& p : track.hull_m) reach_m = std::max(reach_m, (p - boundary.origin_m).norm());
    for (std::size_t i = 0; i < beams; ++i) {
      if (!(boundary.inverse_m[i] > 0) || boundary.inverse_m[i] * (reach_m + kMargin_m) < 1.0) continue;
      const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(beams);
      const Eigen::Vector2d end = boundary.origin_m + Eigen::Vector2d(std::cos(bearing), std::sin(bearing)) /
                                                          static_cast<double>(boundary.inverse_m[i]);
      if (distanceTo(track.hull_m, end) < kMargin_m) boundary.moving[i] = 1;
    }
  }
}

}  // namespace omnifleet::classifier
