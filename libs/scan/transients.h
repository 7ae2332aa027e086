#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "scan/map_overlap.h"

namespace omnifleet::scan {

/// Finds the surfaces of a set of scans that were there for a short time only: a robot or a person that went
/// past. More scans of the same set see through their places than show them. Walls whose range was wrong in
/// one scan are found in the same way. (This project.)
class Transients {
 public:
  explicit Transients(const OverlapOptions& options = {}) : options_(options) {}

  /// Compares new scans with all others. @param scans all scans of the set; those known from calls before
  /// come first, in the same order. What has been counted stays where a scan has moved since: scans that see
  /// one surface move together.
  void update(const std::vector<Reference>& scans);

  /// Per beam: 1 where the beam shows a transient surface. @param scan number in the set
  const std::vector<std::uint8_t>& of(std::size_t scan) const { return scans_[scan].transient; }
  std::size_t size() const { return scans_.size(); }

 private:
  struct Counts {
    std::vector<int> agree, deny;         ///< per compared beam: scans of the set, the own one included
    std::vector<std::uint8_t> transient;  ///< per beam
  };
  void count(const Reference& shown, const Reference& viewer, Counts& counts) const;
  void decide(const LineScan& scan, Counts& counts) const;

  OverlapOptions options_;
  std::vector<Counts> scans_;
};

}  // namespace omnifleet::scan
