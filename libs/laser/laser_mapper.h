#pragma once

#include <vector>

#include "dataset/laser.h"
#include "laser/facing_side.h"
#include "laser/scan_match.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::laser {

struct Options {
  SegmentOptions segments;     ///< `segments`: where a scan falls to pieces
  double split_sigmas = 2.5;   ///< σ of a range, and …
  double split_m = 0.004;      ///< m, … that echoes may lie off a face before it is split
  double hollow_deg = 25.0;    ///< degrees: a hollow surely deeper (3 σ) parts two things that touch
  double max_size_m = 1.2;     ///< m, longer things are walls: in the scan, no objects
  double max_contact_m = 3.0;  ///< m, things farther away are no objects
  int min_beams = 4;           ///< echoes that make an object
  bool match = true;           ///< the wheels' motion is corrected by what stands
  static Options read(const options::Section& section);
};

/// A laser in the camera's place (Choi et al. 2014, future work): one scan in, one local map out, of the same
/// form, so that classifier, localizer and merger need not know. Differences: `camera_height_m` is 0 (nothing
/// is seen over the top of things, their height stays unknown), objects have no pixels and no vectors, their
/// hull and supports are those of the side that faces the scanner; the motion is the wheels', corrected by
/// matching the scan with the one before (`match`). Pure: no DDS, no clock, no thread.
class LaserMapper {
 public:
  LaserMapper(const dataset::LaserSensor& sensor, const Options& options)
      : sensor_(sensor), options_(options) {}

  /// One local map per scan, invalid ones too: kWrongSize where the number of beams is not that of the scans
  /// before, kNonFinite for other impossible numbers (dataset::problemOf), kDark where no beam has an echo.
  /// Robot name left empty; valid until the next call.
  const LocalMap& process(const dataset::LaserRow& row, std::uint32_t sequence, const Motion& wheels);
  /// In words, what is wrong with the last scan where its state alone does not tell; else empty.
  const char* fault() const { return fault_; }

 private:
  FrameState check(const dataset::LaserRow& row);
  void checkEchoes(const dataset::LaserRow& row);
  void noteWhatMayDrive(const Segment& segment);
  bool isHollow(const Piece& before, const Piece& after) const;
  void cutAtHollows(const Segment& segment);
  void measure(const Segment& segment);
  void addObject(const Segment& segment);
  void label(const Segment& segment, RayLabel kind, std::uint16_t object);
  void fillScan();

  dataset::LaserSensor sensor_;
  Options options_;
  std::size_t beam_count_ = 0;  ///< of the first good scan
  Beams beams_;
  std::vector<Segment> segments_, convex_;
  std::vector<Piece> pieces_;
  FacingSide side_;
  ScanMatcher matcher_;
  std::vector<RayLabel> label_;  ///< per beam
  std::vector<std::uint16_t> object_;
  LocalMap map_;
  const char* fault_ = "";
};

/// Range per bearing 2πi/N in base_link from beams in any raster: between two echoes of one surface 1/r is
/// interpolated (a straight face is linear in it but for the beams' spacing squared), else the nearest beam
/// counts; kInvalid where no beam looks.
/// @param label, object per beam
void resample(const Beams& beams, const std::vector<RayLabel>& label,
              const std::vector<std::uint16_t>& object, double range_sigma_m, Scan& scan);

}  // namespace omnifleet::laser
