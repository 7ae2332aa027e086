#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "tests/experiments/fernandez/image_set.h"

namespace omnifleet::fernandez {

enum class Method {
  kLiteral,        ///< as printed: phases without weights, whole columns, eq. 2–5, free scale
  kLiteralMidway,  ///< likewise, but a step leads halfway between both headings
  kOmnifleet,      ///< compass that separates parallax from rotation, steps halfway; no wheels
  kWheels          ///< likewise, lengths of the steps by the wheels
};

const std::vector<Method>& methods();
std::string nameOf(Method method);

/// Modules k1 and phases k2 that are swept (§V): those of the paper's figures and results, and all.
const std::vector<int>& sweptFrequencies();

/// What the images of a set measure of each other, every step-th of which is taken: turns by the visual
/// compass for every k2, distances of signatures (eq. 2) for every k1.
class Relations {
 public:
  Relations(const ImageSet& set, Method method, int step);

  /// Positions of the topological map, in the order of the images.
  /// @param k1, k2 of sweptFrequencies()
  std::vector<Eigen::Vector2d> layOut(int k1, int k2) const;

 private:
  struct Turn {
    double rad = 0.0, sigma_rad = 0.0;
  };
  std::size_t indexOf(int frequency) const;

  Method method_;
  std::vector<const SetImage*> images_;
  std::vector<std::vector<Turn>> turns_;          ///< per k2, per pair of images
  std::vector<std::vector<double>> differences_;  ///< per k1, per pair of images
};

/// Seconds to build the map (Figs. 10 and 11): distances, turns and poses of every step-th image. The
/// signatures exist, and what the compass needs of each is prepared.
double buildTime_s(const ImageSet& set, Method method, int step, int k1, int k2);

}  // namespace omnifleet::fernandez
