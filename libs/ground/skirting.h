#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/pose2.h"
#include "ground/floor_boundary.h"
#include "observation/boundary.h"
#include "observation/observation.h"
#include "options/options.h"
#include "scan/edge_parallax.h"

namespace omnifleet::ground {

struct SkirtingOptions {
  bool use = true;  ///< in rooms with walls
  /// m: heights of skirting boards that are searched for; those on sale have 4 to 12 cm
  double min_height_m = 0.04, max_height_m = 0.15;
  /// nats: evidence for one height of all boards, against texture and against a strip of one width
  double least_evidence = 30.0;
  double least_lead = 0.05;      ///< 1, share of the evidence by which it exceeds that of each width
  double most_spread_m = 0.015;  ///< m: heights of single frames that differ by less are the same
  double least_agree = 0.5;      ///< 1, share of the frames that give the same height
  /// pixels beside an edge that blur and compression colour: 8 × 8 blocks of JPEG reach so far at half
  /// strength
  double artefact_px = 6.0;
  double least_parallax = 4.0;  ///< nats: evidence of parallax for boards that are narrower, …
  double least_refuted = 2.0;   ///< nats: … or against them
  scan::EdgeParallaxOptions parallax;
  /// nats: evidence of neighbouring beams for or against a board; with less, σ covers both
  double least_beams = 2.0;
  double sigma_px = 2.0;        ///< pixels: σ of a foot that the beams beside it and the height determine
  double correlated_px = 10.0;  ///< pixels of the beams, about, that show the same piece of texture
  int least_frames = 5;         ///< number of frames from which the spread of their heights counts
  double memory_frames = 50.0;  ///< number of frames over which the evidence is averaged
  static SkirtingOptions read(const options::Section& section);
};

/// Finds skirting boards of nearly the floor's colour, or as dark as the floor in shadow. There the
/// segmentation ends the floor at the upper edge of the board, so that walls appear farther away by the
/// factor H/(H − h): H is the height of the camera, h that of the board.
///
/// A board stands on the floor at 1 − h/H of the range of its upper edge, whatever the distance of the wall
/// and the angle at which it is seen. So the change of colour there, from the floor to the board, is averaged
/// over all beams for each h (a matched filter): a faint board of one colour adds up, texture of the floor
/// does not. A shadow or a strip along the walls has one width instead; its evidence is computed likewise and
/// must be less. Where walls are seen at one distance only, both explain the same and nothing changes. Blur
/// and compression colour the floor beside an edge as a narrow board would, so narrow boards must be
/// confirmed by the parallax of their upper edges (scan::EdgeParallax). Each beam decides whether it ends at
/// a board, together with the beams beside it: doors have none. (Method: this project.)
class Skirting {
 public:
  /// @param camera_height_m H @param floor gives the paths and edges; must outlive this
  Skirting(double camera_height_m, const FloorBoundary& floor, const SkirtingOptions& options);

  /// What a beam ends at.
  enum class End : std::uint8_t {
    kOther,     ///< as the floor boundary has it
    kFoot,      ///< of a board; moved there
    kUndecided  ///< at the foot of a board or at its upper edge; σ covers both
  };

  /// Moves ends of the floor from the upper edge of a board to its foot.
  /// @param image BGR8 or grey @param boundary of that image, as found by `floor`
  /// @param motion since the last call @return per bearing; valid until the next call
  const std::vector<End>& apply(const cv::Mat& image, const Motion& motion, Boundary& boundary);
  /// Inverse range of the foot of a board, relative to that of its upper edge. With the proposed height.
  double factor() const { return factor(proposed_m_); }

  /// Metres; 0 while no boards are known.
  double height_m() const { return height_m_; }

 private:
  static constexpr int kHeights = 23, kWidths = 30, kPixels = 16, kOffsets = 11;
  static constexpr int kHypotheses = kHeights + kWidths + kPixels;
  /// Step of colour along one hypothesis, weighted with pixels on both sides; sums decay from frame to frame.
  struct Sum {
    Eigen::Vector3d change = Eigen::Vector3d::Zero();
    double weight_px = 0.0;
  };
  /// What may explain the steps: boards of one height, strips of one width on the floor or in the image.
  struct Search {
    std::vector<Sum> sums = std::vector<Sum>(kHypotheses), frame = sums;  ///< mean of the frames; of the last
  };
  /// Colours along the end of one beam.
  struct Profile {
    int first = 0;                     ///< step of the first sample
    bool is_narrow = false;            ///< even the highest board shows too few pixels
    double end = 0.0;                  ///< place just before the upper edge
    std::size_t begin = 0, count = 0;  ///< cumulative deviations in sums_; count 0: not usable
  };
  double heightAt(double index) const;
  double widthAt(int index) const;
  double factor(double height_m) const;
  void readProfile(const cv::Mat& image, const Boundary& boundary, std::size_t bearing);
  Eigen::Vector3d mean(const Profile& profile, double from, double to) const;
  Sum stepAt(const Profile& profile, double foot) const;
  double evidenceOf(const Sum& sum) const;
  double incidence(const Boundary& boundary, std::size_t bearing) const;
  std::size_t firstBeam() const;
  void addEvidence(const Boundary& boundary);
  double bestHeight(const std::vector<Sum>& sums) const;
  double vote(double height_m);
  bool propose();
  double most(const Search& search, int from, int to) const;
  bool isWide() const;
  double parallaxEvidence(const Boundary& boundary);
  void moveToFoot(const cv::Mat& image, std::size_t bearing, Boundary& boundary);
  double offsetAt(double index) const;
  void placeBeam(const Boundary& boundary, std::size_t bearing);
  void compareBeams(const Boundary& boundary);

  double camera_m_;
  const FloorBoundary& floor_;
  SkirtingOptions options_;
  std::vector<Profile> profiles_;
  std::vector<Eigen::Vector3d> colours_, sums_;  ///< of one profile; cumulative deviations of all
  Eigen::Matrix3d texture_ = Eigen::Matrix3d::Zero();
  double textured_ = 0.0;  ///< pixels in texture_
  /// Inverse covariance of the deviations on the floor: texture changes brightness more than hue.
  Eigen::Matrix3d information_ = Eigen::Matrix3d::Zero();
  Search all_, wide_;          ///< all; feet farther from the upper edge than blur and compression reach
  std::vector<double> votes_;  ///< per height: frames that give it; they decay
  scan::EdgeParallax parallax_;
  double parallax_height_m_ = 0.0;  ///< of the boards whose upper edges it follows
  std::vector<bool> followed_;      ///< per bearing
  int frames_ = 0;
  double height_m_ = 0.0, proposed_m_ = 0.0;
  double variance_m2_ = 0.0;                          ///< of the heights of single frames
  Eigen::Vector3d change_ = Eigen::Vector3d::Zero();  ///< from the floor to the board
  /// The most likely foot of a beam.
  struct Place {
    double evidence = 0.0;  ///< nats, for a board there
    double offset = 0.0;    ///< index of its height
  };
  std::vector<Sum> steps_;        ///< per bearing and height around height_m_
  std::vector<double> evidence_;  ///< likewise, nats
  std::vector<Place> places_;     ///< per bearing
  std::vector<End> ends_;
};

}  // namespace omnifleet::ground
