#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "observation/error_code.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::localizer {

struct AgreementOptions {
  double max_age_s = 2.0;              ///< s, older absolute poses are rejected
  double pair_s = 0.02;                ///< s, largest difference in time of two poses that are compared
  double hold_s = 1.0;                 ///< s, for so long after a pose its camera counts as seeing the robot
  double speed_mps = 0.3;              ///< m/s, a robot may move this fast between the two
  double calibration_sigma_m = 0.003;  ///< m, σ of a camera's extrinsics, as a position on the floor, …
  double calibration_sigma_rad = 0.005;  ///< rad, … and as a heading
  double gate_chi2 = 16.3;  ///< 1, χ² (3 dof, 99.9 %) of the difference beyond which both are rejected
  /// Times at which two cameras differ, without an agreement between, until the pair counts as moved, and
  /// times at which they agree until it no longer does. Source: noise passes the gate at 1 of 1000 times, so
  /// at three in a row at 1 of 10⁹; a wrong detection (another robot's marker) lasts one or two images.
  int moved_times = 3;

  static AgreementOptions read(const options::Section& section);
};

/// Compares what several ceiling cameras measure of one robot at one time (zone 2 of Ahmed et al. 2013, Fig.
/// 2c). Poses that differ by more than their covariances explain get larger ones, so that their fusion has
/// the σ of the difference. Poses that differ by more than calibrations explain are rejected: one of the two
/// cameras was moved, and nothing says which. Until both agree again on this robot, neither of its poses is
/// used while both see it. Also rejects poses that are too old.
///
/// Extrinsics belong to a camera, not to a robot. Two cameras that differ at `moved_times` times in a row, of
/// any robots, are a moved pair: until they agree at as many times in a row, no pose of either is used, of
/// any robot and also outside of the overlap. A time counts as an agreement if they agree on one robot at
/// least: agreements by chance are rare, a difference may be a wrong detection. Of a moved pair only the
/// camera that fewer other cameras agree with is under suspicion. A pose that another camera of the moved
/// pair confirms at the same time is used.
///
/// Before two cameras were compared (at the start of a run, or without a common robot) nothing is known of
/// their difference: the poses of both are used.
class CeilingAgreement {
 public:
  explicit CeilingAgreement(const AgreementOptions& options) : options_(options) {}

  /// Replaces `measurements` by those that may be used; other kinds than absolute poses pass unchanged.
  /// `newest_ns`: time of this batch. The new pointers are valid until the next call.
  void check(TimeNs newest_ns, std::vector<const Measurement*>& measurements);

  /// Since the last call; one per camera or pair of cameras and robot until the fault is over.
  std::vector<Message> takeMessages();
  /// Rejected measurements since the start.
  std::uint64_t rejected() const { return rejected_; }

 private:
  struct Kept {
    Measurement measurement;
    bool is_good = true;
    bool is_confirmed = false;  ///< another camera of a moved pair agrees with it
  };
  /// What the comparisons of two cameras show. Counts are of times in a row, up to `time_ns`.
  struct Pair {
    TimeNs time_ns = std::numeric_limits<TimeNs>::min();  ///< of the last comparison
    TimeNs since_ns = 0;                                  ///< they differ since
    bool has_agreed = false, was_moved = false;           ///< at this time; before it
    int agreeing_before = 0, differing_before = 0;
    int agreeing = 0, differing = 0;
    bool is_moved = false;
  };
  /// kOneOfTwo: nothing says which one of a pair was moved. kAlone: other cameras say that it was this one,
  /// which explains all its differences.
  enum class Suspicion : std::uint8_t { kNone, kOneOfTwo, kAlone };
  bool isOld(TimeNs newest_ns, const Measurement& measurement);
  void compare(std::size_t index);
  bool isPaired(std::size_t index, const std::string& source) const;
  bool agree(Measurement& now, const Measurement& other);
  void report(const std::string& key, bool is_faulty, const Message& message);
  void count(Pair& pair, TimeNs time_ns, bool do_agree) const;
  const Pair* find(const std::string& one, const std::string& other) const;
  int confirmations(const std::string& camera, const std::string& except, TimeNs since_ns) const;
  void findSuspects();
  bool isSuspect(const std::string& camera) const;
  bool isContradicted(const std::string& camera, const std::string& by) const;

  AgreementOptions options_;
  std::deque<Kept> kept_;                                             ///< absolute poses of this call
  std::map<std::string, std::map<std::string, Measurement>> latest_;  ///< by robot and source
  std::map<std::string, std::map<std::string, Pair>> pairs_;          ///< by both cameras, in order
  std::map<std::string, Suspicion> suspects_;                         ///< all cameras that were compared
  std::set<std::string> faulty_;
  std::vector<Message> messages_;
  std::uint64_t rejected_ = 0;
};

}  // namespace omnifleet::localizer
