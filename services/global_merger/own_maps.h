#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "global_merger/merger.h"

namespace omnifleet::global_merger {

/// Maps of robots whose poses are in a frame of their own, beside the common map: one per robot, made of its
/// samples alone. A map begins with the first pose in that frame. The samples of a robot that is matched
/// leave it again, as their poses change to the common frame.
class OwnMaps {
 public:
  /// An empty map in the frame of a robot.
  using Make = std::function<Merger(const std::string& robot)>;

  /// @param robots that may have a map of their own; samples of others are ignored
  OwnMaps(std::vector<std::string> robots, Make make) : robots_(std::move(robots)), make_(std::move(make)) {}

  // Each sample that the common map received, after that.
  void add(const occupancy::Contribution& contribution);
  void add(const occupancy::KeyframePose& pose, const Merger& common);
  void addTrajectory(const PoseEstimate& pose, const Merger& common);

  /// Merger::correctSome() for all maps.
  bool correctSome(std::size_t at_most);
  /// Live: fits the outlines of the maps that changed.
  void fit(const Meanwhile& meanwhile);
  /// Merger::finish() for all maps.
  void finish();

  /// Saves the maps of the robots that are still in their own frame to `folder`/<robot> (save.h), and removes
  /// what an earlier save has written there for others. Returns one line per file that failed.
  std::vector<std::string> save(const Merger& common, const std::string& folder) const;
  const std::map<std::string, Merger>& maps() const { return maps_; }

 private:
  Merger* find(const std::string& robot);
  void begin(const std::string& robot, const Merger& common);
  bool mayHaveOne(const std::string& robot, const std::string& frame, bool valid) const;

  std::vector<std::string> robots_;
  Make make_;
  std::map<std::string, Merger> maps_;
};

}  // namespace omnifleet::global_merger
