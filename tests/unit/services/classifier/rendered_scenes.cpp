// Robots and their speeds in each scenario.

#include <cmath>

#include "tests/unit/services/classifier/rendered_scenario.h"

namespace omnifleet::rendered {
namespace {

std::string robot(const std::string& name, const std::string& pose, const std::string& speeds) {
  return "  " + name + ": {initial_pose: [" + pose + "], speeds: [" + speeds + "]}\n";
}

}  // namespace

std::vector<Scenario> scenarios() {
  const std::string on = "0, 0.2, 0.2", wait = "0, 0, 0";
  const auto wedge = [](const std::string& first, const std::string& second, const std::string& third) {
    return robot("r1", "-1.2, 0, 0", first) + robot("r2", "-1.8, 0.5, 0", second) +
           robot("r3", "-1.8, -0.5, 0", third);
  };
  const std::string stop = "0, 0.2, 0.2, 4, 0, 0, 8, 0.2, 0.2";
  return {
      {"straight", wedge(on, on, on), {}, "", 0.0},
      {"turning",
       robot("r1", "0, -0.6, 0", "0, 0.16, 0.24") + robot("r2", "-1.0, 0.7, 1.0", "0, -0.08, 0.08") +
           robot("r3", "1.2, 0.8, -2.0", "0, 0.22, 0.14"),
       {},
       "",
       0.0},
      {"stopping", wedge(stop, stop, stop), {}, "", 0.0},
      {"one_stopped", wedge(on, "0, 0.2, 0.2, 4, 0, 0", on), {}, "", 0.0},
      {"standing_since_start",
       robot("r1", "-1.4, -0.5, 0", on) + robot("r2", "0.2, 0.2, 0.5", wait) +
           robot("r3", "1.4, 0.9, 3.1", on),
       {},
       "",
       0.0},
      {"pushed",
       robot("r1", "-1.4, 0, 0", "0, 0, 0, 3, 0.2, 0.2, 9, 0, 0") + robot("r2", "-0.8, 0.9, 0", on) +
           robot("r3", "0.5, -0.9, 1.5", wait),
       {},
       "r1",
       0.0},
      {"silent_unlisted",
       robot("r1", "-0.7, -0.9, 0.3", on) + robot("r2", "1.3, -1.0, 2.0", wait) +
           robot("r3", "0.9, 0.9, -2.6", "0, 0.1, 0.14") + robot("x1", "-1.3, 0.8, -0.2", "0, 0.25, 0.22"),
       {"x1"},
       "",
       1.5},
  };
}

std::vector<Scenario> moreScenarios() {
  const std::string on = "0, 0.2, 0.2", wait = "0, 0, 0";
  const std::string hops =
      "0, 0.2, 0.2, 1.5, 0, 0, 3, 0.2, 0.2, 4.5, 0, 0, 6, 0.2, 0.2, 7.5, 0, 0, 9, 0.2, 0.2, 10.5, 0, 0";
  // The robot that r1 watches passes behind a box in front of r1.
  const auto watched = [&](const std::string& passing, const std::string& speeds) {
    return robot("r1", "-0.2, -1.1, 1.6", wait) + robot("r2", "1.4, -1.2, 2.2", "0, 0.06, 0.05") +
           robot(passing, "-1.5, 0.45, 0", speeds);
  };
  const Pose2 screen{-0.2, -0.45, 0.5 * M_PI};
  return {
      {"turning_in_place",
       robot("r1", "-0.9, -0.4, 0", "0, -0.1, 0.1") +
           robot("r2", "0.5, 0.6, 1.0", "0, 0.08, -0.08, 6, 0.2, 0.2") +
           robot("r3", "0.6, -0.8, 2.4", "0, 0.15, 0.15, 5, -0.1, 0.1"),
       {},
       "",
       0.0},
      {"stop_and_go",
       robot("r1", "-1.7, -0.6, 0", hops) + robot("r2", "-0.3, 0.7, -0.4", hops) +
           robot("r3", "1.6, -1.1, 2.6",
                 "0, 0, 0, 1, 0.16, 0.2, 2.5, 0, 0, 4, 0.2, 0.16, 7, 0, 0, 8.5, 0.2, 0.2"),
       {},
       "",
       0.0},
      {"long_stop",
       robot("r1", "-1.6, -0.6, 0", "0, 0.12, 0.12") +
           robot("r2", "-0.6, 0.6, -0.3", "0, 0.2, 0.2, 2, 0, 0, 16, 0.2, 0.2") +
           robot("r3", "1.5, 0.95, 3.1", "0, 0.1, 0.1"),
       {},
       "",
       0.0,
       20.0},
      {"two_unlisted",
       robot("r1", "-0.9, -0.9, 0.6", "0, 0.12, 0.12") + robot("r2", "1.5, 0.1, 2.8", wait) +
           robot("x1", "-1.3, 0.9, -0.1", "0, 0.2, 0.2") + robot("x2", "1.3, -0.9, 2.9", "0, 0.18, 0.22"),
       {"x1", "x2"},
       "",
       1.5},
      {"hidden_robot", watched("r3", "0, 0.2, 0.2"), {}, "", 0.0, 14.0, {screen}},
      {"hidden_unlisted", watched("x1", "0, 0.2, 0.2"), {"x1"}, "", 1.5, 14.0, {screen}},
  };
}

}  // namespace omnifleet::rendered
