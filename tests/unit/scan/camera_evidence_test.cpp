// Evidence of matches and of the graph about errors of calibrations: exact scans of a room by a camera whose
// errors are known, and chains with closed forms.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "scan/keyframe_graph.h"
#include "scan/line_scan.h"
#include "scan/scan_matcher.h"
#include "tests/unit/scan/distorted_scans.h"

namespace omnifleet::scan {
namespace {

using Vector8 = CameraDependence::Vector;

constexpr double kCameraSigma = 0.003;  // 1/m
const Eigen::Matrix3d kWeakPrior = Eigen::Vector3d(1e-3, 1e-3, 1e-3).asDiagonal();

/// A rectangular room: its walls are seen from everywhere, so no beam changes its wall between two scans.
testing::Scene plainRoom() {
  return {{{{-1.6, -1.2}, {1.6, -1.2}, {1.6, 1.2}, {-1.6, 1.2}}}};
}

BeamFields fieldsOf(const LineScan& scan, const testing::WrongCamera& camera) {
  BeamFields fields;
  for (const LineScan::Beam& beam : scan.beams())
    fields.push_back(cameraField(beam.point_m.cast<double>(), camera.height_m, camera.lens).cast<float>());
  return fields;
}

Eigen::Vector3d between(const Pose2& a, const Pose2& b) {
  const Pose2 off = a.inverse() * b;
  return {off.x_m, off.y_m, wrapAngle(off.theta_rad)};
}

Pose2 perturbed(const Pose2& pose, const Eigen::Vector3d& by) {
  return pose * Pose2{by.x(), by.y(), by.z()};
}

TEST(LineScanInformation, EqualsFiniteDifferencesOfTheScene) {
  const testing::Scene room = testing::furnishedRoom();
  const Pose2 pose{0.3, -0.2, 0.4};
  LineScan scan;
  scan.fit(testing::seenBy({}, room, pose, 1e-4));  // so small that no line crosses a corner
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  constexpr double kStep = 1e-4;
  for (std::size_t i = 0; i < scan.beams().size(); ++i) {
    if (!scan.beams()[i].has_line) continue;
    const auto inverse = [&](const Pose2& from) {
      const double a = from.theta_rad + 2.0 * M_PI * static_cast<double>(i) / 720.0;
      return 1.0 / room.range(from.translation(), {std::cos(a), std::sin(a)});
    };
    Eigen::Vector3d jacobian;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(k);
      jacobian(k) = (inverse(perturbed(pose, step)) - inverse(perturbed(pose, -step))) / (2.0 * kStep);
    }
    const double sigma = scan.beams()[i].sigma;
    expected += jacobian * jacobian.transpose() / (sigma * sigma);
  }
  EXPECT_GT(scan.lines(), 600U);
  EXPECT_LT((scan.information() - expected).norm(), 0.003 * expected.norm()) << scan.information() << "\n\n"
                                                                             << expected;
}

TEST(LineScanInformation, AddsUpOverBeams) {
  LineScan scan;
  scan.fit(testing::seenBy({}, testing::furnishedRoom(), {}, kCameraSigma));
  std::vector<std::uint8_t> front(720, 0), back(720, 1);
  for (std::size_t i = 0; i < 720; i += 3) front[i] = 1, back[i] = 0;
  const Eigen::Matrix3d sum = scan.information(front) + scan.information(back);
  EXPECT_TRUE(sum.isApprox(scan.information(), 1e-9));
  EXPECT_GT(scan.information(back).norm(), 0.0);
  EXPECT_EQ(scan.information(std::vector<std::uint8_t>(720, 1)).norm(), 0.0);
}

/// Two scans by one camera, 0.5 m apart, and their match.
struct CameraPair {
  LineScan reference, scan;
  Match match;

