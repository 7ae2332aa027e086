#include "localizer/ceiling_agreement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace omnifleet::localizer {
namespace {

constexpr TimeNs kFrame_ns = 200'000'000;

Measurement poseFrom(const std::string& source, double x_m, TimeNs time_ns, const std::string& robot = "r1") {
  Measurement m;
  m.source = source;
  m.kind = MeasurementKind::kAbsolutePose;
  m.to = robot;
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

// 5 mm apart at σ 1 mm each: χ² = 12.5, which the extrinsics may explain. The fusion of both must have the σ
// of that difference.
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

// The cameras take turns, 15 ms apart: the first pose of a pair is used before the second arrives, but only
// once.
TEST(CeilingAgreement, RejectsDisagreeingCamerasThatAreNotSynchronous) {
  CeilingAgreement agreement({});
  std::size_t used = 0;
  for (TimeNs now = 0; now < 10 * kFrame_ns; now += kFrame_ns) {
    used += checked(agreement, now, {poseFrom("c1", 1.0, now)}).size();
    used += checked(agreement, now + 15'000'000, {poseFrom("c2", 1.05, now + 15'000'000)}).size();
  }
  EXPECT_EQ(used, 1u);
  const TimeNs later = 20 * kFrame_ns;  // only one of them sees the robot: it may be the one that was moved
  EXPECT_TRUE(checked(agreement, later, {poseFrom("c1", 1.0, later)}).empty());
}

/// What two cameras measure of r1 at one time: how far the x of c2 is from that of c1, metres.
struct MovedCase {
  const char* name;
  std::vector<double> apart_m;
  bool used;  ///< afterwards, the poses of r2 that one camera alone sees
};

// The extrinsics are those of the camera, so what they show of r1 holds for r2, far from the overlap.
TEST(CeilingAgreement, RejectsAMovedPairOutsideOfTheOverlapForEveryRobot) {
  const MovedCase cases[] = {
      {"never compared: nothing is known", {}, true},
      {"always agrees", {0.0, 0.001, 0.0, 0.0, 0.0}, true},
      {"one wrong detection", {0.0, 0.0, 0.1, 0.0}, true},
      {"one wrong detection at the end", {0.0, 0.0, 0.1}, true},
      {"two wrong images", {0.0, 0.1, 0.1}, true},
      {"wrong images with an agreement between", {0.1, 0.1, 0.0, 0.1, 0.1, 0.0, 0.1, 0.1}, true},
      {"moved before the start", {0.1, 0.1, 0.1}, false},
      {"moved on the way", {0.0, 0.0, 0.0, 0.1, 0.1, 0.1}, false},
      {"moved, two agreements by chance", {0.1, 0.1, 0.1, 0.0, 0.0}, false},
      {"moved, agreements that do not follow each other", {0.1, 0.1, 0.1, 0.0, 0.0, 0.1, 0.0, 0.0}, false},
      {"agrees again", {0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0}, true},
      {"agrees again, then is moved again", {0.1, 0.1, 0.1, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1}, false}};
  for (const MovedCase& test : cases) {
    CeilingAgreement agreement({});
    TimeNs now = 0;
    for (const double apart_m : test.apart_m) {
      const bool agrees = apart_m < 0.05;
      EXPECT_EQ(
          checked(agreement, now, {poseFrom("c1", 1.0, now), poseFrom("c2", 1.0 + apart_m, now)}).size(),
          agrees ? 2u : 0u)
          << test.name << ": a pose that both measure is used";
      now += kFrame_ns;
    }
    for (const char* camera : {"c1", "c2", "c3"}) {
      now += 20 * kFrame_ns;
      const bool used = test.used || std::string(camera) == "c3";  // nothing speaks against c3
      EXPECT_EQ(checked(agreement, now, {poseFrom(camera, 3.0, now, "r2")}).size(), used ? 1u : 0u)
          << test.name << ", " << camera;
    }
  }
}

// Three robots whose markers one camera mixes up in one image are one piece of evidence, as is an image in
// which one robot of three is right.
TEST(CeilingAgreement, CountsAnImageOnceHoweverManyRobotsItShows) {
  const char* const robots[] = {"r1", "r2", "r3"};
  const auto usedAfter = [&](int images, int right) {
    CeilingAgreement agreement({});
    TimeNs now = 0;
    for (int image = 0; image < images; ++image, now += kFrame_ns) {
      std::vector<Measurement> poses;
      for (int i = 0; i < 3; ++i) {
        poses.push_back(poseFrom("c1", 1.0, now, robots[i]));
        poses.push_back(poseFrom("c2", i == right ? 1.0 : 1.1, now, robots[i]));
      }
      checked(agreement, now, poses);
    }
    return checked(agreement, now, {poseFrom("c1", 3.0, now, "r4")}).size();
  };
  EXPECT_EQ(usedAfter(2, -1), 1u) << "six differences at two times";
  EXPECT_EQ(usedAfter(3, -1), 0u);
  for (int right = 0; right < 3; ++right) EXPECT_EQ(usedAfter(9, right), 1u) << right;
}

TEST(CeilingAgreement, TakesDifferencesOfSeveralRobotsTogether) {
  CeilingAgreement agreement({});
  TimeNs now = 0;
  for (const char* robot : {"r1", "r2", "r3"}) {
    checked(agreement, now, {poseFrom("c1", 1.0, now, robot), poseFrom("c2", 1.1, now, robot)});
    now += kFrame_ns;
  }
  EXPECT_TRUE(checked(agreement, now, {poseFrom("c1", 3.0, now, "r4")}).empty());
}

/// Which of the cameras c1, c2, c3 are used for a robot that each of them alone sees, if c1 is at 1 m and the
/// other two are at these places. The pairs are compared in the order given, three times each.
std::string usedCameras(double second_m, double third_m, const std::vector<std::string>& order) {
  CeilingAgreement agreement({});
  const std::map<std::string, double> x_m{{"c1", 1.0}, {"c2", second_m}, {"c3", third_m}};
  TimeNs now = 0;
  for (const std::string& pair : order) {
    for (int i = 0; i < 3; ++i, now += 20 * kFrame_ns) {
      const std::string one = "c" + pair.substr(0, 1), other = "c" + pair.substr(1, 1);
      checked(agreement, now, {poseFrom(one, x_m.at(one), now), poseFrom(other, x_m.at(other), now)});
    }
  }
  std::string used;
  for (const auto& [camera, x] : x_m) {
    now += 20 * kFrame_ns;
    used += checked(agreement, now, {poseFrom(camera, 3.0, now, "r2")}).empty() ? "" : camera + " ";
  }
  return used;
}

TEST(CeilingAgreement, RejectsOnlyTheCameraThatAThirdOneContradicts) {
  EXPECT_EQ(usedCameras(1.1, 1.0, {"12", "13", "23"}), "c1 c3 ") << "c2 was moved";
  EXPECT_EQ(usedCameras(1.1, 1.1, {"12", "13", "23"}), "c2 c3 ") << "c1 was moved";
  EXPECT_EQ(usedCameras(1.1, 1.2, {"12", "13", "23"}), "") << "each differs from both others";
  EXPECT_EQ(usedCameras(1.1, 1.0, {"12", "13"}), "c1 c3 ") << "c3 was never compared with c2";
  EXPECT_EQ(usedCameras(1.1, 1.0, {"12", "23"}), "") << "no camera agrees with another one";
  EXPECT_EQ(usedCameras(1.1, 1.0, {"13", "12"}), "c3 ") << "c3 agreed before: c1 may have been moved since";
}

// In the overlap of all three, the two that agree are used, the moved one is not.
TEST(CeilingAgreement, UsesTwoCamerasThatAgreeBesideAMovedOne) {
  CeilingAgreement agreement({});
  std::vector<const Measurement*> passed;
  TimeNs now = 0;
  for (int frame = 0; frame < 6; ++frame, now += kFrame_ns)
    passed = checked(agreement, now,
                     {poseFrom("c1", 1.0, now), poseFrom("c2", 1.1, now), poseFrom("c3", 1.0, now)});
  ASSERT_EQ(passed.size(), 2u);
  EXPECT_EQ(passed[0]->source, "c1");
  EXPECT_EQ(passed[1]->source, "c3");
}

TEST(CeilingAgreement, SaysWhatIsNotUsedAndForHowLong) {
  AgreementOptions options;
  options.moved_times = 7;
  CeilingAgreement agreement(options);
  checked(agreement, 0, {poseFrom("c1", 1.0, 0), poseFrom("c2", 1.05, 0)});
  const auto messages = agreement.takeMessages();
  ASSERT_EQ(messages.size(), 1u);
  for (const char* part : {"c1 and c2", "r1", "7 times", "of any robot", "rotation_rpy_deg"})
    EXPECT_NE(messages[0].text.find(part), std::string::npos) << messages[0].text;
}

TEST(CeilingAgreement, ReadsItsOptions) {
  const auto read = [](const std::string& text) {
    return AgreementOptions::read(options::Section::parse(text, "test"));
  };
  EXPECT_EQ(read("moved_times: 5").moved_times, 5);
  EXPECT_EQ(read("{}").moved_times, 3);
  EXPECT_THROW(read("moved_times: 0"), options::Error);
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
