// Robots of the fleet of which the camera separates only pieces from the floor, in an analytic arena.

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/services/classifier/scenario.h"

namespace omnifleet::sim {
namespace {

constexpr unsigned kFirst = 1000, kLast = 1003;

/// Counts, for every robot within 1.8 m of another one, whether the nearest track within 10 cm is a robot.
struct Recall {
  long all = 0, robots = 0, others = 0;
  double share() const { return static_cast<double>(robots) / static_cast<double>(std::max(1L, all)); }
};

void count(const Scene& scene, const Objects& objects, Recall& recall) {
  const auto own = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                [&](const Body& body) { return body.name == objects.robot; });
  for (const Body& body : scene.bodies) {
    const Eigen::Vector2d place = own->pose.inverse() * body.pose.translation();
    if (&body == &*own || !body.robot || place.norm() > 1.8) continue;
    ++recall.all;
    const Track* nearest = nullptr;
    for (const Track& track : objects.tracks) {
      if (!track.visible || (track.position_m - place).norm() > 0.1) continue;
      if (nearest == nullptr || track.kind == ObjectKind::kRobot) nearest = &track;
    }
    recall.robots += nearest != nullptr && nearest->kind == ObjectKind::kRobot ? 1 : 0;
    recall.others += nearest != nullptr && nearest->kind != ObjectKind::kRobot ? 1 : 0;
  }
}

Scenario roaming(Shows shows, Recall& recall) {
  Scenario scenario{"pieces", 60, [shows](std::mt19937& rng) {
                      Scene scene = mixedScene(rng);
                      scene.bodies.resize(5);  // the tops of more bodies would merge
                      scene.sight_m = 6.0;     // m, range at which tops seem to stand
                      for (Body& body : scene.bodies)
                        if (body.robot) body.shows = shows;
                      return scene;
                    }};
  scenario.drive = [](Scene& scene, int, std::mt19937& rng) { scene.steerClear(0.3, rng); };
  scenario.watch = [&recall](const Scene& scene, const Objects& objects, int frame) {
    if (frame > 0) count(scene, objects, recall);
  };
  return scenario;
}

Score runAll(const Scenario& scenario) {
  Score total;
  for (unsigned seed = kFirst; seed <= kLast; ++seed) total += run(scenario, seed);
  return total;
}

TEST(Pieces, RecognizesRobotsByTheirTops) {
  Recall recall;
  const Score score = runAll(roaming(Shows::kTop, recall));
  EXPECT_GT(recall.share(), 0.85);  // some are hidden, some are merged with others
  EXPECT_EQ(recall.others, 0);
  EXPECT_EQ(score.obstacles_as_robots, 0);
  EXPECT_GT(score.obstacles_right, 500);
}

TEST(Pieces, RecognizesRobotsFromUndecidedScans) {
  Recall recall;
  const Score score = runAll(roaming(Shows::kHint, recall));
  EXPECT_GT(recall.share(), 0.9);  // objects stand in front of some
  EXPECT_EQ(score.obstacles_as_robots, 0);
}

/// No pose is published for one second, so the tops are tracked as objects. From the first pose on they are
/// pieces of the robots.
TEST(Pieces, ConvertsTopsToRobotsAtTheFirstPose) {
  constexpr int kSilent = 10, kSettled = 14;
  Recall recall;
  Scenario scenario = roaming(Shows::kTop, recall);
  scenario.garble = [frame = 0](std::vector<PoseEstimate>& poses) mutable {
    if (frame++ % 60 < kSilent) poses.clear();
  };
  scenario.watch = [&recall](const Scene& scene, const Objects& objects, int frame) {
    if (frame > kSettled) count(scene, objects, recall);
    for (const Track& track : objects.tracks) {
      if (frame > kSettled && track.visible && track.kind != ObjectKind::kRobot) {
        EXPECT_FALSE(track.supports.empty()) << "frame " << frame << ": visible without supports";
      }
    }
  };
  const Score score = runAll(scenario);
  EXPECT_GT(recall.share(), 0.8);
  EXPECT_EQ(recall.others, 0);
  EXPECT_GT(score.obstacles_right, 300);
}

/// The published place of one robot is wrong: the floor is visible there.
TEST(Pieces, SeesNoRobotWhereTheFloorIsVisible) {
  constexpr double kOff_m = 0.6;
  Recall recall;
  Scenario scenario = roaming(Shows::kHint, recall);
  scenario.watch = [&recall](const Scene& scene, const Objects& objects, int frame) {
    Scene claimed = scene;
    claimed.bodies[1].pose.y_m += kOff_m;
    claimed.bodies[2].robot = false;
    if (frame > 0 && objects.robot == "r1") count(claimed, objects, recall);
  };
  scenario.garble = [](std::vector<PoseEstimate>& poses) {
    for (PoseEstimate& pose : poses)
      if (pose.robot == "r2") pose.map_from_base.y_m += kOff_m;
  };
  runAll(scenario);
  EXPECT_GT(recall.all, 50);
  EXPECT_LT(recall.share(), 0.1);  // where r3 happens to be
}

/// The outline of the obstacle fits a piece of the robot beside it.
TEST(Pieces, KeepsKnownObstacleBesideARobot) {
  constexpr int kSilent = 10, kFrames = 40;
  Scenario scenario{"beside", kFrames, [](std::mt19937&) {
                      Scene scene;
                      scene.bodies.push_back(round("r1", 0.15, 0.3, {-1.0, 0.0, 0.0}));
                      scene.bodies.push_back(round("r2", 0.15, 0.3, {0.0, 0.0, 0.0}));
                      scene.bodies[0].robot = scene.bodies[1].robot = true;
                      scene.bodies[1].shows = Shows::kHint;
                      scene.bodies.push_back(round("pot", 0.04, 0.06, {-0.1, 0.2, 0.0}));
                      return scene;
                    }};
  scenario.garble = [frame = 0](std::vector<PoseEstimate>& poses) mutable {
    if (frame++ % kFrames < kSilent) poses.clear();
  };
  int seen = 0;
  scenario.watch = [&seen](const Scene& scene, const Objects& objects, int frame) {
    if (frame < kSilent || objects.robot != "r1") return;
    const Eigen::Vector2d place = scene.bodies[0].pose.inverse() * scene.bodies[2].pose.translation();
    seen += std::any_of(objects.tracks.begin(), objects.tracks.end(), [&](const Track& track) {
      return track.visible && track.kind == ObjectKind::kObstacle && (track.position_m - place).norm() < 0.03;
    });
  };
  runAll(scenario);
  EXPECT_EQ(seen, (kLast - kFirst + 1) * (kFrames - kSilent));
}

TEST(Pieces, AreNotUsedByChoisRule) {
  Recall recall;
  Scenario scenario = roaming(Shows::kHint, recall);
  classifier::Classifier::Options options;
  options.kind.method = "vectors";
  run(scenario, kFirst, options);
  EXPECT_GT(recall.all, 50);
  EXPECT_EQ(recall.robots + recall.others, 0);
}

/// Small objects directly in front of robots whose tops alone are visible: a piece that touches the floor in
/// front of the robot belongs to such an object.
TEST(Pieces, RejectsPieceInFrontOfTheRobot) {
  Recall recall;
  Scenario scenario = roaming(Shows::kTop, recall);
  scenario.make = [](std::mt19937&) {
    Scene scene;
    scene.bodies.push_back(round("r1", 0.15, 0.3, {-1.0, 0.0, 0.0}));
    scene.bodies.push_back(round("r2", 0.15, 0.3, {0.2, 0.0, 0.0}));
    scene.bodies[0].robot = scene.bodies[1].robot = true;
    scene.bodies[1].shows = Shows::kTop;
    scene.bodies.push_back(box("box", 0.12, 0.12, 0.08, {-0.04, 0.0, 0.3}));
    return scene;
  };
  scenario.drive = [](Scene&, int, std::mt19937&) {};
  const Score score = runAll(scenario);
  EXPECT_EQ(score.obstacles_as_robots, 0);
  EXPECT_GT(score.obstacles_right, 150);
}

}  // namespace
}  // namespace omnifleet::sim
