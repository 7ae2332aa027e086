// Wrong wheel motion and kidnapped robots, compared with the truth of the simulator: the objects around the
// robot give its motion.

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include <functional>
#include <iostream>
#include <set>
#include <vector>

#include "tests/unit/services/classifier/scenario.h"

namespace omnifleet::sim {
namespace {

using classifier::Classifier;

constexpr unsigned kFirst = 1000, kSeeds = 20;
constexpr double kSpeed_mps = 0.2;
constexpr double kGate = 30.0;  // χ² (3 dof, 1e-6)
constexpr double kWheelSeparation_m = 0.3;

struct Disturbance {
  std::function<void(Motion&, int frame)> garble = [](Motion&, int) {};
  std::function<void(Scene&, int frame)> kidnap = [](Scene&, int) {};
};

struct Outcome {
  int wrong = 0, unknown = 0, changed = 0;
  double worst_m = 0.0, worst_rad = 0.0;
};

void setWheels(Motion& motion, double factor) {
  const Pose2 given = motion.previous_from_current;
  motion.previous_from_current = {factor * given.x_m, factor * given.y_m,
                                  wrapAngle(factor * given.theta_rad)};
  motion.left_m = factor * (given.x_m - 0.5 * kWheelSeparation_m * given.theta_rad);
  motion.right_m = factor * (given.x_m + 0.5 * kWheelSeparation_m * given.theta_rad);
}

/// The first robot of a mixed scene drives among objects and other robots.
Outcome drive(unsigned seed, const Disturbance& disturbance, int frames = 50,
              const std::function<Scene(std::mt19937&)>& make = mixedScene) {
  std::mt19937 rng(seed);
  Scene scene = make(rng), before;
  std::map<std::string, RobotBody> bodies;
  for (const Body& body : scene.bodies) {
    if (!body.robot) continue;
    bodies[body.name].radius_m = 0.15;
    bodies[body.name].height_m = body.height_m;
  }
  Classifier classifier({}, scene.bodies[0].name, bodies);
  std::vector<PoseEstimate> poses;
  Outcome outcome;
  for (int frame = 0; frame < frames; ++frame) {
    LocalMap map = localMapOf(scene, 0, frame ? &before : nullptr, frame, rng);
    const Pose2 as_given = map.motion.previous_from_current;
    disturbance.garble(map.motion, frame);
    const Objects& objects = classifier.process(map, poses);
    if (frame > 0) {
      const Pose2 truth = before.bodies[0].pose.inverse() * scene.bodies[0].pose;
      const Pose2 off = truth.inverse() * objects.motion.previous_from_current;
      const Pose2 by = as_given.inverse() * objects.motion.previous_from_current;
      outcome.unknown += objects.motion.valid ? 0 : 1;
      outcome.changed += by.translation().norm() > 1e-9 || std::abs(by.theta_rad) > 1e-9 ? 1 : 0;
      if (objects.motion.valid) {
        outcome.worst_m = std::max(outcome.worst_m, off.translation().norm());
        outcome.worst_rad = std::max(outcome.worst_rad, std::abs(off.theta_rad));
        const Eigen::Vector3d v = off.vector();
        outcome.wrong += v.dot(objects.motion.covariance.ldlt().solve(v)) > kGate ? 1 : 0;
      }
    }
    poses = publish(scene, frame, rng);
    before = scene;
    scene.steerClear(kSpeed_mps, rng);
    scene.advance();
    disturbance.kidnap(scene, frame + 1);
  }
  return outcome;
}

/// With fewer than two objects in sight the motion cannot be checked: a few of the `garbled` frames per run
/// may stay wrong.
void expectRight(const Disturbance& disturbance, int garbled) {
  int wrong = 0, unknown = 0;
  for (unsigned seed = kFirst; seed < kFirst + kSeeds; ++seed) {
    const Outcome outcome = drive(seed, disturbance);
    wrong += outcome.wrong;
    unknown += outcome.unknown;
  }
  const double all = garbled * static_cast<double>(kSeeds);
  std::cout << "  wrong " << wrong << ", unknown " << unknown << " of " << all << "\n";
  EXPECT_LE(wrong, 0.08 * all);
  EXPECT_LE(unknown, 0.1 * all);
}

TEST(MotionCheck, ConfirmsCorrectWheels) {
  for (unsigned seed = kFirst; seed < kFirst + kSeeds; ++seed) {
    const Outcome outcome = drive(seed, {});
    EXPECT_EQ(outcome.changed, 0) << "seed " << seed;
    EXPECT_EQ(outcome.unknown, 0) << "seed " << seed;
  }
}

TEST(MotionCheck, CorrectsSlippingWheels) {
  for (const double factor : {5.0, 15.0, -3.0}) {
    SCOPED_TRACE(factor);
    expectRight({[&](Motion& motion, int frame) {
                  if (frame >= 20 && frame < 30) setWheels(motion, factor);
                }},
                10);
  }
}

TEST(MotionCheck, CorrectsWheelsThatSpinInPlace) {
  expectRight({[](Motion& motion, int frame) {
                if (frame >= 20 && frame < 25) motion.previous_from_current.theta_rad += 0.4;
              }},
              5);
}

TEST(MotionCheck, CorrectsSpeedsInWrongUnits) {
  expectRight({[](Motion& motion, int) { setWheels(motion, 100.0); }}, 49);
}

TEST(MotionCheck, CorrectsMotionOfKidnappedRobot) {
  int wrong = 0;
  for (unsigned seed = kFirst; seed < kFirst + kSeeds; ++seed) {
    Disturbance disturbance;
    disturbance.kidnap = [](Scene& scene, int frame) {
      if (frame != 25) return;
      Pose2& pose = scene.bodies[0].pose;
      const Pose2 from = pose;
      // Chooses a place with enough room.
      for (const Pose2& by : {Pose2{0.3, 0.1, 0.5}, Pose2{-0.3, 0.1, -0.5}, Pose2{0.1, -0.3, 0.4}}) {
        pose = from * by;
        double least_m = 1.0;
        for (std::size_t i = 1; i < scene.bodies.size(); ++i)
          least_m = std::min(least_m, gap(scene.bodies[0], scene.bodies[i]));
        if (least_m > 0.05) return;
      }
      pose = from;
    };
    disturbance.garble = [](Motion& motion, int frame) {
      if (frame == 25) motion.previous_from_current = {}, motion.left_m = motion.right_m = 0.0;
    };
    wrong += drive(seed, disturbance).wrong;
  }
  EXPECT_LE(wrong, static_cast<int>(kSeeds) / 4) << "fewer than three objects are in sight";
}

/// r1 drives past `objects_around`; `change` is called before each frame. The wheels are correct and must be
/// confirmed.
void expectConfirmed(double speed_mps, const std::vector<Body>& objects_around,
                     const std::function<void(Scene&, int frame)>& change) {
  for (unsigned seed = kFirst; seed < kFirst + kSeeds; ++seed) {
    std::mt19937 rng(seed);
    Scene scene, before;
    scene.bodies.push_back(round("r1", 0.15, 0.3, {}));
    scene.bodies.back().robot = true;
    scene.bodies.back().v_mps = speed_mps;
    scene.bodies.insert(scene.bodies.end(), objects_around.begin(), objects_around.end());
    Classifier classifier({}, "r1", {{"r1", RobotBody{}}});
    for (int frame = 0; frame < 30; ++frame) {
      change(scene, frame);
      LocalMap map = localMapOf(scene, 0, frame ? &before : nullptr, frame, rng);
      const Pose2 given = map.motion.previous_from_current;
      const Objects& objects = classifier.process(map, {});
      EXPECT_DOUBLE_EQ(objects.motion.previous_from_current.x_m, given.x_m) << seed << " " << frame;
      before = scene;
      scene.advance();
    }
  }
}

/// A wall with the hue of the floor is visible in pieces, which end where the light or an object in front
/// hides them.
TEST(MotionCheck, ConfirmsWheelsWhenAWallPieceChanges) {
  const auto piece = [](double from_m) { return box("wall", 0.2, 0.06, 0.15, {from_m, 0.8, 0.0}); };
  expectConfirmed(0.25, {box("a", 0.3, 0.25, 0.23, {1.2, -0.8, 0.4}), piece(1.0)},
                  [&](Scene& scene, int frame) { scene.bodies.back() = piece(frame < 20 ? 1.0 : 1.1); });
}

/// Of two objects that look nearly like the floor, one shifts by 3 cm and the other by 16 cm between two
/// frames: as if the robot had moved by 0.3 m and turned by 0.3 rad.
TEST(MotionCheck, ConfirmsWheelsWhenTwoOutlinesShift) {
  expectConfirmed(0.1, {round("a", 0.1, 0.15, {1.3, 0.25, 0.0}), round("b", 0.1, 0.15, {1.3, -0.23, 0.0})},
                  [](Scene& scene, int frame) {
                    if (frame == 20) scene.bodies[1].pose.x_m += 0.032, scene.bodies[2].pose.x_m += 0.16;
                  });
}

TEST(MotionCheck, ConfirmsWheelsInAConvoy) {
  // Two robots at the same speed and no other object: relative to them the robot stands still.
  const auto convoy = [](std::mt19937&) {
    Scene scene;
    for (int i = 0; i < 3; ++i) {
      Body body = round("r" + std::to_string(i + 1), 0.15, 0.3, {0.0, 0.7 * (i == 2 ? -1 : i), 0.0});
      body.robot = true;
      body.v_mps = 0.5;
      scene.bodies.push_back(body);
    }
    return scene;
  };
  std::mt19937 rng(3);
  Scene scene = convoy(rng), before;
  std::map<std::string, RobotBody> bodies;
  for (const Body& body : scene.bodies) bodies[body.name].radius_m = 0.15, bodies[body.name].height_m = 0.3;
  Classifier classifier({}, "r1", bodies);
  for (int frame = 0; frame < 30; ++frame) {
    LocalMap map = localMapOf(scene, 0, frame ? &before : nullptr, frame, rng);
    const Pose2 given = map.motion.previous_from_current;
    const Objects& objects = classifier.process(map, {});
    EXPECT_EQ(objects.motion.valid, map.motion.valid) << frame;
    EXPECT_DOUBLE_EQ(objects.motion.previous_from_current.x_m, given.x_m) << frame;
    before = scene;
    scene.advance();
  }
}

TEST(MotionCheck, RemovesHeightsComputedFromRejectedWheels) {
  std::mt19937 rng(7);
  Scene scene = mixedScene(rng), before;
  std::map<std::string, RobotBody> bodies;
  for (const Body& body : scene.bodies) {
    if (body.robot) bodies[body.name].radius_m = 0.15, bodies[body.name].height_m = 0.3;
  }
  Classifier classifier({}, "r1", bodies);
  double heights[2] = {0.0, 0.0};
  for (int frame = 0; frame < 30; ++frame) {
    LocalMap map = localMapOf(scene, 0, frame ? &before : nullptr, frame, rng);
    if (frame == 29) {
      setWheels(map.motion, 30.0);
      for (ObjectObservation& object : map.objects) object.height_m = 0.01, object.height_sigma_m = 1e-4;
    }
    const Objects& objects = classifier.process(map, {});
    double& sum = heights[frame == 29 ? 1 : 0];
    sum = 0.0;
    for (const Track& track : objects.tracks) sum += track.height_m;
    before = scene;
    scene.steerClear(kSpeed_mps, rng);
    scene.advance();
  }
  EXPECT_NEAR(heights[1], heights[0], 0.2 * heights[0]);
}

}  // namespace
}  // namespace omnifleet::sim
