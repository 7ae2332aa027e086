#include "dataset/markers.h"

#include <fmt/format.h>

namespace omnifleet::dataset {
namespace {

void readRgb(const options::Section& section, const std::string& key, Rgb& rgb) {
  std::vector<double> values;
  section.require(key, values, options::Range{0, 255});
  if (values.size() != 3)
    section.fail(key, "expected three numbers [red, green, blue], each within [0, 255]");
  for (std::size_t i = 0; i < 3; ++i) rgb[i] = static_cast<std::uint8_t>(values[i] + 0.5);
}

/// Reads [x, y], or one number for a square.
void readSize(const options::Section& section, const std::string& key, Eigen::Vector2d& size_m) {
  if (section.isList(key)) {
    section.read(key, size_m, options::kPositive);
    return;
  }
  double side_m = 0.0;
  section.require(key, side_m, options::kPositive);
  size_m = {side_m, side_m};
}

void readPatches(const options::Section& section, MarkerSet& set) {
  readRgb(section, "team_rgb", set.team);
  section.require("team_offset_m", set.team_offset_m);
  section.require("individual_offset_m", set.individual_offset_m);
  readSize(section, "patch_size_m", set.patch_size_m);
}

void readCovers(const options::Section& section, MarkerSet& set) {
  readSize(section, "cover_size_m", set.cover_size_m);
  section.require("head_offset_m", set.head_offset_m);
  readSize(section, "head_size_m", set.head_size_m);
  section.require("tail_offset_m", set.tail_offset_m);
  readSize(section, "tail_size_m", set.tail_size_m);
}

RobotColours readColours(const options::Section& robot, bool patches) {
  RobotColours colours;
  if (patches) {
    readRgb(robot, "rgb", colours.individual);
  } else {
    readRgb(robot, "cover_rgb", colours.cover);
    readRgb(robot, "tail_rgb", colours.tail);
    readRgb(robot, "head_rgb", colours.head);
  }
  robot.finish();
  return colours;
}

std::string pair(const Eigen::Vector2d& v) {
  return fmt::format("[{}, {}]", v.x(), v.y());
}
std::string triple(const Rgb& rgb) {
  return fmt::format("[{}, {}, {}]", rgb[0], rgb[1], rgb[2]);
}

}  // namespace

MarkerSet MarkerSet::load(const std::string& path) {
  return read(options::Section::load(path));
}

MarkerSet MarkerSet::read(const options::Section& section) {
  MarkerSet set;
  std::string kind = "patches";
  section.require("kind", kind, std::vector<std::string>{"patches", "cover_tail_head"});
  set.kind = kind == "patches" ? MarkerKind::kPatches : MarkerKind::kCoverTailHead;
  const bool patches = set.kind == MarkerKind::kPatches;
  section.require("height_m", set.height_m, options::kNotNegative);
  patches ? readPatches(section, set) : readCovers(section, set);
  const options::Section robots = section.child("robots");
  for (const std::string& name : robots.keys()) set.robots[name] = readColours(robots.child(name), patches);
  if (set.robots.empty()) section.fail("robots", "must list at least one robot and its colours");
  section.finish();
  return set;
}

std::string MarkerSet::toYaml() const {
  const bool patches = kind == MarkerKind::kPatches;
  std::string text =
      fmt::format("kind: {}\nheight_m: {}\n", patches ? "patches" : "cover_tail_head", height_m);
  if (patches) {
    text += fmt::format("team_rgb: {}\nteam_offset_m: {}\nindividual_offset_m: {}\npatch_size_m: {}\n",
                        triple(team), pair(team_offset_m), pair(individual_offset_m), pair(patch_size_m));
  } else {
    text += fmt::format(
        "cover_size_m: {}\nhead_offset_m: {}\nhead_size_m: {}\ntail_offset_m: {}\ntail_size_m: {}\n",
        pair(cover_size_m), pair(head_offset_m), pair(head_size_m), pair(tail_offset_m), pair(tail_size_m));
  }
  text += "robots:\n";
  for (const auto& [name, c] : robots) {
    text += patches ? fmt::format("  {}: {{rgb: {}}}\n", name, triple(c.individual))
                    : fmt::format("  {}: {{cover_rgb: {}, tail_rgb: {}, head_rgb: {}}}\n", name,
                                  triple(c.cover), triple(c.tail), triple(c.head));
  }
  return text;
}

}  // namespace omnifleet::dataset
