// markers IMAGE --robot NAME --cover X,Y --tail X,Y --head X,Y … --out markers.yaml: picks the colours of
// markers in an image of a ceiling camera.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "dataset/atomic_file.h"
#include "markers/markers_run.h"
#include "options/range_check.h"

namespace {

using omnifleet::markers::Pick;

struct Arguments {
  std::string image, out, picture, from;
  std::vector<Pick> picks;
  std::vector<std::string> robots;
  std::vector<double> cover_size, tail_offset, tail_size, head_offset, head_size, team_offset,
      individual_offset, patch_size;
  double height_m = -1.0;
};

/// The pixels belong to the robot named last, so their order counts.
void addPicks(CLI::App& app, Arguments& arguments) {
  app.add_option_function<std::string>(
         "--robot", [&](const std::string& name) { arguments.robots.push_back(name); },
         "name of a robot; the pixels of its regions follow")
      ->trigger_on_parse()
      ->take_last();
  for (const char* region : {"cover", "tail", "head", "individual", "team"}) {
    app.add_option_function<std::string>(
           std::string("--") + region,
           [&arguments, region](const std::string& text) {
             const bool team = std::string(region) == "team";
             if (!team && arguments.robots.empty())
               throw omnifleet::options::Error(std::string("--") + region + ": --robot must come first");
             arguments.picks.push_back({team ? std::string() : arguments.robots.back(), region,
                                        omnifleet::markers::pixelFromText(std::string("--") + region, text)});
           },
           std::string("X,Y: a pixel of the ") + region)
        ->trigger_on_parse()
        ->take_last();
  }
}

void addGeometry(CLI::App& app, Arguments& a) {
  app.add_option("--from", a.from, "markers.yaml with sizes, offsets and height");
  app.add_option("--height-m", a.height_m, "height of the markers over the floor, metres");
  const auto pair = [&](const char* name, std::vector<double>& to) {
    app.add_option(name, to, "x,y along base_link, metres")->delimiter(',')->expected(2);
  };
  pair("--cover-size-m", a.cover_size), pair("--tail-offset-m", a.tail_offset),
      pair("--tail-size-m", a.tail_size);
  pair("--head-offset-m", a.head_offset), pair("--head-size-m", a.head_size);
  pair("--team-offset-m", a.team_offset), pair("--individual-offset-m", a.individual_offset);
  pair("--patch-size-m", a.patch_size);
}

omnifleet::dataset::MarkerSet geometryOf(const Arguments& a, bool patches) {
  using omnifleet::options::Error;
  omnifleet::dataset::MarkerSet set;
  if (!a.from.empty()) set = omnifleet::dataset::MarkerSet::load(a.from);
  const auto kind =
      patches ? omnifleet::dataset::MarkerKind::kPatches : omnifleet::dataset::MarkerKind::kCoverTailHead;
  if (!a.from.empty() && set.kind != kind)
    throw Error(a.from + ": kind: differs from that of the given pixels");
  set.kind = kind;
  set.robots.clear();
  for (const std::string& robot : a.robots) set.robots[robot];
  const auto take = [&](const char* name, const std::vector<double>& from, Eigen::Vector2d& to) {
    if (from.size() == 2) to = {from[0], from[1]};
    if (from.empty() && a.from.empty()) throw Error(std::string(name) + " or --from is required");
  };
  if (a.height_m >= 0.0) set.height_m = a.height_m;
  if (a.height_m < 0.0 && a.from.empty()) throw Error("--height-m or --from is required");
  if (patches) {
    take("--team-offset-m", a.team_offset, set.team_offset_m);
    take("--individual-offset-m", a.individual_offset, set.individual_offset_m);
    take("--patch-size-m", a.patch_size, set.patch_size_m);
  } else {
    take("--cover-size-m", a.cover_size, set.cover_size_m);
    take("--tail-offset-m", a.tail_offset, set.tail_offset_m);
    take("--tail-size-m", a.tail_size, set.tail_size_m);
    take("--head-offset-m", a.head_offset, set.head_offset_m);
    take("--head-size-m", a.head_size, set.head_size_m);
  }
  return set;
}

void run(const Arguments& arguments) {
  using namespace omnifleet::markers;
  const cv::Mat image = cv::imread(arguments.image, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (image.empty()) throw omnifleet::options::Error(arguments.image + ": cannot read this file as an image");
  if (arguments.robots.empty()) throw omnifleet::options::Error("--robot: at least one robot is required");
  std::vector<PickedRegion> regions;
  bool patches = false;
  for (const Pick& pick : arguments.picks) {
    regions.push_back(pickRegion(image, pick));
    patches = patches || pick.region == "team" || pick.region == "individual";
    const PickedRegion& r = regions.back();
    std::printf("%-12s %-10s [%d, %d, %d]  %d pixels\n", pick.robot.c_str(), pick.region.c_str(), r.rgb[0],
                r.rgb[1], r.rgb[2], r.area_px);
  }
  const std::string picture = arguments.picture.empty() ? arguments.out + ".png" : arguments.picture;
  if (!cv::imwrite(picture, pictureOf(image, regions)))
    throw std::runtime_error(picture + ": cannot write this file");
  auto set = geometryOf(arguments, patches);
  enterColours(regions, FinderOptions(), set);
  omnifleet::dataset::writeAtomic(arguments.out, set.toYaml());
  std::printf("%s written; check the regions in %s\n", arguments.out.c_str(), picture.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  constexpr int kOk = 0, kFailed = 1, kBadInput = 2;
  CLI::App app(
      "Picks the colours of markers in an image of a ceiling camera and writes markers.yaml.\n"
      "Exit code: 0 done, 1 a file cannot be written, 2 invalid input or colours that cannot be "
      "distinguished.");
  Arguments arguments;
  app.add_option("IMAGE", arguments.image, "image of the ceiling camera")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option("--out", arguments.out, "markers.yaml to write")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option("--picture", arguments.picture, "picture of the picked regions (default: OUT.png)")
      ->check(omnifleet::options::notEmpty());
  addPicks(app, arguments);
  addGeometry(app, arguments);
  try {
    app.parse(argc, argv);
    run(arguments);
    return kOk;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kBadInput;
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kFailed;
  }
}