  CameraPair(const testing::WrongCamera& of_reference, const testing::WrongCamera& of_scan, const Pose2& at,
             const Pose2& moved, std::mt19937* random = nullptr) {
    Boundary first = testing::seenBy(of_reference, plainRoom(), at, kCameraSigma),
             second = testing::seenBy(of_scan, plainRoom(), at * moved, kCameraSigma);
    if (random != nullptr) testing::addNoise(first, *random), testing::addNoise(second, *random);
    reference.fit(first);
    scan.fit(second);
    ScanMatcher matcher;
    match = matcher.match(scan, at * moved, kWeakPrior, {{&reference, at}});
  }
};

TEST(CalibrationTerms, PoseFollowsTheErrorsOfBothCameras) {
  const Pose2 at{-0.2, 0.1, 0.3}, moved{0.45, -0.2, 0.6};
  const CameraPair exact({}, {}, at, moved);
  ASSERT_TRUE(exact.match.valid);
  const CalibrationTerms terms =
      ScanMatcher().calibrationTerms(exact.scan, exact.match.map_from_scan, {&exact.reference, at},
                                     fieldsOf(exact.scan, {}), fieldsOf(exact.reference, {}));
  constexpr double kStep = 2e-4;
  for (int k = 0; k < 8; ++k) {
    testing::WrongCamera of_scan, of_reference;
    (k < 4 ? of_scan : of_reference).error(k % 4) = kStep;
    const CameraPair after(of_reference, of_scan, at, moved);
    (k < 4 ? of_scan : of_reference).error(k % 4) = -kStep;
    const CameraPair before(of_reference, of_scan, at, moved);
    ASSERT_TRUE(after.match.valid && before.match.valid) << k;
    const Eigen::Vector3d change =
        between(before.match.map_from_scan, after.match.map_from_scan) / (2.0 * kStep);
    // Lines are fitted over windows of a curved image of the wall.
    const Eigen::Vector3d expected = terms.pose_by_error.col(k);
    EXPECT_LT((change - expected).norm(), 0.05 * expected.norm() + 0.01)
        << k << ": " << change.transpose() << " expected " << expected.transpose();
  }
}

/// Sum over pairs of scans of one camera.
struct SameCamera {
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  Eigen::Vector4d gradient = Eigen::Vector4d::Zero();

  void add(const CameraPair& pair, const Pose2& at, const testing::WrongCamera& camera) {
    const CalibrationTerms terms =
        ScanMatcher().calibrationTerms(pair.scan, pair.match.map_from_scan, {&pair.reference, at},
                                       fieldsOf(pair.scan, camera), fieldsOf(pair.reference, camera));
    Eigen::Matrix<double, 8, 4> both;
    both << Eigen::Matrix4d::Identity(), Eigen::Matrix4d::Identity();
    information += both.transpose() * terms.information * both;
    gradient += both.transpose() * terms.gradient;
  }
};

/// Eight pairs in different directions. @param random not null: scans with noise
SameCamera pairsOf(const testing::WrongCamera& camera, std::mt19937* random) {
  SameCamera sum;
  for (int k = 0; k < 8; ++k) {
    const double direction = 2.0 * M_PI * k / 8;
    const Pose2 at{0.3 * std::cos(1.0 + 2.0 * k), 0.2 * std::sin(2.0 * k), 0.7 * k};
    const Pose2 moved{0.5 * std::cos(direction), 0.5 * std::sin(direction), 0.2 * k};
    const CameraPair pair(camera, camera, at, moved, random);
    EXPECT_TRUE(pair.match.valid) << k;
    sum.add(pair, at, camera);
  }
  return sum;
}

/// The error that these pairs show. Pairs do not show the height: a prior of 0.1 % holds it.
Eigen::Vector4d shownBy(const SameCamera& sum) {
  const Eigen::Matrix4d prior = Eigen::Vector4d(1.0, 1e6, 1.0, 1.0).asDiagonal();
  return (sum.information + prior).ldlt().solve(sum.gradient);
}

TEST(CalibrationTerms, RecoverAnErrorOfFocalLengthFromScansWithoutNoise) {
  for (const double error : {-0.002, 0.002, 0.005}) {
    testing::WrongCamera camera;
    camera.error(0) = error;
    const Eigen::Vector4d shown = shownBy(pairsOf(camera, nullptr));
    EXPECT_NEAR(shown(0), error, 0.1 * std::abs(error));  // 5 % of this is the second order
    for (const int other : {1, 2, 3}) EXPECT_NEAR(shown(other), 0.0, 0.1 * std::abs(error)) << other;
  }
}

TEST(CalibrationTerms, RecoverAnErrorOfFocalLengthFromNoisyScansByRepetition) {
  constexpr double kError = 0.005;
  constexpr int kSeeds = 5;
  double mean = 0.0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    testing::WrongCamera left;  // what is left of the error after correction
    left.error(0) = kError;
    for (int round = 0; round < 4; ++round) {
      std::mt19937 random(seed);
      left.error(0) -= shownBy(pairsOf(left, &random))(0);
    }
    mean += (kError - left.error(0)) / kSeeds;
  }
  EXPECT_NEAR(mean, kError, 0.1 * kError);  // σ of one seed is 0.0002
}

