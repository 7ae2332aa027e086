// Calibration errors against the lens models: a floor point is projected by the real camera to a pixel, and
// by the calibrated camera back to the floor.
#include "estimation/camera_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/view.h"
#include "lens/camera.h"

namespace omnifleet::estimation {
namespace {

std::string describeError(const CameraError& error, const CameraCovariance& covariance,
                          const CameraOptions& options) {
  const CameraFinding finding(error, covariance, options);
  return finding.describe(finding.wrong());
}

constexpr double kHeight_m = 0.5;

lens::CameraModel camera(lens::Projection projection) {
  lens::CameraModel model;
  model.projection = projection;
  model.image_width_px = model.image_height_px = 480;
  model.focal_px = {150.0, 150.0};
  model.principal_point_px = {239.5, 239.5};
  model.fov_deg = 170.0;
  model.position_m = {0.0, 0.0, kHeight_m};
  return model;
}

/// As calibrated: true value plus error.
lens::CameraModel wrong(lens::CameraModel model, const CameraError& error) {
  model.focal_px *= 1.0 + error(0);
  model.position_m.z() *= 1.0 + error(1);
  model.rotation_rpy_deg.x() += error(2) * 180.0 / M_PI;
  model.rotation_rpy_deg.y() += error(3) * 180.0 / M_PI;
  return model;
}

Eigen::Vector2d reprojected(const lens::Camera& real, const lens::Camera& calibrated,
                            const Eigen::Vector2d& floor_m) {
  const auto pixel = real.pixelFromPoint({floor_m.x(), floor_m.y(), 0.0});
  return calibrated.floorFromPixel(*pixel).value();
}

TEST(CameraError, FieldEqualsThatOfTheLensModels) {
  for (const auto projection : {lens::Projection::kEquidistant, lens::Projection::kEquisolid,
                                lens::Projection::kStereographic, lens::Projection::kOrthographic}) {
    const lens::Camera real(camera(projection));
    for (int i = 0; i < 4; ++i) {
      CameraError error = CameraError::Zero();
      error(i) = 0.002;
      const lens::Camera calibrated(wrong(camera(projection), error));
      for (double rho = 0.2; rho < 1.3; rho += 0.25) {
        for (double bearing = 0.1; bearing < 6.3; bearing += 0.7) {
          const Eigen::Vector2d p = rho * Eigen::Vector2d(std::cos(bearing), std::sin(bearing));
          const Eigen::Vector2d moved = reprojected(real, calibrated, p) - p;
          const Eigen::Vector2d expected =
              cameraField(p, kHeight_m, lens::Spread::of(real)) * error.head<4>();
          const double tolerance = 0.02 * moved.norm() + 1e-5;
          EXPECT_LT((moved - expected).norm(), tolerance) << "component " << i << " at " << p.transpose();
        }
      }
    }
  }
}

/// The outline of a disc is too large by the same angle all round: its support function increases by the
/// field.
TEST(CameraError, ContourFieldPredictsTheSupportsOfATooLargeOutline) {
  for (const auto projection : {lens::Projection::kEquidistant, lens::Projection::kOrthographic}) {
    const lens::CameraModel model = camera(projection);
    const lens::Camera lens(model);
    const double excess_rad = 0.002, excess_px = excess_rad * model.focal_px.x();
    const Eigen::Vector2d centre_m(0.7, -0.3);
    for (double phi = 0.1; phi < 6.3; phi += 0.4) {
      const Eigen::Vector2d n(std::cos(phi), std::sin(phi)), across(-n.y(), n.x()), p = centre_m + 0.2 * n;
      const auto pixel = [&](const Eigen::Vector2d& floor) {
        return *lens.pixelFromPoint({floor.x(), floor.y(), 0.0});
      };
      // The contour's normal in the image, outwards.
      const Eigen::Vector2d along = (pixel(p + 1e-4 * across) - pixel(p - 1e-4 * across)).normalized();
      Eigen::Vector2d out(-along.y(), along.x());
      if (out.dot(pixel(p + 1e-4 * n) - pixel(p)) < 0) out = -out;
      const Eigen::Vector2d moved = *lens.floorFromPixel(pixel(p) + excess_px * out);
      const double expected = excess_rad * contourField(p, n, kHeight_m, lens::Spread::of(lens));
      EXPECT_NEAR(n.dot(moved - p), expected, 0.02 * expected) << phi;  // second order
    }
  }
}

/// The support function of an ellipse by a wrong camera, against that of the ellipse itself.
TEST(CameraError, ViewIsCorrectedByAKnownError) {
  CameraError error;
  error << 0.003, -0.004, 0.003, -0.0035, 0.0;
  const lens::Camera real(camera(lens::Projection::kEquidistant));
  const lens::Camera calibrated(wrong(camera(lens::Projection::kEquidistant), error));
  Track exact, distorted;
  for (int k = 0; k < 96; ++k) {
    const Eigen::Vector2d n(std::cos(2.0 * M_PI * k / 96), std::sin(2.0 * M_PI * k / 96));
    double b = -1e9, b_wrong = -1e9;
    for (int j = 0; j < 360; ++j) {  // an ellipse
      const double a = j * M_PI / 180.0;
      const Eigen::Vector2d p(0.8 + 0.3 * std::cos(a), -0.4 + 0.2 * std::sin(a));
      b = std::max(b, n.dot(p));
      b_wrong = std::max(b_wrong, n.dot(reprojected(real, calibrated, p)));
    }
    exact.supports.b_m.push_back(static_cast<float>(b));
    distorted.supports.b_m.push_back(static_cast<float>(b_wrong));
    exact.supports.sigma_m.push_back(0.002F);
    distorted.supports.sigma_m.push_back(0.002F);
  }
  View view = View::from(distorted, {0, 0}, kHeight_m * (1.0 + error(1)), 1.0, {});
  double before = 0.0, after = 0.0;
  for (std::size_t k = 0; k < 96; ++k)
    before = std::max(before, std::abs(view.b_m[k] - static_cast<double>(exact.supports.b_m[k])));
  view.assume(error);
  for (std::size_t k = 0; k < 96; ++k)
    after = std::max(after, std::abs(view.b_m[k] - static_cast<double>(exact.supports.b_m[k])));
  EXPECT_GT(before, 0.005);
  // Second order. Corners of half-planes differ from the points, too.
  EXPECT_LT(after, 0.05 * before);
  EXPECT_NEAR(view.camera_height_m, kHeight_m, 1e-4 * kHeight_m);
  view.assume(CameraError::Zero());
  for (std::size_t k = 0; k < 96; ++k) EXPECT_EQ(view.b_m[k], static_cast<double>(distorted.supports.b_m[k]));
}

/// Against Bayes' rule on the likelihoods: a measurement of the error with known noise, of a camera that is
/// exact or errs according to the prior.
TEST(CameraError, BelievedErrorFollowsBayesRule) {
  using Matrix = Eigen::Matrix4d;
  const CameraOptions options;
  Matrix noise = Eigen::Vector4d(1e-3, 2e-3, 8e-4, 6e-4).cwiseAbs2().asDiagonal();
  noise(0, 1) = noise(1, 0) = -1.2e-6;
  const auto density = [](const Eigen::Vector4d& x, const Matrix& covariance) {
    return std::exp(-0.5 * x.dot(covariance.inverse() * x)) / std::sqrt(covariance.determinant());
  };
  Matrix common = noise;  // with the errors that all outlines share
  common.diagonal() += Eigen::Vector4d(5e-4, 1e-3, 3.5e-4, 3.5e-4).cwiseAbs2();
  for (const double scale : {0.0, 0.3, 0.8, 1.0, 1.3, 3.0}) {
    const Eigen::Vector4d measured = scale * Eigen::Vector4d(0.002, -0.001, 0.002, -0.0015);
    CameraError mean = CameraError::Zero();
    Matrix prior, after;
    for (int round = 0; round < 100; ++round) {  // the prior of the height depends on the estimate
      prior = options.sigmaAt(mean).head<4>().cwiseAbs2().asDiagonal();
      after = (prior.inverse() + noise.inverse()).inverse();
      mean.head<4>() = after * noise.inverse() * measured;
    }
    mean(4) = 0.01;  // nuisance parameter
    CameraCovariance covariance = CameraCovariance::Identity();
    covariance.topLeftCorner<4, 4>() = after;
    const double errs = density(measured, prior + common), is_exact = density(measured, common);
    const Eigen::Vector4d expected = errs / (errs + is_exact) * mean.head<4>();
    EXPECT_LT((believedError(mean, covariance, options) - expected).norm(), 1e-9) << scale;
    if (scale == 0.3) {
      EXPECT_LT(expected.norm(), 0.05 * mean.head<4>().norm());
    }
    if (scale == 3.0) {
      EXPECT_GT(expected.norm(), 0.95 * mean.head<4>().norm());
    }
  }
  CameraOptions as_calibrated;
  as_calibrated.estimate = false;
  EXPECT_EQ(believedError(CameraError::Ones(), CameraCovariance::Identity(), as_calibrated).norm(), 0.0);
}

/// A quantity was measured as m ± s, in addition to the prior. The description gives m ± s without the prior,
/// and nothing if m is not significant.
TEST(DescribeError, GivesTheMeasurementWithoutThePrior) {
  const CameraOptions options;
  const CameraError prior = options.sigma();
  CameraError measured, noise;
  measured << 0.012, 0.0002, -0.02, 0.0004, 0.001;
  noise << 0.001, 0.001, 0.002, 0.001, 0.001;
  CameraError mean;
  CameraCovariance covariance = CameraCovariance::Zero();
  for (int i = 0; i < kCameraErrors; ++i) {
    const double by_measurement = 1.0 / (noise(i) * noise(i)),
                 information = by_measurement + 1.0 / (prior(i) * prior(i));
    covariance(i, i) = 1.0 / information;
    mean(i) = by_measurement * measured(i) / information;
  }
  EXPECT_EQ(describeError(mean, covariance, options),
            "focal length +1.20 ± 0.11 %, roll -1.15 ± 0.12 degrees");
  EXPECT_EQ(describeError(0.1 * mean, covariance, options), "");
  CameraOptions as_calibrated;
  as_calibrated.estimate = false;
  EXPECT_EQ(describeError(mean, covariance, as_calibrated), "");
}

/// All outlines may share an error of a tenth of a pixel, however many agree.
TEST(DescribeError, GivesNoErrorBelowATenthOfAPixel) {
  const auto description = [](double focal, double pitch_rad) {
    const CameraOptions options;
    const double variance = 1e-10, prior_focal = std::pow(options.focal_sigma, 2),
                 prior_tilt = std::pow(options.tilt_sigma_rad, 2);
    CameraError mean = CameraError::Zero();
    mean(0) = focal / (1.0 + variance / prior_focal);
    mean(3) = pitch_rad / (1.0 + variance / prior_tilt);
    CameraCovariance covariance = CameraCovariance::Zero();
    for (int i = 0; i < kCameraErrors; ++i)
      covariance(i, i) = 1.0 / (1.0 / variance + 1.0 / std::pow(options.sigma()(i), 2));
    return describeError(mean, covariance, options);
  };
  EXPECT_EQ(description(0.002, 0.0), "");
  EXPECT_EQ(description(0.0, 0.0015), "");
  EXPECT_EQ(description(0.003, 0.0), "focal length +0.30 ± 0.05 %");
  EXPECT_EQ(description(0.0, 0.0035), "pitch +0.20 ± 0.02 degrees");
}

/// Hysteresis: the threshold for a report is higher than that for its withdrawal.
TEST(DescribeError, WithdrawsAtALowerThresholdThanItReports) {
  const CameraOptions options;
  const auto finding = [&](double focal) {
    CameraCovariance covariance = CameraCovariance::Zero();
    CameraError mean = CameraError::Zero();
    for (int i = 0; i < kCameraErrors; ++i)
      covariance(i, i) = 1.0 / (1.0 / std::pow(options.sigma()(i), 2) + 1.0 / std::pow(1e-3, 2));
    mean(0) = focal * covariance(0, 0) / std::pow(1e-3, 2);
    return CameraFinding(mean, covariance, options);
  };
  const double sigma = std::hypot(1e-3, 5e-4);
  EXPECT_EQ(CameraFinding::name(finding(5.2 * sigma).wrong()), "focal length");
  EXPECT_TRUE(finding(4.0 * sigma).wrong().none());
  EXPECT_EQ(CameraFinding::name(finding(4.0 * sigma).possible()), "focal length");
  EXPECT_TRUE(finding(2.8 * sigma).possible().none());
  EXPECT_EQ(CameraFinding::name(CameraFinding::Quantities(0b1010)), "height, pitch");
}

TEST(CameraOptions, ReadsValuesAndRejectsErrors) {
  const auto good = options::Section::parse("focal_sigma: 0.01\nestimate: false\n", "t.yaml");
  EXPECT_EQ(CameraOptions::read(good).focal_sigma, 0.01);
  EXPECT_LT(CameraOptions::read(good).sigma().maxCoeff(), 1e-8);
  EXPECT_THROW(CameraOptions::read(options::Section::parse("focal_sigma: 0\n", "t.yaml")), options::Error);
  EXPECT_THROW(CameraOptions::read(options::Section::parse("focus: 1\n", "t.yaml")), options::Error);
}

}  // namespace
}  // namespace omnifleet::estimation
