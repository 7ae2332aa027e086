#include "synthetic/laser_scanner.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "synthetic/stage_set.h"
#include "synthetic/value_noise.h"

namespace omnifleet::synthetic {
namespace {

const ArenaLaser& laserOf(const Arena& arena) {
  if (!arena.laser) throw options::Error("arena " + arena.name + " has no laser");
  return *arena.laser;
}

double uniform(std::uint32_t a, std::uint32_t b) {
  return (static_cast<double>(hash32(a, b) >> 8) + 0.5) / 16777216.0;
}

/// Normal deviate by Box–Muller on hashed numbers, without state.
double deviate(std::uint32_t seed, std::uint32_t index) {
  return std::sqrt(-2.0 * std::log(uniform(seed, 2 * index))) *
         std::cos(2.0 * M_PI * uniform(seed, 2 * index + 1));
}

}  // namespace

ArenaLaser ArenaLaser::read(const options::Section& section) {
  ArenaLaser laser;
  laser.sensor.range_max_m = 8.0;
  section.read("beams", laser.beams, {8.0, static_cast<double>(dataset::kMostBeams)});
  section.read("fov_deg", laser.fov_deg, {10.0, 360.0});
  laser.sensor = dataset::LaserSensor::read(section, laser.sensor);
  return laser;
}

struct LaserScanner::Impl {
  Impl(const Arena& the_arena, const std::string& robot, std::uint32_t the_seed)
      : arena(the_arena),
        laser(laserOf(arena)),
        own(arena.robotIndex(arena.robot(robot).name)),
        seed(hash32(the_seed, 0x1a5e5U + static_cast<std::uint32_t>(own))),
        stage(arena, own, the_seed) {}

  Arena arena;
  ArenaLaser laser;
  int own;
  std::uint32_t seed;
  StageSet stage;
  dataset::LaserRow row;

  float reported(float distance_m, std::uint32_t frame_seed, std::uint32_t beam) const;
};

LaserScanner::LaserScanner(const Arena& arena, const std::string& robot, std::uint32_t seed)
    : impl_(std::make_unique<Impl>(arena, robot, seed)) {}
LaserScanner::~LaserScanner() = default;
LaserScanner::LaserScanner(LaserScanner&&) noexcept = default;
LaserScanner& LaserScanner::operator=(LaserScanner&&) noexcept = default;

/// Measurement of a true distance: with noise, rounded to the millimetre, +inf without echo.
float LaserScanner::Impl::reported(float distance_m, std::uint32_t frame_seed, std::uint32_t beam) const {
  const dataset::LaserSensor& s = laser.sensor;
  const double noisy = distance_m + s.range_sigma_m * deviate(frame_seed, beam);
  const bool echo = std::isfinite(distance_m) && noisy >= s.range_min_m && noisy > 0.0 &&
                    (s.range_max_m <= 0.0 || noisy <= s.range_max_m);
  return echo ? static_cast<float>(std::round(noisy * 1e3) * 1e-3) : std::numeric_limits<float>::infinity();
}

const dataset::LaserRow& LaserScanner::scan(int frame, const std::vector<Pose2>& map_from_bases) {
  Impl& i = *impl_;
  if (map_from_bases.size() != i.arena.robots.size())
    throw std::runtime_error("LaserScanner: needs one pose per robot of the arena");
  const double time_s = static_cast<double>(frame) / i.arena.rate_hz;
  i.stage.place(i.arena, time_s, map_from_bases, map_from_bases[static_cast<std::size_t>(i.own)].inverse());
  const bool whole = i.laser.fov_deg >= 360.0;
  const int beams = i.laser.beams, steps = whole ? beams : beams - 1;
  i.row.time_ns = i.arena.frameTimeNs(frame);
  i.row.angle_increment_rad = i.laser.fov_deg * M_PI / 180.0 / steps;
  i.row.angle_min_rad = -0.5 * i.laser.fov_deg * M_PI / 180.0;
  i.row.range_m.resize(static_cast<std::size_t>(beams));
  const double yaw = i.laser.sensor.baseFromLaser().theta_rad;
  const std::uint32_t frame_seed = hash32(i.seed, static_cast<std::uint32_t>(frame));
  RayPacket packet;
  for (int first = 0; first < beams; first += RayPacket::kSize) {
    packet.wanted = 0;
    for (int k = 0; k < RayPacket::kSize; ++k) {
      const double bearing = yaw + i.row.angle_min_rad + (first + k) * i.row.angle_increment_rad;
      packet.x[k] = static_cast<float>(std::cos(bearing));
      packet.y[k] = static_cast<float>(std::sin(bearing));
      packet.z[k] = 0.0f;
      if (first + k < beams) packet.wanted |= 1U << k;
    }
    i.stage.tracer().trace(i.laser.sensor.position_m.cast<float>(), packet);
    for (int k = 0; k < RayPacket::kSize && first + k < beams; ++k) {
      const float distance_m =
          packet.solid[k] < 0 ? std::numeric_limits<float>::infinity() : packet.distance[k];
      i.row.range_m[static_cast<std::size_t>(first + k)] =
          i.reported(distance_m, frame_seed, static_cast<std::uint32_t>(first + k));
    }
  }
  return i.row;
}

}  // namespace omnifleet::synthetic
