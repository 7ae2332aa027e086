// Classification of robots and obstacles in an analytic arena. Seeds 0–99 are for tuning. The tests use seeds
// from 1000 on; OMNIFLEET_SEEDS=FIRST:LAST selects others.

#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>

#include "tests/unit/services/classifier/scenario.h"

namespace omnifleet::sim {
namespace {

using classifier::Classifier;

std::pair<unsigned, unsigned> seeds() {
  unsigned first = 1000, last = 1003;
  if (const char* wanted = std::getenv("OMNIFLEET_SEEDS")) std::sscanf(wanted, "%u:%u", &first, &last);
  return {first, last};
}

Score runAll(const Scenario& scenario, const Classifier::Options& options = {}) {
  Score total;
  const auto [first, last] = seeds();
  for (unsigned seed = first; seed <= last; ++seed) {
    const Score score = run(scenario, seed, options);
    if (std::getenv("OMNIFLEET_SEEDS") && (score.f1() < 0.98 || score.switches > 0)) {
      std::cout << "  seed " << seed << ": F1 " << score.f1() << " missed " << score.robots_missed
                << " false " << score.obstacles_as_robots << " switches " << score.switches << "\n";
    }
    total += score;
  }
  std::cout << scenario.name << ": F1 " << total.f1() << ", robots " << total.robots_right << " right "
            << total.robots_missed << " missed, obstacles " << total.obstacles_right << " right "
            << total.obstacles_as_robots << " false, undecided " << total.undecided << ", switches "
            << total.switches << ", relabels " << total.relabels << ", centre " << 100.0 * total.meanError()
            << " cm, " << 1e3 * total.total_ms / static_cast<double>(total.processed) << " us mean, slowest "
            << total.slowest_ms << " ms\n";
  return total;
}

void roam(Scene& scene, int, std::mt19937& rng) {
  scene.steerClear(0.3, rng);
}

/// docs/methods/evaluation.md requires F1 ≥ 0.98. Ids change only where two objects that were always one blob
/// separate, or one appears from behind another: at most once in three robots' runs.
void expectRight(const Score& score) {
  const auto [first, last] = seeds();
  const int runs = 3 * static_cast<int>(last - first + 1);
  EXPECT_GE(score.f1(), 0.98);
  EXPECT_LE(score.switches, runs / 3);
  EXPECT_LT(score.meanError(),
            0.03);  // m, a fifth of a robot's radius: no later stage confuses two robots
}

TEST(Classifier, ClassifiesRoamingRobots) {
  expectRight(runAll({"roaming", 80, mixedScene, roam}));
}

TEST(Classifier, ClassifiesStandingRobots) {
  expectRight(runAll({"standing", 40, mixedScene}));
}

TEST(Classifier, ClassifiesTurningRobots) {
  expectRight(runAll({"turning", 60, mixedScene, [](Scene& scene, int, std::mt19937&) {
                        for (int i = 0; i < 3; ++i)
                          scene.bodies[static_cast<std::size_t>(i)].w_radps = 0.8 - 0.6 * i;
                      }}));
}

/// Three robots side by side at the same speed. For each one the others stand still while everything else
/// passes.
Scene abreast(std::mt19937& rng) {
  Scene scene = mixedScene(rng);
  for (std::size_t i = 0; i < 3; ++i) {
    scene.bodies[i].pose = {-1.5, 0.7 * (static_cast<double>(i) - 1.0), 0.0};
    scene.bodies[i].v_mps = 0.3;
  }
  for (std::size_t i = 3; i < scene.bodies.size(); ++i) {
    const double lane = i % 2 == 0 ? 0.35 : -0.35;
    scene.bodies[i].pose.x_m = -0.9 + 0.55 * static_cast<double>(i - 3);
    scene.bodies[i].pose.y_m = i < 6 ? lane * 3.2 : lane * 3.8;
  }
  return scene;
}

TEST(Classifier, ClassifiesRobotsThatDriveInParallel) {
  expectRight(runAll({"parallel", 60, abreast}));
}

TEST(Classifier, ClassifiesRobotThatStops) {
  expectRight(runAll({"one stops", 80, abreast, [](Scene& scene, int frame, std::mt19937&) {
                        if (frame == 25) scene.bodies[1].v_mps = 0.0;
                      }}));
}

/// r2 publishes nothing and stands still: only its shape is evidence. Then it moves.
TEST(Classifier, ClassifiesSilentRobot) {
  Scenario scenario{"silent", 80, [](std::mt19937& rng) {
                      Scene scene = mixedScene(rng);
                      scene.bodies[1].publishes = false;
                      return scene;
                    }};
  scenario.drive = [](Scene& scene, int frame, std::mt19937& rng) {
    if (frame > 30) scene.steerClear(0.3, rng);
  };
  const Score score = runAll(scenario);
  EXPECT_GE(score.f1(), 0.93);  // an obstacle of a robot's shape looks like a silent standing robot
}

/// No robot publishes, and no robot has the body of the fleet file: only the motion is evidence.
TEST(Classifier, ClassifiesUnknownBodiesByMotion) {
  Scenario scenario{"unknown_bodies", 80,
                    [](std::mt19937& rng) {
                      Scene scene = mixedScene(rng);
                      for (std::size_t i = 0; i < 3; ++i) {
                        scene.bodies[i].outline = {{-0.2, -0.1}, {0.2, -0.1}, {0.2, 0.1}, {-0.2, 0.1}};
                        scene.bodies[i].publishes = false;
                      }
                      return scene;
                    },
                    roam};
  scenario.warm_up = 25;  // frames; the robots must move first
  EXPECT_GE(runAll(scenario).f1(), 0.85);
}

/// A robot that is not listed in the fleet crosses between the others and stops.
Scenario crossing(double speed_mps, int stops_at = 100) {
  Scenario scenario{"an unlisted robot at " + std::to_string(speed_mps) + " m/s", 180, [](std::mt19937& rng) {
                      Scene scene = apartScene(rng);
                      Body unlisted = round("unlisted", 0.15, 0.3, {-0.4, -0.75, 0.0});
                      unlisted.robot = true;
                      unlisted.publishes = unlisted.declared = false;
                      scene.bodies.insert(scene.bodies.begin() + 3, unlisted);
                      return scene;
                    }};
  scenario.drive = [=](Scene& scene, int frame, std::mt19937&) {
    for (std::size_t i = 0; i < 3; ++i) {
      scene.bodies[i].w_radps = 0.6;
      scene.bodies[i].v_mps = 0.12;
    }
    scene.bodies[3].v_mps = frame < stops_at ? speed_mps : 0.0;
  };
  return scenario;
}

TEST(Classifier, ClassifiesSlowUnlistedRobot) {
  // At 6 cm/s changes of the outlines hide the motion for a while.
  for (const auto& [speed_mps, least_f1] : {std::pair{0.06, 0.95}, std::pair{0.1, 0.98}}) {
    Scenario scenario = crossing(speed_mps);
    scenario.warm_up =
        static_cast<int>(2.0 / speed_mps);  // frames in which it moves 20 cm; the motion is the evidence
    EXPECT_GE(runAll(scenario).f1(), least_f1);
  }
}

TEST(Classifier, KeepsUnlistedRobotARobotWhenItStops) {
  // It has the shape of a robot, so one second of motion is enough. Some robots see less of its motion.
  for (const auto& [stops_at, most_missed] : {std::pair{100, 0}, std::pair{34, 150}}) {
    Scenario scenario = crossing(0.2, stops_at);
    scenario.warm_up = stops_at + 20;  // it has stood still for two seconds
    const Score score = runAll(scenario);
    EXPECT_LE(score.robots_missed, most_missed) << stops_at;
    EXPECT_EQ(score.obstacles_as_robots, 0) << stops_at;
  }
}

TEST(Classifier, KeepsIdsThroughTwoSecondsOfLoss) {
  Scenario scenario{"lost for 2 s", 60, apartScene};
  scenario.drive = [](Scene& scene, int frame, std::mt19937&) {
    for (std::size_t i = 0; i < 3; ++i) {
      scene.bodies[i].w_radps = 0.6;
      scene.bodies[i].v_mps = frame < 35 ? 0.12 : 0.0;
    }
  };
  scenario.lost = [](std::size_t body, int frame) { return frame >= 20 && frame < 40 && body != 0; };
  const Score score = runAll(scenario);
  EXPECT_EQ(score.switches, 0);
  EXPECT_EQ(score.robots_missed, 0) << "a robot that reappears is still a robot";
  EXPECT_EQ(score.obstacles_as_robots, 0);
}

/// A robot that publishes its pose keeps its id, however far and long it moves unseen.
TEST(Classifier, KeepsIdsOfRobotsThatPublish) {
  Scenario scenario{"robots lost for 7 s", 110, apartScene};
  scenario.drive = [](Scene& scene, int frame, std::mt19937&) {
    for (std::size_t i = 0; i < 3; ++i) {
      scene.bodies[i].v_mps = frame >= 25 && frame < 85 ? 0.15 : 0.0;
      scene.bodies[i].w_radps = 0.1;
    }
  };
  scenario.lost = [](std::size_t body, int frame) { return frame >= 20 && frame < 90 && body < 3; };
  const Score score = runAll(scenario);
  EXPECT_EQ(score.switches, 0);
  EXPECT_GT(score.robots_right, 0);
}

/// A stationary object keeps its id, however long it is not visible.
TEST(Classifier, KeepsIdsOfObstaclesThroughTenSecondsOfLoss) {
  Scenario scenario{"obstacles lost for 10 s", 140, apartScene};
  scenario.drive = [](Scene& scene, int, std::mt19937&) {
    for (std::size_t i = 0; i < 3; ++i) scene.bodies[i].w_radps = 0.6;
  };
  scenario.lost = [](std::size_t body, int frame) { return frame >= 25 && frame < 125 && body >= 3; };
  const Score score = runAll(scenario);
  EXPECT_EQ(score.switches, 0);
  EXPECT_GT(score.obstacles_right, 0);
}

/// An object with a robot's shape is an obstacle if every robot may be at its published place. r2 is not
/// visible, but neither is the floor at its place.
TEST(Classifier, RejectsLookAlikeOfAHiddenRobot) {
  Scenario scenario{"one hidden", 40, [](std::mt19937& rng) {
                      Scene scene = apartScene(rng);
                      scene.bodies[3] = round("o4", 0.15, 0.3, scene.bodies[1].pose * Pose2{0.7, 0.0, 0.0});
                      return scene;
                    }};
  scenario.lost = [](std::size_t body, int) { return body == 1; };
  scenario.warm_up = 20;  // no pose is published at first
  const Score score = runAll(scenario);
  EXPECT_EQ(score.obstacles_as_robots, 0);
  EXPECT_EQ(score.undecided, 0);
  EXPECT_GT(score.obstacles_right, 0);
}

/// One robot pushes a box. The box moves but is an obstacle.
TEST(Classifier, ReportsPushedBoxAsMovingObstacle) {
  Scenario scenario{"pushed", 60, [](std::mt19937& rng) {
                      Scene scene = apartScene(rng);
                      scene.bodies[0].pose = {-0.8, 0.0, 0.0};
                      scene.bodies[3].pose = {-0.8 + 0.15 + 0.101, 0.0, 0.0};
                      scene.bodies[2].pose = {0.3, 1.0, 0.0};
                      return scene;
                    }};
  scenario.drive = [](Scene& scene, int frame, std::mt19937&) {
    scene.bodies[0].v_mps = scene.bodies[3].v_mps = frame > 20 ? 0.25 : 0.0;
  };
  double sum = 0.0;
  int count = 0;
  scenario.watch = [&](const Scene& scene, const Objects& objects, int frame) {
    if (objects.robot != "r3" || frame < 40) return;  // r3 sees the box in front of its pusher
    const Pose2 map_from_base = scene.bodies[2].pose;
    for (const Track& track : objects.tracks) {
      const double apart_m = (map_from_base * track.position_m - scene.bodies[3].pose.translation()).norm();
      if (!track.visible || apart_m > 0.15) continue;
      sum += track.velocity_mps.norm();
      ++count;
    }
  };
  const Score score = runAll(scenario);
  EXPECT_LT(score.obstacles_as_robots, score.obstacles_right / 100);  // while it separates from its pusher
  ASSERT_GT(count, 50);
  EXPECT_NEAR(sum / count, 0.25,
              0.08);  // estimated from part of the outline, in one blob with the pusher
}

}  // namespace
}  // namespace omnifleet::sim
