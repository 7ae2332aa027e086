#include "localizer/ceiling_agreement.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::localizer {
namespace {

constexpr TimeNs kFrame_ns = 200'000'000;

Measurement poseFrom(const std::string& source, double x_m, TimeNs time_ns) {
  Measurement m;
  m.source = source;
  m.kind = MeasurementKind::kAbsolutePose;
  m.to = "r1";
  m.acquired_ns = time_ns;
  m.value = {x_m, 0.5, 0.1};
  m.covariance = Eigen::Vector3d(1e-6, 1e-6, 2e-5).asDiagonal();  // 1 mm, 0.26°
  return m;
}

std::vector<const Measurement*> checked(CeilingAgreement& agreement, TimeNs now_ns,
                                        const std::vector<Measurement>& measurements) {
  std::vector<const Measurement*> pointers;
  for (const Measurement& m : measurements) pointers.push_back(&m);
  agreement.check(now_ns, pointers);
  return pointers;
}

TEST(CeilingAgreement, PassesPosesThatAgree) {
  CeilingAgreement agreement({});
  const auto passed = checked(agreement, 0, {poseFrom("c1", 1.0, 0), poseFrom("c2", 1.001, 0)});
  ASSERT_EQ(passed.size(), 2u);
  EXPECT_EQ(passed[0]->covariance(0, 0), 1e-6);
  EXPECT_TRUE(agreement.takeMessages().empty());
}

// 5 mm apart at σ 1 mm each: χ² = 12.5, which the extrinsics may explain. The fusion of both must have the σ of
// that difference.
TEST(CeilingAgreement, EnlargesCovariancesUntilTheyExplainTheDifference) {
  CeilingAgreement agreement({});
  const auto passed = checked(agreement, 0, {poseFrom("c1", 1.0, 0), poseFrom("c2", 1.005, 0)});
  ASSERT_EQ(passed.size(), 2u);
  for (const Measurement* m : passed) EXPECT_NEAR(m->covariance(0, 0), 1e-6 * 12.5 / 3.0, 1e-9);
}

TEST(CeilingAgreement, RejectsBothCamerasWhileTheyDisagree) {
  CeilingAgreement agreement({});
  TimeNs now = 0;
  for (int frame = 0; frame < 5; ++frame, now += kFrame_ns)
    EXPECT_TRUE(checked(agreement, now, {poseFrom("c1", 1.0, now), poseFrom("c2", 1.05, now)}).empty());
  const auto messages = agreement.takeMessages();
  ASSERT_EQ(messages.size(), 1u) << "once, not per frame";
  EXPECT_EQ(messages[0].code, ErrorCode::kCamerasDisagree);
  EXPECT_NE(messages[0].text.find("5.0 cm"), std::string::npos) << messages[0].text;
  EXPECT_EQ(agreement.rejected(), 10u);
  EXPECT_EQ(checked(agreement, now, {poseFrom("c1", 1.0, now), poseFrom("c2", 1.0, now)}).size(), 2u);
  now += kFrame_ns;
  checked(agreement, now, {poseFrom("c1", 1.0, now), poseFrom("c2", 1.05, now)});
  EXPECT_EQ(agreement.takeMessages().size(), 1u) << "again, because it was over";
}

// The cameras take turns, 15 ms apart: the first pose of a pair is used before the second arrives, but only once.
TEST(CeilingAgreement, RejectsDisagreeingCamerasThatAreNotSynchronous) {
  CeilingAgreement agreement({});
  std::size_t used = 0;
  for (TimeNs now = 0; now < 10 * kFrame_ns; now += kFrame_ns) {
    used += checked(agreement, now, {poseFrom("c1", 1.0, now)}).size();
    used += checked(agreement, now + 15'000'000, {poseFrom("c2", 1.05, now + 15'000'000)}).size();
  }
  EXPECT_EQ(used, 1u);
  const TimeNs later = 20 * kFrame_ns;  // only one of them sees the robot
  EXPECT_EQ(checked(agreement, later, {poseFrom("c1", 1.0, later)}).size(), 1u);
}

TEST(CeilingAgreement, RejectsPosesThatAreTooOld) {
  CeilingAgreement agreement({});
  EXPECT_TRUE(checked(agreement, 2'500'000'000, {poseFrom("c1", 1.0, 0)}).empty());
  const auto messages = agreement.takeMessages();
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_EQ(messages[0].code, ErrorCode::kMeasurementRejected);
}

TEST(CeilingAgreement, PassesOtherMeasurementsUnchanged) {
  CeilingAgreement agreement({});
  Measurement range;
  range.kind = MeasurementKind::kRangeBearing;
  std::vector<const Measurement*> measurements{&range};
  agreement.check(9'000'000'000, measurements);
  EXPECT_EQ(measurements, std::vector<const Measurement*>{&range});
}

}  // namespace
}  // namespace omnifleet::localizer
