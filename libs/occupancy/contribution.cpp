#include "occupancy/contribution.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace omnifleet::occupancy {
namespace {

constexpr double kMaxDmm = 1.5e7;  // 1500 m: within OctoMap's keys at 5 cm

/// Returns false if the number does not fit.
bool quantise(double metres, std::int32_t& dmm) {
  const double value = std::round(metres * kDmmPerMetre);
  if (!(std::abs(value) <= kMaxDmm)) return false;
  dmm = static_cast<std::int32_t>(value);
  return true;
}

bool quantise(const Eigen::Vector2d& point_m, PointDmm& point) {
  return quantise(point_m.x(), point.x_dmm) && quantise(point_m.y(), point.y_dmm);
}

/// 0 if not usable; otherwise at least 1.
std::uint16_t quantiseSigma(double sigma_m) {
  if (!(sigma_m > 0) || !std::isfinite(sigma_m)) return 0;
  return static_cast<std::uint16_t>(std::clamp(std::round(sigma_m * kDmmPerMetre), 1.0, 65535.0));
}

/// Millionths; 0 if not finite or too large for a calibration error.
std::int32_t quantiseError(double error) {
  constexpr double kMost = 0.2;
  return std::abs(error) <= kMost ? static_cast<std::int32_t>(std::lround(error * 1e6)) : 0;
}

SupportView makeView(const Track& track) {
  SupportView view;
  view.track_id = track.id;
  view.kind = track.kind;
  view.truncated = track.truncated;
  view.name = track.name;
  const double solidity = std::isfinite(track.solidity) ? std::clamp(track.solidity, 0.0, 1.0) : 0.0;
  view.solidity_permille = static_cast<std::uint16_t>(std::lround(1000.0 * solidity));
  if (!quantise(track.position_m, view.position)) view.position = {};
  if (!quantise(track.contact_m, view.contact)) view.contact = {};
  const std::size_t count = std::min(track.supports.b_m.size(), track.supports.sigma_m.size());
  for (std::size_t k = 0; k < count; ++k) {
    std::int32_t b = 0;
    const bool usable = quantise(track.supports.b_m[k], b);
    view.b_dmm.push_back(usable ? b : 0);
    view.sigma_dmm.push_back(usable ? quantiseSigma(track.supports.sigma_m[k]) : std::uint16_t{0});
  }
  if (quantise(track.height_m, view.height_dmm)) view.height_sigma_dmm = quantiseSigma(track.height_sigma_m);
  return view;
}

void quantiseScan(const Scan& scan, Contribution& out) {
  const std::size_t count = std::min(scan.range_m.size(), scan.label.size());
  const bool has_origin = quantise(scan.origin_m, out.scan_origin);
  for (std::size_t i = 0; i < count; ++i) {
    std::int32_t range = 0;
    const bool valid =
        has_origin && scan.label[i] != RayLabel::kInvalid && quantise(scan.range_m[i], range) && range > 0;
    out.range_dmm.push_back(valid ? range : 0);
    out.sigma_dmm.push_back(valid && i < scan.sigma_m.size() ? quantiseSigma(scan.sigma_m[i])
                                                             : std::uint16_t{0});
    out.label.push_back(valid ? scan.label[i] : RayLabel::kInvalid);
    out.object.push_back(valid && i < scan.object.size() ? scan.object[i] : std::uint16_t{0});
  }
}

/// Returns false if the point exceeds 16 bits or its σ is not usable.
bool quantise(const ScenePoint& from, std::uint32_t track_id, SurfacePoint& to) {
  std::int16_t dmm[3];
  for (int i = 0; i < 3; ++i) {
    const double value = std::round(double{from.point_m[i]} * kDmmPerMetre);
    if (!(std::abs(value) <= 32767.0)) return false;
    dmm[i] = static_cast<std::int16_t>(value);
  }
  to = {static_cast<std::uint16_t>(track_id), dmm[0], dmm[1], dmm[2], quantiseSigma(from.sigma_m)};
  return to.sigma_dmm > 0;
}

std::vector<SurfacePoint> surestPoints(const std::vector<Track>& tracks) {
  std::vector<SurfacePoint> points;
  SurfacePoint quantised;
  for (const auto& track : tracks) {
    if (!track.visible || track.kind == ObjectKind::kRobot) continue;
    for (const auto& point : track.points)
      if (quantise(point, track.id, quantised)) points.push_back(quantised);
  }
  std::sort(points.begin(), points.end(), [](const SurfacePoint& a, const SurfacePoint& b) {
    return std::tie(a.sigma_dmm, a.track, a.x_dmm, a.y_dmm, a.z_dmm) <
           std::tie(b.sigma_dmm, b.track, b.x_dmm, b.y_dmm, b.z_dmm);
  });
  if (points.size() > Contribution::kMaxPoints) points.resize(Contribution::kMaxPoints);
  return points;
}

class Bytes {
 public:
  template <typename Integer>
  Bytes& put(Integer value) {
    auto rest = static_cast<std::uint64_t>(value);
    for (std::size_t i = 0; i < sizeof(Integer); ++i, rest >>= 8U)
      text_.push_back(static_cast<char>(rest & 0xFFU));
    return *this;
  }
  Bytes& put(const std::string& text) {
    put(static_cast<std::uint32_t>(text.size()));
    text_ += text;
    return *this;
  }
  Bytes& put(const PointDmm& p) { return put(p.x_dmm).put(p.y_dmm); }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

}  // namespace

Eigen::Vector4d cameraErrorOf(const CameraErrorPpm& millionths) {
  return 1e-6 * Eigen::Map<const Eigen::Vector4<std::int32_t>>(millionths.data()).cast<double>();
}

Pose2 KeyframePose::mapFromBase() const {
  return {position.x_dmm / kDmmPerMetre, position.y_dmm / kDmmPerMetre, theta_dmrad / kDmmPerMetre};
}

Contribution makeContribution(const Objects& objects, const Scan& rays) {
  Contribution out;
  out.robot = objects.robot;
  out.acquired_ns = objects.acquired_ns;
  out.sequence = objects.sequence;
  if (!quantise(objects.camera_height_m, out.camera_height_dmm)) out.camera_height_dmm = 0;
  quantiseScan(rays, out);
  for (const auto& track : objects.tracks) {
    if (track.visible) out.views.push_back(makeView(track));
  }
  out.points = surestPoints(objects.tracks);
  return out;
}

KeyframePose makeKeyframePose(const PoseEstimate& pose, std::uint32_t term, std::uint32_t revision) {
  KeyframePose out;
  out.robot = pose.robot;
  out.acquired_ns = pose.acquired_ns;
  out.sequence = pose.sequence;
  out.term = term;
  out.revision = revision;
  out.frame = pose.frame;
  out.sightings = pose.sightings;
  for (std::size_t i = 0; i < out.camera_error.size(); ++i)
    out.camera_error[i] = quantiseError(pose.camera_error(static_cast<Eigen::Index>(i)));
  out.valid =
      pose.valid && pose.map_from_base.isFinite() && quantise(pose.map_from_base.translation(), out.position);
  if (!out.valid) return out;
  out.theta_dmrad =
      static_cast<std::int32_t>(std::lround(wrapAngle(pose.map_from_base.theta_rad) * kDmmPerMetre));
  const auto sigmaOf = [](double variance) {
    constexpr double kMost = 65535.0;
    const double sigma = std::sqrt(std::max(0.0, variance)) * kDmmPerMetre;
    return static_cast<std::uint16_t>(std::isfinite(sigma) ? std::lround(std::min(sigma, kMost)) : kMost);
  };
  out.sigma_dmm = sigmaOf(std::max(pose.covariance(0, 0), pose.covariance(1, 1)));
  out.sigma_dmrad = sigmaOf(pose.covariance(2, 2));
  return out;
}

SupportFunction supportsOf(const SupportView& view) {
  SupportFunction supports;
  const std::size_t count = std::min(view.b_dmm.size(), view.sigma_dmm.size());
  for (std::size_t k = 0; k < count; ++k) {
    supports.b_m.push_back(static_cast<float>(view.b_dmm[k] / kDmmPerMetre));
    supports.sigma_m.push_back(static_cast<float>(view.sigma_dmm[k] / kDmmPerMetre));
  }
  return supports;
}

std::string canonicalBytes(const Contribution& c) {
  Bytes bytes;
  bytes.put(c.robot).put(c.acquired_ns).put(c.sequence).put(c.camera_height_dmm).put(c.scan_origin);
  bytes.put(static_cast<std::uint32_t>(c.range_dmm.size()));
  for (const auto range : c.range_dmm) bytes.put(range);
  bytes.put(static_cast<std::uint32_t>(c.sigma_dmm.size()));
  for (const auto sigma : c.sigma_dmm) bytes.put(sigma);
  bytes.put(static_cast<std::uint32_t>(c.label.size()));
  for (const auto label : c.label) bytes.put(static_cast<std::uint8_t>(label));
  bytes.put(static_cast<std::uint32_t>(c.object.size()));
  for (const auto object : c.object) bytes.put(object);
  bytes.put(static_cast<std::uint32_t>(c.views.size()));
  for (const auto& view : c.views) {
    bytes.put(view.track_id)
        .put(static_cast<std::uint8_t>(view.kind))
        .put(static_cast<std::uint8_t>(view.truncated));
    bytes.put(view.solidity_permille).put(view.position).put(view.contact);
    bytes.put(static_cast<std::uint32_t>(view.b_dmm.size()));
    for (const auto b : view.b_dmm) bytes.put(b);
    bytes.put(static_cast<std::uint32_t>(view.sigma_dmm.size()));
    for (const auto sigma : view.sigma_dmm) bytes.put(sigma);
    bytes.put(view.height_dmm).put(view.height_sigma_dmm).put(view.name);
  }
  bytes.put(static_cast<std::uint32_t>(c.points.size()));
  for (const auto& point : c.points)
    bytes.put(point.track).put(point.x_dmm).put(point.y_dmm).put(point.z_dmm).put(point.sigma_dmm);
  return bytes.take();
}

std::string canonicalBytes(const KeyframePose& p) {
  Bytes bytes;
  bytes.put(p.robot).put(p.acquired_ns).put(p.sequence).put(p.term).put(p.revision);
  bytes.put(static_cast<std::uint8_t>(p.valid)).put(p.frame).put(p.position).put(p.theta_dmrad);
  bytes.put(p.sigma_dmm).put(p.sigma_dmrad);
  bytes.put(static_cast<std::uint32_t>(p.sightings.size()));
  for (const auto& sighting : p.sightings) bytes.put(sighting.track_id).put(sighting.robot);
  for (const std::int32_t error : p.camera_error) bytes.put(error);
  return bytes.take();
}

std::uint64_t digest(const std::string& bytes) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const char byte : bytes) hash = (hash ^ static_cast<std::uint8_t>(byte)) * 1099511628211ULL;
  return hash;
}

}  // namespace omnifleet::occupancy
