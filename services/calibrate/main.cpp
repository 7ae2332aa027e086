// calibrate IMAGES_DIR --board COLSxROWS --square_m S --out sensor.yaml: a lens from pictures of a
// chessboard.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "calibrate/calibrate_run.h"
#include "options/range_check.h"

int main(int argc, char** argv) {
  constexpr int kOk = 0, kFailed = 1, kBadInput = 2;
  CLI::App app(
      "Calibrates a lens from pictures of a chessboard, writes sensor.yaml with its reprojection error.\n"
      "Exit code: 0 done, 1 the board was found too seldom, the error is too large or the file cannot be "
      "written, 2 bad "
      "input.");
  omnifleet::calibrate::Options options;
  std::string board, projection = "kannala_brandt";
  double square_m = 0.0;
  app.add_option("IMAGES_DIR", options.images, "folder of images, all of one camera")->required();
  app.add_option("--board", board, "COLSxROWS, the inner corners (where four squares meet)")->required();
  app.add_option("--square_m", square_m, "side of a square, metres")
      ->check(omnifleet::options::within({1e-4, 100.0}))
      ->required();
  app.add_option("--out", options.out, "the sensor.yaml to write")->required();
  app.add_option("--projection", projection,
                 "orthographic, equidistant, equisolid, stereographic, kannala_brandt, ocam or pinhole")
      ->default_val(projection);
  app.add_option("--match", options.match, "shell pattern of the images' names")->default_val("*");
  app.add_option("--fov_deg", options.fov_deg,
                 "full angle that the lens must serve (default: what the corners covered and a tenth more)")
      ->check(omnifleet::options::within({1.0, 360.0}));
  app.add_option("--max_rms_px", options.max_rms_px,
                 "nothing is written where the reprojection error is larger")
      ->check(omnifleet::options::within({0.01, 1000.0}))
      ->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kBadInput;
  }
  try {
    options.board = omnifleet::calibration::Board::parse(board, square_m);
    options.projection = omnifleet::calibrate::projectionFromName(projection);
    const auto report = omnifleet::calibrate::run(options, [](const std::string& name, bool found) {
      std::fprintf(stderr, "%s: %s\n", name.c_str(), found ? "board found" : "no board found");
    });
    std::fputs(omnifleet::calibrate::table(report).c_str(), stdout);
    return kOk;
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kFailed;
  }
}