TEST(CalibrationTerms, LeaveTheHeightOpen) {
  // Height scales the scans and, with them, the pose between them: any height fits. Only the weak prior of
  // the elimination, which holds the pose, remains.
  const SameCamera sum = pairsOf({}, nullptr);
  EXPECT_GT(sum.information(0, 0), 0.0);
  EXPECT_LT(sum.information(1, 1), 0.001 * sum.information(0, 0));
  std::mt19937 random(7);
  const SameCamera noisy = pairsOf({}, &random);
  EXPECT_LT(noisy.information(1, 1), 0.001 * noisy.information(0, 0));
}

TEST(CalibrationTerms, DistinguishTheHeightsOfTwoCameras) {
  // Two cameras see the same room: the ratio of their heights is the ratio of their scales.
  testing::WrongCamera of_scan, of_reference;
  of_scan.error(1) = 0.004;
  const Pose2 at{0.1, 0.0, 0.0};
  const CameraPair pair(of_reference, of_scan, at, {0.3, 0.2, 0.5});
  ASSERT_TRUE(pair.match.valid);
  const CalibrationTerms terms =
      ScanMatcher().calibrationTerms(pair.scan, pair.match.map_from_scan, {&pair.reference, at},
                                     fieldsOf(pair.scan, of_scan), fieldsOf(pair.reference, of_reference));
  EXPECT_NEAR(terms.gradient(1) / terms.information(1, 1), 0.004, 0.0004);
  EXPECT_NEAR(terms.gradient(5) / terms.information(5, 5), -0.004, 0.0004);
}

TEST(CalibrationTerms, AreEmptyForLasers) {
  const Pose2 at{0.1, 0.0, 0.0};
  const CameraPair pair({}, {}, at, {0.3, 0.2, 0.5});
  const CalibrationTerms terms =
      ScanMatcher().calibrationTerms(pair.scan, pair.match.map_from_scan, {&pair.reference, at}, {}, {});
  EXPECT_EQ(terms.information.norm() + terms.gradient.norm() + terms.pose_by_error.norm(), 0.0);
}

/// A straight chain of `steps` pairs along x, held at both ends. Only x of each pair depends on the focal
/// length: of camera `to` by `by_to`, of camera `from` by `by_from`.
struct CameraChain {
  static constexpr int kSteps = 6;
  static constexpr double kStep_m = 0.4, kPairSigma = 0.01, kEndSigma = 0.02, kByTo = 2.0, kByFrom = -0.5;
  /// Variance of the sum of the steps between the two ends.
  static constexpr double kVariance = kSteps * kPairSigma * kPairSigma + 2.0 * kEndSigma * kEndSigma;
  KeyframeGraph graph;

  /// @param error of the focal length of each camera, which the measured pairs contain
  CameraChain(double error_0, double error_1, std::uint32_t to_camera, std::uint32_t from_camera,
              const CameraDependence& own = {}) {
    const double errors[] = {error_0, error_1};
    CameraDependence cameras = own;
    cameras.to_camera = to_camera;
    cameras.from_camera = from_camera;
    cameras.by_error(0, 0) = kByTo;
    cameras.by_error(0, 4) = kByFrom;
    const double off = kByTo * errors[to_camera] + kByFrom * errors[from_camera];
    const auto covariance = [](double s) -> Eigen::Matrix3d { return Eigen::Matrix3d::Identity() * s * s; };
    for (int k = 0; k <= kSteps; ++k) {
      const auto id = graph.add({kStep_m * k, 0.0, 0.0});
      if (k > 0) graph.addRelative(id - 1, id, {kStep_m + off, 0.0, 0.0}, covariance(kPairSigma), &cameras);
      if (k == 0 || k == kSteps) graph.addAbsolute(id, {kStep_m * k, 0.0, 0.0}, covariance(kEndSigma));
    }
  }
};

TEST(CameraEvidence, OfAChainHasTheClosedForm) {
  constexpr double kError = 0.0004;
  CameraChain chain(kError, 0.0, 0, 0);
  chain.graph.optimise();
  const CameraEvidence evidence = chain.graph.cameraEvidence();
  ASSERT_EQ(evidence.information.rows(), 4);
  const double by = CameraChain::kSteps * (CameraChain::kByTo + CameraChain::kByFrom);
  const double information = by * by / CameraChain::kVariance;
  EXPECT_NEAR(evidence.information(0, 0), information, 0.01 * information);
  EXPECT_NEAR(evidence.gradient(0), information * kError, 0.01 * information * kError);
  EXPECT_LT((evidence.information.bottomRightCorner<3, 3>().norm()), 1e-6 * information);
  EXPECT_EQ(evidence.at.norm(), 0.0);
}

