#include "tests/experiments/loops/study.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <random>

#include "evaluation/consistency.h"

namespace omnifleet::loops {
namespace {

constexpr double kRight_m = 0.1, kRight_rad = 3.0 * M_PI / 180.0;
constexpr double kDegrees = 180.0 / M_PI;

estimation::LoopPlace placeOf(const Shot& shot, bool use_signature) {
  estimation::LoopPlace place;
  place.scan = &shot.scan;
  place.base_from_scan = shot.base_from_scan;
  if (!use_signature) return place;
  place.format = &shot.appearance.format;
  place.signature = &shot.appearance.signature;
  return place;
}

Outcome judge(const Pair& pair, const estimation::LoopPlace& from, const estimation::LoopPlace& to,
              estimation::LoopCheck& check) {
  Outcome outcome;
  outcome.pair = pair;
  outcome.compared = true;
  const auto start = std::chrono::steady_clock::now();
  outcome.result = check.check(from, to);
  outcome.check_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  if (!outcome.sameRoom() || outcome.result.candidates == 0) return outcome;
  const Pose2 error = outcome.result.from_to.inverse() * pair.from_to;
  outcome.error_m = error.translation().norm();
  outcome.error_rad = std::abs(error.theta_rad);
  outcome.nees =
      evaluation::normalisedSquare(outcome.result.from_to, outcome.result.covariance, pair.from_to);
  return outcome;
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::lround(q * static_cast<double>(values.size() - 1)))];
}

/// A reason without its numbers, to count reasons.
std::string kindOfReason(const std::string& reason) {
  std::string kind;
  for (const char c : reason)
    if ((c < '0' || c > '9') && c != '.' && c != '-') kind += c;
  return kind;
}

struct Row {
  const char* name;
  PairKind kind;
  double least_m, most_m;
};
constexpr Row kRows[] = {
    {"same room, 0.00-0.25 m", PairKind::kClose, 0.0, 0.25},
    {"same room, 0.25-0.50 m", PairKind::kClose, 0.25, 0.5},
    {"same room, 0.50-0.75 m", PairKind::kClose, 0.5, 0.75},
    {"same room, 0.75-1.00 m", PairKind::kClose, 0.75, 1.0},
    {"same room, all to 1 m", PairKind::kClose, 0.0, 1.0},
    {"same room, beyond 2 m", PairKind::kFar, 0.0, 1e3},
    {"look-alike room", PairKind::kLookalike, 0.0, 1e3},
    {"other room", PairKind::kOtherRoom, 0.0, 1e3},
};

std::string rowOf(const Row& row, const std::vector<Outcome>& outcomes) {
  int pairs = 0, closed = 0, wrong = 0;
  std::vector<double> errors_m, errors_deg, nees;
  double sum = 0.0;
  for (const Outcome& o : outcomes) {
    if (!o.compared || o.pair.kind != row.kind || o.pair.distance_m < row.least_m ||
        o.pair.distance_m >= row.most_m)
      continue;
    ++pairs;
    closed += o.result.closed ? 1 : 0;
    wrong += o.isFalseClosure() ? 1 : 0;
    if (!o.result.closed || !o.sameRoom()) continue;
    errors_m.push_back(o.error_m);
    errors_deg.push_back(o.error_rad * kDegrees);
    nees.push_back(o.nees);
    sum += o.nees;
  }
  std::string text = fmt::format("{:<24}{:>6}{:>8}{:>7.2f}{:>7}", row.name, pairs, closed,
                                 pairs > 0 ? 1.0 * closed / pairs : 0.0, wrong);
  if (!errors_m.empty())
    text += fmt::format("{:>9.2f}{:>8.2f}{:>9.3f}{:>8.3f}{:>7.2f}{:>7.2f}", 100.0 * quantile(errors_m, 0.5),
                        100.0 * quantile(errors_m, 1.0), quantile(errors_deg, 0.5), quantile(errors_deg, 1.0),
                        sum / static_cast<double>(nees.size()), quantile(nees, 0.5));
  return text + "\n";
}

}  // namespace

bool Outcome::isRight() const {
  return sameRoom() && result.candidates > 0 && error_m < kRight_m && error_rad < kRight_rad;
}

Shots::Shots(const std::vector<Recording>& recordings, const std::vector<Pair>& pairs,
             const Surroundings& surroundings)
    : recordings_(recordings), surroundings_(surroundings) {
  std::vector<std::vector<FrameId>> needed(recordings.size());
  for (const Pair& pair : pairs) {
    std::vector<FrameId>& frames = needed[pair.recording];
    frames.push_back(pair.from);
    const auto around =
        recordings[pair.recording].around(pair.from, surroundings.spacing_m, surroundings.reach_m);
    frames.insert(frames.end(), around.begin(), around.end());
    needed[pair.other_recording].push_back(pair.to);
  }
  for (std::size_t i = 0; i < recordings.size(); ++i) shots_.push_back(recordings[i].shots(needed[i]));
}

