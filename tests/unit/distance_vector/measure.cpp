#include "tests/unit/distance_vector/measure.h"

#include <fmt/format.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::test {

double Accuracy::Band::rms_m() const {
  return n > 0 ? std::sqrt(squares / n) : 0.0;
}
double Accuracy::Band::normalised_rms() const {
  return n > 0 ? std::sqrt(normalised / n) : 0.0;
}

void Accuracy::add(const distance_vector::DistanceVector& vector, const RayCaster& caster, const World& world,
                   const RobotPose& pose) {
  constexpr double kOutlier = 5.0;
  const Scan& scan = vector.scan();
  const std::size_t n = scan.range_m.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double bearing =
        std::remainder(2.0 * M_PI * static_cast<double>(i) / static_cast<double>(n), 2.0 * M_PI);
    const auto truth = caster.truth(world, pose, bearing);
    const bool hit = scan.label[i] == RayLabel::kObstacle;
    if (truth && *truth < 1.5) {
      ++seen;
      if (hit) ++found;
    }
    if (scan.label[i] == RayLabel::kFloorEnd) {
      ++free;
      if (truth &&
          static_cast<double>(scan.range_m[i]) > *truth + 0.02 + 5.0 * static_cast<double>(scan.sigma_m[i]))
        ++wrong_free;
    }
    if (!hit) continue;
    ++hits;
    const double error = truth ? static_cast<double>(scan.range_m[i]) - *truth : 1e3;
    // In inverse range the noise is even: errors of far edges are compared there.
    const double inverse_sigma = static_cast<double>(vector.boundary().sigma[i]);
    const double normalised =
        truth ? (1.0 / static_cast<double>(scan.range_m[i]) - 1.0 / *truth) / inverse_sigma : 1e3;
    if (std::abs(normalised) > kOutlier) {
      ++outliers;
      continue;
    }
    for (Band& band : bands) {
      if (*truth > band.to_m) continue;
      ++band.n;
      band.squares += error * error;
      band.normalised += normalised * normalised;
      break;
    }
  }
}

std::string Accuracy::text() const {
  std::string text;
  for (const Band& band : bands)
    text += fmt::format("to {:5.1f} m: {:6} bearings, rms {:7.2f} mm, (error/sigma) rms {:.2f}\n", band.to_m,
                        band.n, 1e3 * band.rms_m(), band.normalised_rms());
  return text + fmt::format(
                    "hits {}, beyond 5 sigma {} ({:.2f} %), recall to 1.5 m {:.2f} % of {}, floor ends {} "
                    "({} wrong)\n",
                    hits, outliers, 100.0 * outliers / std::max(1, hits), 100.0 * found / std::max(1, seen),
                    seen, free, wrong_free);
}

cv::Mat picture(const cv::Mat& image, const distance_vector::DistanceVector& vector) {
  using distance_vector::End;
  cv::Mat plain, mask, marked, both;
  cv::resize(image, plain, {}, 2, 2, cv::INTER_NEAREST);
  cv::resize(vector.floorMask(), mask, {}, 2, 2, cv::INTER_NEAREST);
  marked = plain.clone();
  marked.setTo(cv::Scalar(0, 160, 0), mask);
  cv::addWeighted(plain, 0.6, marked, 0.4, 0.0, marked);
  for (std::size_t u = 0; u < vector.edgeRows().size(); ++u) {
    const float row = vector.edgeRows()[u];
    const auto& end = vector.columnEnds()[u];
    const bool located = std::isfinite(row);
    const cv::Scalar colour = end.end == End::kEdge
                                  ? (located ? cv::Scalar(0, 0, 255) : cv::Scalar(0, 128, 255))
                              : end.end == End::kFloorEnd  ? cv::Scalar(255, 0, 0)
                              : end.end == End::kUndecided ? cv::Scalar(0, 255, 255)
                                                           : cv::Scalar(255, 0, 255);
    const float at = located ? row : static_cast<float>(end.row);
    cv::circle(marked, {static_cast<int>(2 * u), static_cast<int>(2.0f * at)}, 1, colour, -1);
  }
  cv::hconcat(plain, marked, both);
  return both;
}

}  // namespace omnifleet::test