TEST(CameraEvidence, SeparatesTheCamerasOfBothEnds) {
  CameraChain chain(0.0004, -0.0002, 1, 0);  // the second camera sees `to`
  chain.graph.optimise();
  const CameraEvidence evidence = chain.graph.cameraEvidence();
  ASSERT_EQ(evidence.information.rows(), 8);
  const double n = CameraChain::kSteps;
  const Eigen::Vector2d by = n * Eigen::Vector2d(CameraChain::kByFrom, CameraChain::kByTo);
  const double sum = by.dot(Eigen::Vector2d(0.0004, -0.0002));
  for (int a = 0; a < 2; ++a) {
    const double gradient = by(a) * sum / CameraChain::kVariance;
    EXPECT_NEAR(evidence.gradient(4 * a), gradient, 0.01 * std::abs(gradient)) << a;
    for (int b = 0; b < 2; ++b) {
      const double information = by(a) * by(b) / CameraChain::kVariance;
      EXPECT_NEAR(evidence.information(4 * a, 4 * b), information, 0.01 * std::abs(information)) << a << b;
    }
  }
}

TEST(CameraEvidence, MovesThePosesWhenTheCameraIsSet) {
  constexpr double kError = 0.0004;
  CameraChain chain(kError, 0.0, 0, 0);
  chain.graph.optimise();
  // Each part of the chain takes the excess in proportion to its variance.
  const double excess = CameraChain::kSteps * (CameraChain::kByTo + CameraChain::kByFrom) * kError;
  const double end = excess * CameraChain::kEndSigma * CameraChain::kEndSigma / CameraChain::kVariance;
  EXPECT_NEAR(chain.graph.pose(0).x_m, -end, 0.01 * end);
  EXPECT_NEAR(chain.graph.pose(CameraChain::kSteps).x_m, CameraChain::kSteps * CameraChain::kStep_m + end,
              0.01 * end);
  chain.graph.setCamera(0, {kError, 0.0, 0.0, 0.0});
  EXPECT_NEAR(chain.graph.optimise(), end, 0.01 * end);
  for (int k = 0; k <= CameraChain::kSteps; ++k)
    EXPECT_NEAR(chain.graph.pose(static_cast<KeyframeGraph::Id>(k)).x_m, CameraChain::kStep_m * k, 1e-6) << k;
  const CameraEvidence evidence = chain.graph.cameraEvidence();
  EXPECT_NEAR(evidence.at(0), kError, 1e-12);
  EXPECT_NEAR(evidence.gradient(0) / evidence.information(0, 0), 0.0, 1e-6) << "nothing is left";
}

TEST(CameraEvidence, AppliesTheErrorOfEachCamera) {
  CameraChain chain(0.0004, -0.0002, 1, 0);
  chain.graph.setCamera(0, {0.0004, 0.0, 0.0, 0.0});
  chain.graph.setCamera(1, {-0.0002, 0.0, 0.0, 0.0});
  chain.graph.optimise();
  for (int k = 0; k <= CameraChain::kSteps; ++k)
    EXPECT_NEAR(chain.graph.pose(static_cast<KeyframeGraph::Id>(k)).x_m, CameraChain::kStep_m * k, 1e-6) << k;
}

TEST(CameraEvidence, CountsFromTheErrorsThatWereTakenOff) {
  CameraDependence own;
  own.assumed(0) = own.assumed(4) = 0.001;
  CameraChain chain(0.0, 0.0, 0, 0, own);  // exact when the assumed error is right
  chain.graph.setCamera(0, {0.001, 0.0, 0.0, 0.0});
  chain.graph.optimise();
  EXPECT_NEAR(chain.graph.pose(0).x_m, 0.0, 1e-6);
  chain.graph.setCamera(0, Eigen::Vector4d::Zero());  // now it counts as wrong by −0.001
  chain.graph.optimise();
  const CameraEvidence evidence = chain.graph.cameraEvidence();
  EXPECT_NEAR(evidence.gradient(0) / evidence.information(0, 0), 0.001, 1e-5);
}

