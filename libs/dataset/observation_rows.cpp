#include "dataset/observation_rows.h"

namespace omnifleet::dataset {

ObservationNoise ObservationNoise::read(const options::Section& section) {
  ObservationNoise noise;
  section.read("range_sigma_m", noise.range_sigma_m, {1e-4, 10.0});
  section.read("range_sigma_per_m", noise.range_sigma_per_m, {0.0, 1.0});
  section.read("bearing_sigma_rad", noise.bearing_sigma_rad, {1e-4, 1.0});
  section.finish();
  return noise;
}

std::vector<Measurement> measurementsOf(const std::string& robot, const RangeBearingRow* rows,
                                        std::size_t count, const ObservationNoise& noise) {
  std::vector<Measurement> all;
  for (std::size_t i = 0; i < count; ++i) {
    Measurement m;
    m.source = "observations/" + robot;
    m.kind = MeasurementKind::kRangeBearing;
    m.from = robot;
    m.to = rows[i].id;
    m.acquired_ns = m.from_ns = rows[i].time_ns;
    m.value = {rows[i].range_m, rows[i].bearing_rad, 0.0};
    const double range = noise.range_sigma_m + noise.range_sigma_per_m * rows[i].range_m;
    m.covariance =
        Eigen::Vector3d(range * range, noise.bearing_sigma_rad * noise.bearing_sigma_rad, 1.0).asDiagonal();
    all.push_back(std::move(m));
  }
  return all;
}

}  // namespace omnifleet::dataset
