// Classifier with every input that the wire may bring.

#include <gtest/gtest.h>

#include "tests/unit/services/classifier/scenario.h"

namespace omnifleet::sim {
namespace {

using classifier::Classifier;

/// Inputs: invalid frames, gaps, frames without supports, non-finite numbers.
class ClassifierInput : public testing::Test {
 protected:
  ClassifierInput() : rng_(5), scene_(apartScene(rng_)) {
    for (std::size_t i = 0; i < 3; ++i) {
      bodies_[scene_.bodies[i].name].radius_m = 0.15;
      bodies_[scene_.bodies[i].name].height_m = 0.3;
    }
  }
  Classifier make(const Classifier::Options& options = {}) const {
    return Classifier(options, "r1", bodies_);
  }
  LocalMap next() {
    const Scene before = scene_;
    if (frame_ > 0) scene_.advance();
    LocalMap map = localMapOf(scene_, 0, frame_ ? &before : nullptr, frame_, rng_);
    ++frame_;
    return map;
  }
  std::mt19937 rng_;
  Scene scene_;
  std::map<std::string, RobotBody> bodies_;
  int frame_ = 0;
};

TEST_F(ClassifierInput, PublishesOneSamplePerInputWithItsHeader) {
  Classifier classifier = make();
  for (int i = 0; i < 5; ++i) {
    const LocalMap map = next();
    const Objects& objects = classifier.process(map, {});
    EXPECT_EQ(objects.robot, "r1");
    EXPECT_EQ(objects.sequence, map.sequence);
    EXPECT_EQ(objects.acquired_ns, map.acquired_ns);
    EXPECT_EQ(objects.tracks.size(), map.objects.size());
    EXPECT_EQ(objects.motion.valid, map.motion.valid);
  }
}

TEST_F(ClassifierInput, KeepsTracksNotVisibleInInvalidFrame) {
  Classifier classifier = make();
  classifier.process(next(), {});
  const std::size_t before = classifier.process(next(), {}).tracks.size();
  for (const bool wheels : {true, false}) {
    LocalMap map = next();
    map.state = FrameState::kDark;
    map.motion.valid = wheels;
    map.objects.clear();
    map.scan = {};
    const Objects& objects = classifier.process(map, {});
    EXPECT_EQ(objects.state, FrameState::kDark);
    EXPECT_EQ(objects.tracks.size(), before);
    for (const Track& track : objects.tracks) {
      EXPECT_FALSE(track.visible);
      EXPECT_TRUE(track.supports.empty());
      EXPECT_TRUE(track.points.empty());
    }
  }
}

TEST_F(ClassifierInput, AssignsPointsToTheirTrack) {
  Classifier classifier = make();
  int checked = 0;
  for (int i = 0; i < 4; ++i) {
    LocalMap map = next();
    for (auto& object : map.objects) {
      const Eigen::Vector2f zero = Eigen::Vector2f::Zero();
      const FlowVector unknown{zero, zero, zero, zero, zero, {}};
      FlowVector known = unknown;
      known.point.point_m << object.contact_m.cast<float>(), 0.1F;
      known.point.sigma_m = 0.01F;
      object.vectors = {known, unknown};
    }
    for (const Track& track : classifier.process(map, {}).tracks) {
      if (!track.visible) continue;
      ASSERT_EQ(track.points.size(), 1U);
      EXPECT_EQ(track.points[0].point_m.head<2>(), track.contact_m.cast<float>());
      EXPECT_EQ(track.points[0].sigma_m, 0.01F);
      ++checked;
    }
  }
  EXPECT_GE(checked, 12);
}

TEST_F(ClassifierInput, NeverReusesIds) {
  Classifier classifier = make();
  std::map<std::uint32_t, int> last_seen;
  for (int i = 0; i < 60; ++i) {
    LocalMap map = next();
    if (i % 20 >= 8) map.objects.clear();  // longer than a new track is kept
    const Objects& objects = classifier.process(map, {});
    for (const Track& track : objects.tracks) {
      const auto last = last_seen.find(track.id);
      EXPECT_TRUE(last == last_seen.end() || last->second == i - 1) << "id " << track.id << " was reused";
      last_seen[track.id] = i;
    }
  }
}

TEST_F(ClassifierInput, LabelsScanByTrack) {
  Classifier classifier = make();
  const std::vector<PoseEstimate> poses = publish(scene_, 0, rng_);
  classifier.process(next(), poses);
  const LocalMap map = next();
  const Objects& objects = classifier.process(map, poses);
  std::map<std::uint32_t, ObjectKind> kinds;
  for (const Track& track : objects.tracks) kinds[track.id] = track.kind;
  int hits = 0;
  for (std::size_t i = 0; i < objects.scan.label.size(); ++i) {
    if (map.scan.label[i] == RayLabel::kFloorEnd) {
      EXPECT_EQ(objects.scan.label[i], RayLabel::kFloorEnd);
      EXPECT_EQ(objects.scan.object[i], 0);
      continue;
    }
    ++hits;
    ASSERT_EQ(kinds.count(objects.scan.object[i]), 1U);
    const ObjectKind kind = kinds[objects.scan.object[i]];
    EXPECT_EQ(objects.scan.label[i] == RayLabel::kRobot, kind == ObjectKind::kRobot);
    EXPECT_EQ(objects.scan.label[i] == RayLabel::kObstacle, kind == ObjectKind::kObstacle);
  }
  EXPECT_GT(hits, 20);
}

TEST_F(ClassifierInput, SeesNoMotionAcrossAGap) {
  Classifier classifier = make();
  for (int i = 0; i < 15; ++i) classifier.process(next(), {});
  scene_.bodies[0].pose = scene_.bodies[0].pose * Pose2{0.25, 0.1, 0.0};  // kidnapped during the gap
  LocalMap after = next();
  after.motion.valid = false;
  classifier.process(after, {});
  for (int i = 0; i < 15; ++i) {
    for (const Track& track : classifier.process(next(), {}).tracks) {
      const Eigen::Vector2d place = scene_.bodies[0].pose * track.position_m;
      const bool robot = (place - scene_.bodies[1].pose.translation()).norm() < 0.2 ||
                         (place - scene_.bodies[2].pose.translation()).norm() < 0.2;
      if (track.visible && track.kind == ObjectKind::kRobot) {
        EXPECT_TRUE(robot);
      }
    }
  }
}

TEST_F(ClassifierInput, IgnoresNonFiniteNumbers) {
  Classifier classifier = make();
  for (int i = 0; i < 12; ++i) {
    LocalMap map = next();
    ObjectObservation& object = map.objects[static_cast<std::size_t>(i) % map.objects.size()];
    switch (i % 4) {
      case 0:
        object.supports = {};
        break;
      case 1:
        object.supports.b_m[3] = std::nanf("");
        break;
      case 2:
        object.contact_m.x() = std::nan("");
        break;
      default:
        object.height_m = std::nan("");
        object.height_sigma_m = 0.01;
        break;
    }
    for (const Track& track : classifier.process(map, {}).tracks) {
      EXPECT_TRUE(track.position_m.allFinite());
      EXPECT_TRUE(track.velocity_mps.allFinite());
      EXPECT_TRUE(track.covariance.allFinite());
    }
  }
}

TEST_F(ClassifierInput, IsDeterministic) {
  std::vector<double> first, second;
  for (std::vector<double>* values : {&first, &second}) {
    rng_.seed(5);
    scene_ = apartScene(rng_);
    scene_.bodies[0].v_mps = 0.2;
    frame_ = 0;
    Classifier classifier = make();
    for (int i = 0; i < 20; ++i) {
      for (const Track& track : classifier.process(next(), publish(scene_, i, rng_)).tracks) {
        values->insert(values->end(), {track.position_m.x(), track.velocity_mps.y(), track.kind_probability});
      }
    }
  }
  EXPECT_EQ(first, second);
}

/// The wheels underreport the turn of the robot: stationary objects seem to move around it.
TEST_F(ClassifierInput, UsesPublishedPosesAgainstWheelTurnError) {
  scene_.bodies[3].outline = scene_.bodies[1].outline;  // an object of nearly a robot's shape
  for (Eigen::Vector2d& vertex : scene_.bodies[3].outline) vertex *= 1.15;
  scene_.bodies[3].height_m = 0.29;
  Classifier classifier = make();
  int obstacles = 0, robots = 0;
  std::vector<PoseEstimate> poses;
  for (int i = 0; i < 60; ++i) {
    LocalMap map = next();
    if (i > 20) map.motion.previous_from_current.theta_rad += 0.015;
    for (const Track& track : classifier.process(map, poses).tracks) {
      const Eigen::Vector2d place = scene_.bodies[0].pose * track.position_m;
      bool is_robot = false;
      for (std::size_t k = 1; k < 3; ++k)
        is_robot = is_robot || (scene_.bodies[k].pose.translation() - place).norm() < 0.2;
      if (is_robot || i <= 20) continue;  // the first label, from shape alone, is corrected by then
      ++obstacles;
      robots += track.kind == ObjectKind::kRobot ? 1 : 0;
    }
    poses.clear();
    for (std::size_t k = 0; k < 3; ++k) {
      PoseEstimate pose;
      pose.robot = scene_.bodies[k].name;
      pose.acquired_ns = map.acquired_ns;
      pose.valid = true;
      pose.map_from_base = scene_.bodies[k].pose;
      pose.covariance = Eigen::Vector3d(1e-5, 1e-5, 1e-5).asDiagonal();
      poses.push_back(pose);
    }
  }
  EXPECT_GT(obstacles, 40);
  EXPECT_EQ(robots, 0);
}

TEST_F(ClassifierInput, ClassifiesByVectorsAloneWithChoisRule) {
  Classifier::Options options;
  options.kind.method = "vectors";
  for (std::size_t i = 0; i < 3; ++i) {
    scene_.bodies[i].pose.theta_rad = 0.0;
    scene_.bodies[i].v_mps = 0.3;  // the paper's case: all robots at one constant speed
  }
  Classifier classifier = make(options);
  int right = 0, wrong = 0;
  for (int i = 0; i < 12; ++i) {
    const LocalMap map = next();
    const Objects& objects = classifier.process(map, {});
    for (const Track& track : objects.tracks) {
      // The centroid of the silhouette lies behind the object, but in its direction.
      const auto towards = [&](std::size_t body) {
        const Eigen::Vector2d seen = scene_.bodies[0].pose.inverse() * scene_.bodies[body].pose.translation();
        return track.position_m.normalized().dot(seen.normalized()) > 0.99;
      };
      const bool robot = towards(1) || towards(2);
      if (i > 0) ++(robot == (track.kind == ObjectKind::kRobot) ? right : wrong);
    }
  }
  EXPECT_GT(right, 8 * wrong);
}

TEST_F(ClassifierInput, RejectsRobotWithoutABody) {
  EXPECT_THROW(Classifier({}, "r9", bodies_), options::Error);
}

TEST(ClassifierOptions, RejectsUnknownAndOutOfRangeValues) {
  const auto read = [](const std::string& text) {
    return Classifier::Options::read(options::Section::parse(text, "t"));
  };
  EXPECT_DOUBLE_EQ(read("kind: {moved_m: 0.2}").kind.moved_m, 0.2);
  EXPECT_EQ(read("kind: {method: vectors}").kind.method, "vectors");
  EXPECT_THROW(read("kind: {method: guess}"), options::Error);
  EXPECT_THROW(read("tracker: {gate_m: -1}"), options::Error);
  EXPECT_THROW(read("tracker: {filter: {no_such: 1}}"), options::Error);
  EXPECT_THROW(read("no_such: 1"), options::Error);
}

}  // namespace
}  // namespace omnifleet::sim
