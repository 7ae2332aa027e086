#include "localizer/ceiling_agreement.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "localizer/messages.h"

namespace omnifleet::localizer {
namespace {

std::string pairKey(const std::string& first, const std::string& second, const std::string& robot) {
  return "pair " + first + " " + second + " " + robot;
}

}  // namespace

AgreementOptions AgreementOptions::read(const options::Section& section) {
  AgreementOptions o;
  section.read("max_age_s", o.max_age_s, options::kPositive);
  section.read("pair_s", o.pair_s, options::kNotNegative);
  section.read("hold_s", o.hold_s, options::kNotNegative);
  section.read("speed_mps", o.speed_mps, options::kNotNegative);
  section.read("calibration_sigma_m", o.calibration_sigma_m, options::kNotNegative);
  section.read("calibration_sigma_rad", o.calibration_sigma_rad, options::kNotNegative);
  section.read("gate_chi2", o.gate_chi2, options::kPositive);
  section.read("moved_times", o.moved_times, {1, 1000});
  section.finish();
  return o;
}

bool CeilingAgreement::isOld(TimeNs newest_ns, const Measurement& measurement) {
  const double age_s = 1e-9 * static_cast<double>(newest_ns - measurement.acquired_ns);
  const bool is_old = age_s > options_.max_age_s;
  report("age " + measurement.source + " " + measurement.to, is_old,
         measurementTooOld(measurement.source, measurement.to, age_s));
  return is_old;
}

/// Compares a pose with those of other cameras; enlarges its covariance to explain the difference.
/// @return false if the difference is too large
bool CeilingAgreement::agree(Measurement& now, const Measurement& other) {
  const Eigen::Vector3d off =
      (Pose2::fromVector(now.value).inverse() * Pose2::fromVector(other.value)).vector();
  const double way_m =
      options_.speed_mps * 1e-9 * static_cast<double>(std::abs(now.acquired_ns - other.acquired_ns));
  Eigen::Matrix3d measured = now.covariance + other.covariance;
  measured.topLeftCorner<2, 2>() += way_m * way_m * Eigen::Matrix2d::Identity();
  const double m2 = options_.calibration_sigma_m * options_.calibration_sigma_m,
               rad2 = options_.calibration_sigma_rad * options_.calibration_sigma_rad;
  const Eigen::Matrix3d calibration = Eigen::Vector3d(2.0 * m2, 2.0 * m2, 2.0 * rad2).asDiagonal();
  const bool differ = off.dot((measured + calibration).ldlt().solve(off)) > options_.gate_chi2;
  const auto& [first, second] = std::minmax(now.source, other.source);
  report(
      pairKey(first, second, now.to), differ,
      camerasDisagree(first, second, now.to, off.head<2>().norm(), std::abs(off.z()), options_.moved_times));
  if (differ) return false;
  const double share = off.dot(measured.ldlt().solve(off)) / 3.0;
  if (share > 1.0) now.covariance *= share;
  return true;
}

/// Whether this call has a pose of the same robot by that camera at the same time.
bool CeilingAgreement::isPaired(std::size_t index, const std::string& source) const {
  const Measurement& now = kept_[index].measurement;
  return std::any_of(kept_.begin(), kept_.end(), [&](const Kept& other) {
    const Measurement& m = other.measurement;
    return m.to == now.to && m.source == source &&
           1e-9 * static_cast<double>(std::abs(m.acquired_ns - now.acquired_ns)) <= options_.pair_s;
  });
}

void CeilingAgreement::compare(std::size_t index) {
  Kept& now = kept_[index];
  const Measurement original = now.measurement;
  for (const auto& [source, other] : latest_[original.to]) {
    if (source == original.source) continue;
    const double apart_s = 1e-9 * static_cast<double>(std::abs(original.acquired_ns - other.acquired_ns));
    const auto& [first, second] = std::minmax(source, original.source);
    if (apart_s > options_.pair_s) {
      if (isPaired(index, source)) continue;  // it is compared with that one
      const bool is_faulty = faulty_.count(pairKey(first, second, original.to)) > 0;
      if (is_faulty && apart_s <= options_.hold_s && isContradicted(original.source, source))
        now.is_good = false;
      continue;
    }
    const bool do_agree = agree(now.measurement, other);
    Pair& pair = pairs_[first][second];
    count(pair, std::max(original.acquired_ns, other.acquired_ns), do_agree);
    if (!do_agree && isContradicted(original.source, source)) now.is_good = false;
    if (do_agree && pair.is_moved) now.is_confirmed = true;
    for (std::size_t i = 0; i < index; ++i) {  // the other one is of this call, too
      Kept& before = kept_[i];
      if (before.measurement.to != original.to || before.measurement.source != source) continue;
      if (do_agree) {
        agree(before.measurement, original);
        before.is_confirmed = before.is_confirmed || pair.is_moved;
      } else if (isContradicted(source, original.source)) {
        before.is_good = false;
      }
    }
  }
  latest_[original.to][original.source] = original;
}

/// All comparisons of one time are one piece of evidence, in whatever order they come.
void CeilingAgreement::count(Pair& pair, TimeNs time_ns, bool do_agree) const {
  if (time_ns != pair.time_ns) {
    pair.time_ns = time_ns;
    pair.was_moved = pair.is_moved;
    pair.agreeing_before = pair.agreeing;
    pair.differing_before = pair.differing;
    pair.has_agreed = false;
  }
  pair.has_agreed = pair.has_agreed || do_agree;
  const int most = options_.moved_times;
  pair.agreeing = pair.has_agreed ? std::min(most, pair.agreeing_before + 1) : 0;
  pair.differing = pair.has_agreed ? 0 : std::min(most, pair.differing_before + 1);
  if (pair.differing == 1 && !pair.was_moved) pair.since_ns = time_ns;
  pair.is_moved = pair.differing == most || (pair.was_moved && pair.agreeing < most);
}

const CeilingAgreement::Pair* CeilingAgreement::find(const std::string& one, const std::string& other) const {
  const auto& [first, second] = std::minmax(one, other);
  const auto row = pairs_.find(first);
  if (row == pairs_.end()) return nullptr;
  const auto pair = row->second.find(second);
  return pair == row->second.end() ? nullptr : &pair->second;
}

/// How many cameras other than `except` agree with `camera`, at `moved_times` times in a row, and since then.
int CeilingAgreement::confirmations(const std::string& camera, const std::string& except,
                                    TimeNs since_ns) const {
  int n = 0;
  for (const auto& [other, suspicion] : suspects_) {
    if (other == camera || other == except) continue;
    const Pair* pair = find(camera, other);
    n += pair != nullptr && pair->agreeing == options_.moved_times && pair->time_ns >= since_ns ? 1 : 0;
  }
  return n;
}

void CeilingAgreement::findSuspects() {
  for (const auto& [first, row] : pairs_) {
    suspects_[first] = Suspicion::kNone;
    for (const auto& [second, pair] : row) suspects_[second] = Suspicion::kNone;
  }
  for (const bool is_decided : {true, false}) {
    for (const auto& [first, row] : pairs_) {
      for (const auto& [second, pair] : row) {
        if (!pair.is_moved) continue;
        const int more =
            confirmations(first, second, pair.since_ns) - confirmations(second, first, pair.since_ns);
        Suspicion &of_first = suspects_[first], &of_second = suspects_[second];
        if (is_decided && more != 0) {
          (more > 0 ? of_second : of_first) = Suspicion::kAlone;
        } else if (!is_decided && more == 0 && of_first != Suspicion::kAlone &&
                   of_second != Suspicion::kAlone) {
          of_first = of_second = Suspicion::kOneOfTwo;
        }
      }
    }
  }
}

bool CeilingAgreement::isSuspect(const std::string& camera) const {
  const auto suspect = suspects_.find(camera);
  return suspect != suspects_.end() && suspect->second != Suspicion::kNone;
}

/// Whether a difference speaks against `camera`. Not if `by` alone was moved.
bool CeilingAgreement::isContradicted(const std::string& camera, const std::string& by) const {
  const Pair* pair = find(camera, by);
  return pair == nullptr || !pair->is_moved || isSuspect(camera) || !isSuspect(by);
}

void CeilingAgreement::report(const std::string& key, bool is_faulty, const Message& message) {
  if (!is_faulty) {
    faulty_.erase(key);
  } else if (faulty_.insert(key).second) {
    messages_.push_back(message);
  }
}

void CeilingAgreement::check(TimeNs newest_ns, std::vector<const Measurement*>& measurements) {
  kept_.clear();
  std::vector<const Measurement*> passed;
  for (const Measurement* measurement : measurements) {
    if (measurement->kind != MeasurementKind::kAbsolutePose) {
      passed.push_back(measurement);
    } else if (isOld(newest_ns, *measurement)) {
      ++rejected_;
    } else {
      kept_.push_back({*measurement});
    }
  }
  for (std::size_t i = 0; i < kept_.size(); ++i) compare(i);
  findSuspects();
  for (const Kept& kept : kept_) {
    if (kept.is_good && (kept.is_confirmed || !isSuspect(kept.measurement.source)))
      passed.push_back(&kept.measurement);
    else
      ++rejected_;
  }
  measurements.swap(passed);
}

std::vector<Message> CeilingAgreement::takeMessages() {
  return std::exchange(messages_, {});
}

}  // namespace omnifleet::localizer
