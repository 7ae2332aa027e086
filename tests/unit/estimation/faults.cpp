// Prints how the estimator detects wheel faults and kidnapping: estimation_faults FIRST LAST [PART OF A
// CASE]. For tuning (0–99) and for reports (1000–1099).

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "fault.h"

using namespace omnifleet::estimation::testing;

int main(int argc, char** argv) {
  const auto first = static_cast<std::uint32_t>(argc > 1 ? std::atoi(argv[1]) : 0);
  const auto last = static_cast<std::uint32_t>(argc > 2 ? std::atoi(argv[2]) : 9);
  struct Case {
    const char* name;
    Fault fault;
  };
  std::vector<Case> cases;
  const auto add = [&](const char* name, auto change) {
    Fault fault;
    change(fault);
    cases.push_back({name, fault});
  };
  add("no fault", [](Fault&) {});
  add("dark 3 s", [](Fault& t) { t.dark_frames = 15; });
  add("dark, kidnapped 10 cm",
      [](Fault& t) { t.dark_frames = 15, t.kidnapped_m = 0.1, t.kidnapped_rad = 0.1; });
  add("dark, kidnapped 20 cm",
      [](Fault& t) { t.dark_frames = 15, t.kidnapped_m = 0.2, t.kidnapped_rad = 0.0; });
  add("dark, kidnapped 20 cm 10 deg",
      [](Fault& t) { t.dark_frames = 15, t.kidnapped_m = 0.2, t.kidnapped_rad = 0.17; });
  add("dark, kidnapped 60 cm 45 deg",
      [](Fault& t) { t.dark_frames = 15, t.kidnapped_m = 0.6, t.kidnapped_rad = 0.8; });
  add("light, kidnapped 20 cm 10 deg", [](Fault& t) { t.kidnapped_m = 0.2, t.kidnapped_rad = 0.17; });
  add("light, kidnapped 60 cm 45 deg", [](Fault& t) { t.kidnapped_m = 0.6, t.kidnapped_rad = 0.8; });
  add("wheel spins 1 s", [](Fault& t) { t.spin_frames = 5; });
  add("wheel spins 3 s", [](Fault& t) { t.spin_frames = 15; });
  add("one slips 6 cm", [](Fault& t) { t.slip_m = 0.06; });
  add("one slips 12 cm", [](Fault& t) { t.slip_m = 0.12; });
  add("one slips 20 cm", [](Fault& t) { t.slip_m = 0.20; });
  add("all slip 6 cm", [](Fault& t) { t.slip_m = 0.06, t.all_robots = true; });
  add("all slip 12 cm", [](Fault& t) { t.slip_m = 0.12, t.all_robots = true; });
  add("all slip 20 cm", [](Fault& t) { t.slip_m = 0.20, t.all_robots = true; });
  const auto kidnappedFar = [](Fault& t) {
    t.dark_frames = 15, t.kidnapped_m = 1.5, t.kidnapped_rad = 2.0, t.simulation.frames = 120,
    t.new_tracks = true;
  };
  add("three, one kidnapped far", kidnappedFar);
  add("two, one kidnapped far", [&](Fault& t) { kidnappedFar(t), t.simulation.robots = 2; });
  add("alone, kidnapped far", [&](Fault& t) { kidnappedFar(t), t.simulation.robots = 1; });
  add("alone, 10 obstacles, far", [&](Fault& t) {
    kidnappedFar(t), t.simulation.robots = 1, t.simulation.obstacles = 10, t.simulation.sight_m = 1.5;
  });
  add("alone, sight 1.2, far",
      [&](Fault& t) { kidnappedFar(t), t.simulation.robots = 1, t.simulation.sight_m = 1.2; });
  add("alone, two equal, far", [&](Fault& t) {
    kidnappedFar(t), t.simulation.robots = 1, t.simulation.obstacles = 2, t.simulation.equal_discs = true;
  });
  add("alone, dark, not kidnapped",
      [&](Fault& t) { kidnappedFar(t), t.simulation.robots = 1, t.kidnapped_m = 0.0; });
  add("alone, 10 obstacles, not kidn.", [&](Fault& t) {
    kidnappedFar(t), t.simulation.robots = 1, t.kidnapped_m = 0.0;
    t.simulation.obstacles = 10, t.simulation.sight_m = 1.5;
  });
  add("alone, sight 1.2, not kidn.", [&](Fault& t) {
    kidnappedFar(t), t.simulation.robots = 1, t.kidnapped_m = 0.0, t.simulation.sight_m = 1.2;
  });
  const auto together = [](Fault& t) { t.all_robots = true, t.gap_frames = 15, t.new_tracks = true; };
  add("gap", [&](Fault& t) { together(t); });
  add("gap, all kidnapped 20 cm", [&](Fault& t) { together(t), t.kidnapped_m = 0.2; });
  add("gap, all kidnapped 60 cm", [&](Fault& t) { together(t), t.kidnapped_m = 0.6; });
  add("gap, all kidnapped 60 cm 45 deg",
      [&](Fault& t) { together(t), t.kidnapped_m = 0.6, t.kidnapped_rad = 0.8; });
  add("gap, no wheels, 20 cm", [&](Fault& t) { together(t), t.kidnapped_m = 0.2, t.wheels_in_gap = false; });
  add("gap, no wheels, 60 cm", [&](Fault& t) { together(t), t.kidnapped_m = 0.6, t.wheels_in_gap = false; });
  add("all dark, kidnapped 60 cm",
      [](Fault& t) { t.all_robots = true, t.dark_frames = 15, t.kidnapped_m = 0.6; });
  const auto misassigned = [&](const char* name, WheelAssignment how) {
    add(name, [&](Fault& t) { t.at_frame = 0, t.wheels = how; });
  };
  misassigned("wheels reversed", WheelAssignment::kReversed);
  misassigned("wheels swapped", WheelAssignment::kSwapped);
  misassigned("wheels reversed and swapped", WheelAssignment::kReversedAndSwapped);
  misassigned("left wheel reversed", WheelAssignment::kLeftReversed);
  misassigned("right wheel reversed", WheelAssignment::kRightReversed);
  std::printf("%-31s %9s %6s %6s %6s %8s %8s %8s %8s %8s %7s %8s %6s\n", "case", "detected", "late s",
              "kidn.", "false", "mean cm", "worst", "worst av", "end cm", "NEES", "valid", "false lm",
              "wheels");
  for (const Case& c : cases) {
    if (argc > 3 && std::string(c.name).find(argv[3]) == std::string::npos) continue;
    FaultResult sum;
    double worst = 0.0;
    for (std::uint32_t seed = first; seed <= last; ++seed) {
      const FaultResult r = run(c.fault, {}, seed);
      if (std::getenv("EACH") != nullptr)
        std::printf(
            "  %u: detected %d of %d late %.1f kidnapped %d false %d mean %.2f worst %.2f end %.2f nees %.2f "
            "valid "
            "%.2f lm %d\n",
            seed, r.detected, r.faulty, r.delay_s, r.kidnapping_frames, r.false_reports, 100 * r.mean_m,
            100 * r.worst_m, 100 * r.end_m, r.nees, r.valid, r.false_landmarks);
      sum.detected += r.detected, sum.faulty += r.faulty, sum.kidnapping_frames += r.kidnapping_frames;
      sum.false_reports += r.false_reports, sum.delay_s += r.delay_s, sum.mean_m += r.mean_m;
      sum.wheel_reports += r.wheel_reports;
      sum.worst_m += r.worst_m, sum.end_m += r.end_m, sum.nees += r.nees, sum.valid += r.valid;
      sum.false_landmarks += r.false_landmarks;
      worst = std::max(worst, r.worst_m);
    }
    const double n = last - first + 1;
    std::printf("%-31s %4d/%4d %6.2f %6d %6d %8.3f %8.2f %8.2f %8.2f %8.2f %7.3f %8d %6d\n", c.name,
                sum.detected, sum.faulty, sum.delay_s / n, sum.kidnapping_frames, sum.false_reports,
                100 * sum.mean_m / n, 100 * worst, 100 * sum.worst_m / n, 100 * sum.end_m / n, sum.nees / n,
                sum.valid / n, sum.false_landmarks, sum.wheel_reports);
    std::fflush(stdout);
  }
}