TEST(CameraEvidence, AddsTheEvidenceOfTheMatches) {
  CameraDependence own;
  own.information.topLeftCorner<4, 4>() = Eigen::Vector4d(0.0, 0.0, 50.0, 20.0).asDiagonal();
  own.gradient(2) = 50.0 * 0.01;
  CameraChain chain(0.0, 0.0, 0, 0, own);
  chain.graph.optimise();
  CameraEvidence evidence = chain.graph.cameraEvidence();
  EXPECT_NEAR(evidence.information(2, 2), CameraChain::kSteps * 50.0, 1e-6);
  EXPECT_NEAR(evidence.gradient(2), CameraChain::kSteps * 0.5, 1e-6);
  chain.graph.setCamera(0, {0.0, 0.0, 0.01, 0.0});
  chain.graph.optimise();
  evidence = chain.graph.cameraEvidence();
  EXPECT_NEAR(evidence.gradient(2), 0.0, 1e-6) << "taken off";
}

TEST(CameraEvidence, IsEmptyWithoutCameras) {
  KeyframeGraph graph;
  graph.addAbsolute(graph.add({}), {}, Eigen::Matrix3d::Identity());
  graph.optimise();
  EXPECT_EQ(graph.cameraEvidence().information.size(), 0);
}

/// Mean scatter of a scan with σ of independent noise and `common` σ of errors that 15 neighbouring beams
/// share (as many as a sector has), matched against `references` scans with independent noise, 5 cm apart.
double meanScatter(double common, int references) {
  const testing::Scene room = plainRoom();
  double sum = 0.0;
  constexpr unsigned kRuns = 20;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal(0.0f, 1.0f);
    std::vector<LineScan> others(static_cast<std::size_t>(references));
    std::vector<Reference> poses;
    for (std::size_t k = 0; k < others.size(); ++k) {
      const Pose2 at{0.05 * static_cast<double>(k), 0.0, 0.01};
      Boundary boundary = testing::seenBy({}, room, at, kCameraSigma);
      testing::addNoise(boundary, random);
      others[k].fit(boundary);
      poses.push_back({&others[k], at});
    }
    const Pose2 truth{0.1, 0.1, 0.05};
    Boundary boundary = testing::seenBy({}, room, truth, kCameraSigma);
    testing::addNoise(boundary, random);
    float shared = 0.0f;
    for (std::size_t i = 0; i < boundary.inverse_m.size(); ++i) {
      if (i % 15 == 0) shared = static_cast<float>(common * kCameraSigma) * normal(random);
      boundary.inverse_m[i] += shared;
    }
    LineScan scan;
    scan.fit(boundary);
    ScanMatcher matcher;
    const Match match = matcher.match(scan, truth, kWeakPrior, poses);
    EXPECT_TRUE(match.valid);
    sum += match.scatter / kRuns;
  }
  return sum;
}

TEST(MatchScatter, IsAboutOneForIndependentNoise) {
  for (const int references : {1, 6}) EXPECT_LT(meanScatter(0.0, references), 1.3) << references;
}

TEST(MatchScatter, IsLargeForErrorsCommonToNeighbours) {
  for (const int references : {1, 6}) {
    EXPECT_GT(meanScatter(1.0, references), 1.5) << references;
  }
}

/// The prior of slipping wheels holds the pose away from the scan's optimum. That is no scatter of the scan.
TEST(MatchScatter, IsBoundedWhereAPriorHoldsThePoseOff) {
  const testing::Scene room = plainRoom();
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    Boundary boundary = testing::seenBy({}, room, {}, kCameraSigma);
    testing::addNoise(boundary, random);
    LineScan reference, scan;
    reference.fit(boundary);
    const Pose2 truth{0.1, 0.1, 0.05};
    boundary = testing::seenBy({}, room, truth, kCameraSigma);
    testing::addNoise(boundary, random);
    scan.fit(boundary);
    ScanMatcher matcher;
    const Eigen::Matrix3d sure = Eigen::Vector3d(1e8, 1e8, 1e8).asDiagonal();
    for (const double off_m : {0.01, 0.02, 0.04}) {
      const Match match = matcher.match(scan, truth * Pose2{off_m, 0.0, 0.0}, sure, {{&reference, {}}});
      if (!match.valid) continue;
      EXPECT_LT(match.scatter, 10.0) << seed << ", " << off_m;
    }
  }
}

}  // namespace
}  // namespace omnifleet::scan
