#pragma once

#include <deque>
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

  static AgreementOptions read(const options::Section& section);
};

/// Compares what several ceiling cameras measure of one robot at one time (zone 2 of Ahmed et al. 2013, Fig.
/// 2c). Poses that differ by more than their covariances explain get larger ones, so that their fusion has
/// the σ of the difference. Poses that differ by more than calibrations explain are rejected: one of the two
/// cameras was moved, and nothing says which. Until both agree again, neither is used while both see the
/// robot. Also rejects poses that are too old.
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
  };
  bool isOld(TimeNs newest_ns, const Measurement& measurement);
  void compare(std::size_t index);
  bool isPaired(std::size_t index, const std::string& source) const;
  bool agree(Measurement& now, const Measurement& other);
  void report(const std::string& key, bool is_faulty, const Message& message);

  AgreementOptions options_;
  std::deque<Kept> kept_;                                             ///< absolute poses of this call
  std::map<std::string, std::map<std::string, Measurement>> latest_;  ///< by robot and source
  std::set<std::string> faulty_;
  std::vector<Message> messages_;
  std::uint64_t rejected_ = 0;
};

}  // namespace omnifleet::localizer
