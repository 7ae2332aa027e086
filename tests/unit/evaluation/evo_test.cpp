// ATE and RPE of published trajectories against the figures of evo and of an independent computation.
#include <gtest/gtest.h>

#include "evaluation/trajectory_metrics.h"
#include "tests/test_data.h"

namespace omnifleet::evaluation {
namespace {

constexpr double kDegrees = 180.0 / M_PI;

PosePairs load(const std::string& folder, const char* truth, const char* estimate) {
  return associate(dataset::readTum(folder + "/" + truth), dataset::readTum(folder + "/" + estimate));
}

// The documentation of evo (doc/performance.md) prints for `evo_ape tum fr2_desk_groundtruth.txt
// fr2_desk_ORB.txt --align`: max 0.024300, mean 0.007492, median 0.007415, min 0.000350, rmse 0.008119, sse
// 0.143305, std 0.003129.
TEST(Evo, MatchesPublishedApeOfFr2Desk) {
  OMNIFLEET_NEEDS_DATA(folder, "trajectories_and_maps");
  const Statistics ape =
      absoluteTrajectoryError(load(folder, "fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt"), Alignment::kSe3);
  constexpr double kPrinted = 0.6e-6;  // six decimals are published
  EXPECT_NEAR(ape.max, 0.024300, kPrinted);
  EXPECT_NEAR(ape.mean, 0.007492, kPrinted);
  EXPECT_NEAR(ape.median, 0.007415, kPrinted);
  EXPECT_NEAR(ape.min, 0.000350, kPrinted);
  EXPECT_NEAR(ape.rmse, 0.008119, kPrinted);
  EXPECT_EQ(ape.count, 2174);
  // Single pairs change the sum. For a stamp halfway between two others, evo's floating-point seconds select
  // either, nanoseconds the earlier one.
  EXPECT_NEAR(ape.rmse * ape.rmse * ape.count, 0.143305, 3e-6);
  EXPECT_NEAR(ape.std, 0.003129, kPrinted);
}

struct Reference {
  const char *truth, *estimate;
  int pairs;
  double none, rigid, similarity, scale;  ///< APE rmse, metres; scale factor
  double rpe_m, rpe_deg;                  ///< RPE rmse, delta 1 frame
};

// Computed with numpy from the definitions of evo (nearest stamps within 10 ms in whole nanoseconds, Umeyama
// by SVD, E = (Q⁻¹Q')⁻¹(P⁻¹P')).
constexpr Reference kReferences[] = {
    {"fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt", 2174, 3.173993808, 0.008118926, 0.006123161,
     0.9969698743, 0.003490211, 0.280521093},
    {"fr2_desk_groundtruth.txt", "fr2_desk_ORB_kf_mono.txt", 118, 2.373886736, 0.939051017, 0.007729308,
     2.2280240470, 0.136728824, 0.387007461},
    {"freiburg1_xyz-groundtruth.txt", "freiburg1_xyz-rgbdslam.txt", 785, 0.020079418, 0.013470089,
     0.013389385, 1.0080013899, 0.005764371, 0.353613161},
    {"freiburg1_xyz-groundtruth.txt", "freiburg1_xyz-rgbdslam_drift.txt", 785, 0.134185420, 0.013470119,
     0.013389416, 1.0080013413, 0.005764379, 0.353613536},
    {"freiburg1_xyz-groundtruth.txt", "freiburg1_xyz-ORB_kf_mono.txt", 32, 2.025141546, 0.024301632,
     0.009754582, 1.1056223637, 0.025265936, 0.884848960},
};

TEST(Evo, MatchesIndependentComputation) {
  OMNIFLEET_NEEDS_DATA(folder, "trajectories_and_maps");
  constexpr double kQuoted = 1e-9;  // nine decimals are listed
  for (const Reference& r : kReferences) {
    SCOPED_TRACE(r.estimate);
    const PosePairs pairs = load(folder, r.truth, r.estimate);
    EXPECT_EQ(pairs.truth.size(), static_cast<std::size_t>(r.pairs));
    EXPECT_NEAR(absoluteTrajectoryError(pairs, Alignment::kNone).rmse, r.none, kQuoted);
    EXPECT_NEAR(absoluteTrajectoryError(pairs, Alignment::kSe3).rmse, r.rigid, kQuoted);
    EXPECT_NEAR(absoluteTrajectoryError(pairs, Alignment::kSe3, true).rmse, r.similarity, kQuoted);
    EXPECT_NEAR(align(pairs.estimate, pairs.truth, Alignment::kSe3, true).scale, r.scale, 1e-9);
    const RelativeError rpe = relativePoseError(pairs);
    EXPECT_NEAR(rpe.translation_m.rmse, r.rpe_m, kQuoted);
    // The numpy reference takes acos of the trace, which loses digits near zero angle.
    EXPECT_NEAR(rpe.rotation_rad.rmse * kDegrees, r.rpe_deg, 1e-6);
  }
}

}  // namespace
}  // namespace omnifleet::evaluation
