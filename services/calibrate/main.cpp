// calibrate IMAGES_DIR --board COLSxROWS --square-m S --out sensor.yaml: calibrates a lens with images of a
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
      "Calibrates a lens with images of a chessboard, writes sensor.yaml with the reprojection error.\n"
      "Exit code: 0 done, 1 too few images show the board, the error is too large or the file cannot be "
      "written, 2 invalid "
      "input.");
  omnifleet::calibrate::Options options;
  std::string board, projection = "kannala_brandt";
  double square_m = 0.0;
  app.add_option("IMAGES_DIR", options.images, "folder with images of one camera")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option("--board", board, "COLSxROWS, number of inner corners (where four squares meet)")
      ->required();
  app.add_option("--square-m", square_m, "side of a square, metres")
      ->check(omnifleet::options::within({1e-4, 100.0}))
      ->required();
  app.add_option("--out", options.out, "sensor.yaml to write")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option("--projection", projection,
                 "orthographic, equidistant, equisolid, stereographic, kannala_brandt, ocam or pinhole")
      ->default_val(projection);
  app.add_option("--match", options.match, "shell pattern for the image names")->default_val("*");
  app.add_option(
         "--fov-deg", options.fov_deg,
         "full field of view that the model must cover, degrees (default: that of the corners plus 10 %)")
      ->check(omnifleet::options::within({1.0, 360.0}));
  app.add_option("--max-rms-px", options.max_rms_px,
                 "limit of the reprojection error; no file is written for a larger one")
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
