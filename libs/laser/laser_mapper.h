#pragma once

#include <vector>

#include "dataset/laser.h"
#include "laser/facing_side.h"
#include "laser/segments.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::laser {

struct Options {
  SegmentOptions segments;    ///< `segments`: where a scan is cut
  double split_sigmas = 2.5;  ///< σ of a range, added to `split_m`
  double split_m = 0.004;     ///< m, distance of an echo from a face at which the face is split
  double hollow_deg =
      25.0;  ///< degrees: a concave corner deeper than this by 3 σ separates two touching objects
  double max_size_m = 1.2;     ///< m, longer surfaces are walls: in the scan, but no objects
  double max_contact_m = 3.0;  ///< m, surfaces farther away are no objects
  int min_beams = 4;           ///< least number of echoes of an object
  static Options read(const options::Section& section);
};

/// Replaces the camera by a laser (Choi et al. 2014, future work): one local map per scan, in the same form
/// for classifier, localizer and merger. Differences: `camera_height_m` is 0 (no heights, because no top is
/// visible). Objects have no pixels and no vectors; their hull and supports are those of the side that faces
/// the scanner. The motion is that of the wheels; the localizer matches the scans
/// (`boundary`). Pure: no DDS, no clock, no thread.
class LaserMapper {
 public:
  LaserMapper(const dataset::LaserSensor& sensor, const Options& options)
      : sensor_(sensor), options_(options) {}

  /// Returns one local map per scan, also for invalid ones: kWrongSize if the number of beams differs from
  /// the first scan, kNonFinite for other invalid numbers (dataset::problemOf), kDark if no beam has an echo.
  /// The robot name is left empty. The map is valid until the next call.
  const LocalMap& process(const dataset::LaserRow& row, std::uint32_t sequence, const Motion& wheels);
  /// Description of the fault of the last scan, if its state does not describe it; else empty.
  const char* fault() const { return fault_; }

 private:
  FrameState check(const dataset::LaserRow& row);
  void checkEchoes(const dataset::LaserRow& row);
  bool isConcave(const Piece& before, const Piece& after) const;
  void splitAtConcaveCorners(const Segment& segment);
  void measure(const Segment& segment);
  void addObject(const Segment& segment);
  void label(const Segment& segment, RayLabel kind, std::uint16_t object);
  void fillScan();
  void fillBoundary();

  dataset::LaserSensor sensor_;
  Options options_;
  std::size_t beam_count_ = 0;  ///< of the first valid scan
  Beams beams_;
  std::vector<Segment> segments_, convex_;
  std::vector<Piece> pieces_;
  FacingSide side_;
  std::vector<RayLabel> label_;  ///< per beam
  std::vector<std::uint16_t> object_;
  LocalMap map_;
  const char* fault_ = "";
};

/// Range per bearing 2πi/N in base_link from beams at any bearings. Between two echoes of one surface 1/r is
/// interpolated (linear along a straight face up to the square of the beam spacing). Otherwise the nearest
/// beam is used. kInvalid outside of the field of view.
/// @param label, object per beam
void resample(const Beams& beams, const std::vector<RayLabel>& label,
              const std::vector<std::uint16_t>& object, double range_sigma_m, Scan& scan);

}  // namespace omnifleet::laser
