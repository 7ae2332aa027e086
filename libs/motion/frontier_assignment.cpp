#include "motion/frontier_assignment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace omnifleet::motion {
namespace {

constexpr double kWithoutS = 1e6;  // cost of a robot without a frontier
constexpr double kLessS = 1e-9;    // a smaller gain does not change the assignment
constexpr int kMostRounds = 50;

class Assignment {
 public:
  Assignment(const std::vector<std::vector<double>>& times_s, const std::vector<Eigen::Vector2d>& places_m,
             double near_s, double near_m)
      : times_s_(times_s),
        places_m_(places_m),
        near_s_(near_s),
        near_m_(near_m),
        frontier_of_(times_s.size(), -1),
        taken_(places_m.size(), false) {}

  /// Again and again the nearest pair of a robot and a frontier that are both free.
  void greedy() {
    while (true) {
      double least_s = std::numeric_limits<double>::infinity();
      std::size_t robot = 0, frontier = 0;
      for (std::size_t i = 0; i < times_s_.size(); ++i) {
        for (std::size_t j = 0; j < places_m_.size() && frontier_of_[i] < 0; ++j) {
          if (taken_[j] || !(times_s_[i][j] < least_s)) continue;
          least_s = times_s_[i][j];
          robot = i;
          frontier = j;
        }
      }
      if (!std::isfinite(least_s)) return;
      give(robot, static_cast<int>(frontier));
    }
  }

  /// As many robots as possible get a frontier: a robot without one takes that of another robot, which gets
  /// one in turn (augmenting paths; Kuhn 1955).
  void complete() {
    for (std::size_t i = 0; i < times_s_.size(); ++i) {
      std::vector<bool> tried(places_m_.size(), false);
      if (frontier_of_[i] < 0) augment(i, tried);
    }
  }

  /// Moves a robot to another frontier, or exchanges those of two robots, while that is better.
  void improve() {
    for (int round = 0; round < kMostRounds; ++round) {
      bool better = false;
      for (std::size_t i = 0; i < times_s_.size(); ++i) {
        for (std::size_t j = 0; j < places_m_.size(); ++j) better = tryMove(i, j) || better;
        for (std::size_t k = i + 1; k < times_s_.size(); ++k) better = tryExchange(i, k) || better;
      }
      if (!better) return;
    }
  }

  const std::vector<int>& result() const { return frontier_of_; }

 private:
  void give(std::size_t robot, int frontier) {
    if (frontier_of_[robot] >= 0) taken_[static_cast<std::size_t>(frontier_of_[robot])] = false;
    frontier_of_[robot] = frontier;
    if (frontier >= 0) taken_[static_cast<std::size_t>(frontier)] = true;
  }

  bool augment(std::size_t robot, std::vector<bool>& tried) {
    for (std::size_t j = 0; j < places_m_.size(); ++j) {
      if (tried[j] || !std::isfinite(times_s_[robot][j])) continue;
      tried[j] = true;
      const auto owner = std::find(frontier_of_.begin(), frontier_of_.end(), static_cast<int>(j));
      if (owner != frontier_of_.end() &&
          !augment(static_cast<std::size_t>(owner - frontier_of_.begin()), tried))
        continue;
      give(robot, static_cast<int>(j));
      return true;
    }
    return false;
  }

  /// Cheaper; or as cheap, and earlier robots have earlier frontiers. −1, without a frontier, is the last.
  bool isBetter(double before_s, const std::vector<int>& before) const {
    const double now_s = cost();
    const auto earlier = [](int a, int b) { return static_cast<unsigned>(a) < static_cast<unsigned>(b); };
    return now_s < before_s - kLessS ||
           (now_s < before_s + kLessS &&
            std::lexicographical_compare(frontier_of_.begin(), frontier_of_.end(), before.begin(),
                                         before.end(), earlier));
  }

  double cost() const {
    double sum_s = 0.0;
    for (std::size_t i = 0; i < frontier_of_.size(); ++i) {
      if (frontier_of_[i] < 0) {
        sum_s += kWithoutS;
        continue;
      }
      const auto mine = static_cast<std::size_t>(frontier_of_[i]);
      sum_s += times_s_[i][mine];
      for (std::size_t k = 0; k < i; ++k) {
        if (frontier_of_[k] < 0) continue;
        const double apart_m =
            (places_m_[mine] - places_m_[static_cast<std::size_t>(frontier_of_[k])]).norm();
        sum_s += near_s_ * std::max(0.0, 1.0 - apart_m / near_m_);
      }
    }
    return sum_s;
  }

  bool tryMove(std::size_t robot, std::size_t frontier) {
    if (taken_[frontier] || !std::isfinite(times_s_[robot][frontier])) return false;
    const double before_s = cost();
    const std::vector<int> before = frontier_of_;
    give(robot, static_cast<int>(frontier));
    if (isBetter(before_s, before)) return true;
    give(robot, before[robot]);
    return false;
  }

  bool tryExchange(std::size_t a, std::size_t b) {
    const auto possible = [&](std::size_t robot, int frontier) {
      return frontier < 0 || std::isfinite(times_s_[robot][static_cast<std::size_t>(frontier)]);
    };
    if (!possible(a, frontier_of_[b]) || !possible(b, frontier_of_[a])) return false;
    const double before_s = cost();
    const std::vector<int> before = frontier_of_;
    std::swap(frontier_of_[a], frontier_of_[b]);
    if (isBetter(before_s, before)) return true;
    std::swap(frontier_of_[a], frontier_of_[b]);
    return false;
  }

  const std::vector<std::vector<double>>& times_s_;
  const std::vector<Eigen::Vector2d>& places_m_;
  double near_s_, near_m_;
  std::vector<int> frontier_of_;
  std::vector<bool> taken_;
};

}  // namespace

std::vector<int> assignFrontiers(const std::vector<std::vector<double>>& times_s,
                                 const std::vector<Eigen::Vector2d>& places_m, double near_s, double near_m) {
  Assignment assignment(times_s, places_m, near_s, near_m);
  assignment.greedy();
  assignment.complete();
  assignment.improve();
  return assignment.result();
}

}  // namespace omnifleet::motion
