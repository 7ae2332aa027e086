#pragma once

#include <cstdint>
#include <vector>

#include "distance_vector/floor_walk.h"
#include "distance_vector/options.h"
#include "observation/observation.h"

namespace omnifleet::distance_vector {

/// One image column on the floor, about the foot of the camera.
struct ColumnHit {
  End end = End::kOutside;
  bool low = false, beyond = false;  ///< kEdge (ColumnEnd)
  float row = 0.0f;                  ///< pixels; of kEdge and kFloorEnd
  float bearing_rad = 0.0f;
  float inverse_m = 0.0f;  ///< 1/m
  float sigma = 0.0f;      ///< 1/m, of inverse_m
  float per_px = 0.0f;     ///< 1/m: change of inverse_m per pixel of the row
};

/// Columns → bearings. Columns whose edges follow each other form a piece; between pieces lies a silhouette,
/// where columns show parts of both surfaces: those are dropped. σ is scaled by the noise that the second
/// differences of the pieces show. Each bearing then takes the mean of the columns in its bin, weighted by
/// 1/σ², or the value between its two neighbours, linear in inverse range.
class BearingSampler {
 public:
  explicit BearingSampler(const Options& options) : options_(options) {}

  /// @param hits one per column, from left to right; changed @param origin_m foot of the camera
  void sample(std::vector<ColumnHit>& hits, const Eigen::Vector2d& origin_m, double blind_m);

  const Boundary& boundary() const { return boundary_; }
  const Scan& scan() const { return scan_; }
  void clear(const Eigen::Vector2d& origin_m, double blind_m);
  /// Ratio of the noise that the last frame showed to its predicted σ.
  float noiseScale() const { return noise_scale_; }

 private:
  void findPieces(const std::vector<ColumnHit>& hits);
  bool follows(const std::vector<ColumnHit>& hits, std::size_t i) const;
  float differenceScale(const std::vector<ColumnHit>& hits, std::size_t lag);
  void scaleNoise(std::vector<ColumnHit>& hits);
  void dropOutliers(const std::vector<ColumnHit>& hits);
  void dropSilhouettes(const std::vector<ColumnHit>& hits);
  void trim(const std::vector<ColumnHit>& hits, std::size_t begin, std::size_t end, bool silhouette,
            bool last);
  void samplePiece(const std::vector<ColumnHit>& hits, std::size_t begin, std::size_t end);
  void set(int bin, RayLabel label, float inverse_m, float sigma);

  Options options_;
  std::vector<std::uint8_t> joined_;  ///< column i and i + 1 belong together
  std::vector<std::uint8_t> dropped_;
  std::vector<float> ratios_;
  float noise_scale_ = 1.0f;
  Boundary boundary_;
  Scan scan_;
};

}  // namespace omnifleet::distance_vector