const Shot* Shots::find(std::size_t recording, const FrameId& frame) const {
  const auto shot = shots_[recording].find(frame);
  return shot == shots_[recording].end() ? nullptr : &shot->second;
}

std::vector<scan::Reference> Shots::around(std::size_t recording, const FrameId& frame) const {
  std::vector<scan::Reference> scans;
  const auto& truth = recordings_[recording].truth(frame.first);
  const Pose2 base_from_map = truth.at(frame.second).map_from_base.inverse();
  std::mt19937 random(static_cast<std::uint32_t>(frame.second));
  const auto error = [&](double sigma) { return sigma * std::normal_distribution<double>()(random); };
  for (const FrameId& other :
       recordings_[recording].around(frame, surroundings_.spacing_m, surroundings_.reach_m)) {
    const Pose2 off{error(surroundings_.sigma_m), error(surroundings_.sigma_m),
                    error(surroundings_.sigma_rad)};
    const Shot* shot = find(recording, other);
    if (shot == nullptr) continue;
    const Pose2 base_from_other = base_from_map * truth.at(other.second).map_from_base * off;
    scans.push_back({&shot->scan, base_from_other * shot->base_from_scan});
  }
  return scans;
}

std::vector<Outcome> evaluate(const std::vector<Pair>& pairs, const Shots& shots,
                              const estimation::LoopCheckOptions& options, bool use_signatures) {
  estimation::LoopCheck check(options);
  std::vector<Outcome> outcomes;
  for (const Pair& pair : pairs) {
    const Shot* from = shots.find(pair.recording, pair.from);
    const Shot* to = shots.find(pair.other_recording, pair.to);
    if (from != nullptr && to != nullptr) {
      estimation::LoopPlace here = placeOf(*from, use_signatures), there = placeOf(*to, use_signatures);
      here.around = shots.around(pair.recording, pair.from);
      outcomes.push_back(judge(pair, here, there, check));
    } else {
      outcomes.emplace_back();
      outcomes.back().pair = pair;
    }
  }
  return outcomes;
}

std::string report(const std::vector<Outcome>& outcomes) {
  std::string text =
      "pairs                      n  closed  share  wrong   cm med   worst  deg med   worst   NEES median\n";
  for (const Row& row : kRows) text += rowOf(row, outcomes);
  std::map<std::string, int> reasons;
  std::vector<double> times;
  int without = 0, wrong = 0;
  for (const Outcome& o : outcomes) {
    without += o.compared ? 0 : 1;
    wrong += o.isFalseClosure() ? 1 : 0;
    if (!o.compared) continue;
    times.push_back(o.check_ms);
    if (!o.result.closed)
      ++reasons[fmt::format("{}: {}", toString(o.pair.kind), kindOfReason(o.result.reason))];
  }
  text += fmt::format(
      "{} pairs, {} without a scan, {} false closures; {:.1f} ms per check (median), {:.1f} ms worst\n",
      outcomes.size(), without, wrong, quantile(times, 0.5), quantile(times, 1.0));
  for (const auto& [reason, count] : reasons) text += fmt::format("  {:>4} {}\n", count, reason);
  return text;
}

std::string csv(const std::vector<Recording>& recordings, const std::vector<Outcome>& outcomes) {
  std::string text =
      "#kind,recording,from,other,to,distance_m,heading_deg,closed,right,error_m,error_deg,nees,candidates,"
      "matched,agree_m,"
      "contradiction,lead,difference,turn_error_deg,turn_sigma_deg,confidence,turn_evidence,evidence,ms,"
      "distinct_agree_m,distinct_contradict_m,chi2,reason\n";
  for (const Outcome& o : outcomes) {
    const auto& r = o.result;
    text += fmt::format(
        "{},{},{}:{},{},{}:{},{:.3f},{:.1f},{},{},{:.4f},{:.3f},{:.2f},{},{:.3f},{:.2f},{:.3f},{:.2f},{:.3f},"
        "{:.2f},{:.2f},{:.3f},{:.2f},{:.2f},{:.1f},{:.2f},{:.2f},{:.2f},\"{}\"\n",
        toString(o.pair.kind), recordings[o.pair.recording].name(), o.pair.from.first, o.pair.from.second,
        recordings[o.pair.other_recording].name(), o.pair.to.first, o.pair.to.second, o.pair.distance_m,
        o.pair.from_to.theta_rad * kDegrees, int{r.closed}, int{o.isRight()}, o.error_m,
        o.error_rad * kDegrees, o.nees, r.candidates, r.matched, r.overlap.agree_m, r.overlap.contradiction(),
        r.lead, r.difference.value_or(-1.0),
        wrapAngle(r.compass.turn_rad - o.pair.from_to.theta_rad) * kDegrees, r.compass.sigma_rad * kDegrees,
        r.compass.confidence, r.compass.evidence, r.evidence, o.check_ms, r.overlap.distinct_agree_m,
        r.overlap.distinct_contradict_m, r.chi2, r.reason);
  }
  return text;
}

}  // namespace omnifleet::loops
