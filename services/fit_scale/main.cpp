// fit_scale PAIRS.csv --out scale.yaml [--overlay FILE --metres-per-ceiling-px M] [--plot alpha.png] [--at PX
// …]: fits the scale between the distances seen by a robot's camera and by a ceiling camera (Ahmed et al.
// 2013, eq. 1).
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "fit_scale/fit_scale_run.h"
#include "options/range_check.h"

int main(int argc, char** argv) {
  constexpr int kOk = 0, kFailed = 1, kBadInput = 2;
  CLI::App app(
      "Fits the scale alpha(d_r) = d_c/d_r to pairs of distances (Ahmed et al. 2013, eq. 1, Table 1), writes "
      "it and "
      "prints the residuals.\n"
      "Exit code: 0 done, 1 a file cannot be written, 2 invalid input or a distance outside of the fitted "
      "interval.");
  omnifleet::fit_scale::Options options;
  int degree = -1;
  app.add_option("PAIRS", options.pairs, "CSV file: d_robot_px,d_ceiling_px")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option("--out", options.out, "scale.yaml to write")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option("--plot", options.plot, "picture of alpha over d_r (.png), the paper's Fig. 3b")
      ->check(omnifleet::options::notEmpty());
  app.add_option("--overlay", options.overlay,
                 "overlay to write: gives the fit to the method of config/papers/ahmed.yaml")
      ->check(omnifleet::options::notEmpty());
  app.add_option("--metres-per-ceiling-px", options.metres_per_ceiling_px,
                 "metres of floor per pixel of the ceiling camera, for the overlay")
      ->check(omnifleet::options::within({1e-6, 10.0}));
  app.add_option("--degree", degree,
                 "degree of the polynomial (default: the smallest leave-one-out error, at most 4)")
      ->check(CLI::Range(0, 8));
  app.add_option("--at", options.at_px,
                 "distances d_r (px) to convert; refused outside of the fitted interval")
      ->check(omnifleet::options::within({0.0, 1e9}));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kBadInput;
  }
  try {
    if (degree >= 0) options.degree = degree;
    const auto fit = omnifleet::fit_scale::run(options);
    std::fputs(omnifleet::fit_scale::table(fit).c_str(), stdout);
    std::fputs(omnifleet::fit_scale::converted(fit, options.at_px).c_str(), stdout);
    return kOk;
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kFailed;
  }
}
