// Prints how the estimator fares when wheels or people deceive it: estimation_troubles FIRST LAST [PART OF A
// CASE]. For tuning (0–99) and for reports (1000–1099).

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "trouble.h"

using namespace omnifleet::estimation::testing;

int main(int argc, char** argv) {
  const auto first = static_cast<std::uint32_t>(argc > 1 ? std::atoi(argv[1]) : 0);
  const auto last = static_cast<std::uint32_t>(argc > 2 ? std::atoi(argv[2]) : 9);
  struct Case {
    const char* name;
    Trouble trouble;
  };
  std::vector<Case> cases;
  const auto add = [&](const char* name, auto change) {
    Trouble trouble;
    change(trouble);
    cases.push_back({name, trouble});
  };
  add("nothing", [](Trouble&) {});
  add("dark 3 s", [](Trouble& t) { t.dark_frames = 15; });
  add("dark, moved 10 cm", [](Trouble& t) { t.dark_frames = 15, t.moved_m = 0.1, t.turned_rad = 0.1; });
  add("dark, moved 20 cm", [](Trouble& t) { t.dark_frames = 15, t.moved_m = 0.2, t.turned_rad = 0.0; });
  add("dark, moved 20 cm 10 deg",
      [](Trouble& t) { t.dark_frames = 15, t.moved_m = 0.2, t.turned_rad = 0.17; });
  add("dark, moved 60 cm 45 deg",
      [](Trouble& t) { t.dark_frames = 15, t.moved_m = 0.6, t.turned_rad = 0.8; });
  add("seeing, moved 20 cm 10 deg", [](Trouble& t) { t.moved_m = 0.2, t.turned_rad = 0.17; });
  add("seeing, moved 60 cm 45 deg", [](Trouble& t) { t.moved_m = 0.6, t.turned_rad = 0.8; });
  add("wheel spins 1 s", [](Trouble& t) { t.spin_frames = 5; });
  add("wheel spins 3 s", [](Trouble& t) { t.spin_frames = 15; });
  add("one slips 6 cm", [](Trouble& t) { t.slip_m = 0.06; });
  add("one slips 12 cm", [](Trouble& t) { t.slip_m = 0.12; });
  add("one slips 20 cm", [](Trouble& t) { t.slip_m = 0.20; });
  add("all slip 6 cm", [](Trouble& t) { t.slip_m = 0.06, t.all = true; });
  add("all slip 12 cm", [](Trouble& t) { t.slip_m = 0.12, t.all = true; });
  add("all slip 20 cm", [](Trouble& t) { t.slip_m = 0.20, t.all = true; });
  const auto carriedFar = [](Trouble& t) {
    t.dark_frames = 15, t.moved_m = 1.5, t.turned_rad = 2.0, t.simulation.frames = 120, t.new_tracks = true;
  };
  add("three, one carried far", carriedFar);
  add("two, one carried far", [&](Trouble& t) { carriedFar(t), t.simulation.robots = 2; });
  add("alone, carried far", [&](Trouble& t) { carriedFar(t), t.simulation.robots = 1; });
  add("alone, 10 things, far", [&](Trouble& t) {
    carriedFar(t), t.simulation.robots = 1, t.simulation.obstacles = 10, t.simulation.sight_m = 1.5;
  });
  add("alone, sight 1.2, far",
      [&](Trouble& t) { carriedFar(t), t.simulation.robots = 1, t.simulation.sight_m = 1.2; });
  add("alone, two alike, far", [&](Trouble& t) {
    carriedFar(t), t.simulation.robots = 1, t.simulation.obstacles = 2, t.simulation.alike = true;
  });
  add("alone, dark, stays", [&](Trouble& t) { carriedFar(t), t.simulation.robots = 1, t.moved_m = 0.0; });
  add("alone, 10 things, stays", [&](Trouble& t) {
    carriedFar(t), t.simulation.robots = 1, t.moved_m = 0.0;
    t.simulation.obstacles = 10, t.simulation.sight_m = 1.5;
  });
  add("alone, sight 1.2, stays", [&](Trouble& t) {
    carriedFar(t), t.simulation.robots = 1, t.moved_m = 0.0, t.simulation.sight_m = 1.2;
  });
  const auto together = [](Trouble& t) { t.all = true, t.gap_frames = 15, t.new_tracks = true; };
  add("gap", [&](Trouble& t) { together(t); });
  add("gap, all moved 20 cm", [&](Trouble& t) { together(t), t.moved_m = 0.2; });
  add("gap, all moved 60 cm", [&](Trouble& t) { together(t), t.moved_m = 0.6; });
  add("gap, all moved 60 cm 45 deg", [&](Trouble& t) { together(t), t.moved_m = 0.6, t.turned_rad = 0.8; });
  add("gap, no wheels, 20 cm", [&](Trouble& t) { together(t), t.moved_m = 0.2, t.gap_wheels = false; });
  add("gap, no wheels, 60 cm", [&](Trouble& t) { together(t), t.moved_m = 0.6, t.gap_wheels = false; });
  add("all dark, moved 60 cm", [](Trouble& t) { t.all = true, t.dark_frames = 15, t.moved_m = 0.6; });
  const auto wired = [&](const char* name, Wired how) {
    add(name, [&](Trouble& t) { t.at_frame = 0, t.wired = how; });
  };
  wired("wheels reversed", Wired::kReversed);
  wired("wheels swapped", Wired::kSwapped);
  wired("wheels reversed and swapped", Wired::kBoth);
  wired("left wheel reversed", Wired::kLeftReversed);
  wired("right wheel reversed", Wired::kRightReversed);
  std::printf("%-28s %9s %6s %6s %6s %8s %8s %8s %8s %8s %7s %8s %6s\n", "case", "told", "late s", "hand",
              "wrong", "mean cm", "worst", "worst av", "end cm", "NEES", "valid", "false lm", "wired");
  for (const Case& c : cases) {
    if (argc > 3 && std::string(c.name).find(argv[3]) == std::string::npos) continue;
    TroubleResult sum;
    double worst = 0.0;
    for (std::uint32_t seed = first; seed <= last; ++seed) {
      const TroubleResult r = run(c.trouble, {}, seed);
      if (std::getenv("EACH") != nullptr)
        std::printf(
            "  %u: told %d of %d late %.1f hand %d wrong %d mean %.2f worst %.2f end %.2f nees %.2f valid "
            "%.2f lm %d\n",
            seed, r.told, r.troubled, r.late_s, r.by_hand, r.told_wrongly, 100 * r.mean_m, 100 * r.worst_m,
            100 * r.end_m, r.nees, r.valid, r.false_landmarks);
      sum.told += r.told, sum.troubled += r.troubled, sum.by_hand += r.by_hand;
      sum.told_wrongly += r.told_wrongly, sum.late_s += r.late_s, sum.mean_m += r.mean_m;
      sum.by_wheels += r.by_wheels;
      sum.worst_m += r.worst_m, sum.end_m += r.end_m, sum.nees += r.nees, sum.valid += r.valid;
      sum.false_landmarks += r.false_landmarks;
      worst = std::max(worst, r.worst_m);
    }
    const double n = last - first + 1;
    std::printf("%-28s %4d/%4d %6.2f %6d %6d %8.3f %8.2f %8.2f %8.2f %8.2f %7.3f %8d %6d\n", c.name, sum.told,
                sum.troubled, sum.late_s / n, sum.by_hand, sum.told_wrongly, 100 * sum.mean_m / n,
                100 * worst, 100 * sum.worst_m / n, 100 * sum.end_m / n, sum.nees / n, sum.valid / n,
                sum.false_landmarks, sum.by_wheels);
    std::fflush(stdout);
  }
}
