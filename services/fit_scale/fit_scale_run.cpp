#include "fit_scale/fit_scale_run.h"

#include <fmt/format.h>

#include <filesystem>

#include "dataset/atomic_file.h"
#include "options/options.h"

namespace omnifleet::fit_scale {

using distance_vector::ScaleFit;

namespace {

/// The path is absolute, because overlays are used from any folder.
std::string overlayText(const Options& options) {
  std::string path = std::filesystem::absolute(options.out).lexically_normal().string();
  for (std::size_t at = 0; (at = path.find('\'', at)) != std::string::npos; at += 2) path.insert(at, "'");
  return fmt::format(
      "# Scale of the literal method for these cameras, on top of config/papers/ahmed.yaml.\n"
      "services:\n  local_mapper:\n    distance_vector:\n      literal:\n"
      "        scale_file: '{}'\n        metres_per_ceiling_px: {}\n",
      path, options.metres_per_ceiling_px);
}

}  // namespace

ScaleFit run(const Options& options) {
  if (!options.overlay.empty() && !(options.metres_per_ceiling_px > 0.0))
    throw omnifleet::options::Error(
        "--overlay needs --metres-per-ceiling-px: metres of floor per pixel of the ceiling camera");
  ScaleFit fit = [&] {
    try {
      return ScaleFit(ScaleFit::readPairs(options.pairs), options.degree);
    } catch (const omnifleet::options::Error& error) {
      const std::string text = error.what();
      if (text.rfind(options.pairs, 0) == 0) throw;
      throw omnifleet::options::Error(options.pairs + ": " + text);
    }
  }();
  dataset::writeAtomic(options.out, fit.toYaml());
  if (!options.overlay.empty()) dataset::writeAtomic(options.overlay, overlayText(options));
  if (!options.plot.empty()) drawAlpha(fit, options.plot);
  return fit;
}

std::string table(const ScaleFit& fit) {
  std::string text = fmt::format("{:>9} {:>9} {:>8} {:>8} {:>9} {:>9} {:>8}\n", "d_r [px]", "d_c [px]",
                                 "alpha", "fit", "residual", "paper", "differs");
  const auto residuals = fit.residuals();
  for (std::size_t i = 0; i < fit.pairs().size(); ++i) {
    const auto& pair = fit.pairs()[i];
    const auto paper = distance_vector::paperAlpha(pair.robot_px);
    text += fmt::format("{:9.1f} {:9.1f} {:8.4f} {:8.4f} {:+9.4f} ", pair.robot_px, pair.ceiling_px,
                        pair.alpha(), pair.alpha() - residuals[i], residuals[i]);
    text += paper ? fmt::format("{:9.4f} {:+7.1f}%\n", *paper, 100.0 * (*paper / pair.alpha() - 1.0))
                  : fmt::format("{:>9} {:>8}\n", "-", "-");
  }
  return text + fmt::format("degree {}, sigma {:.4f}, leave-one-out {:.4f}; valid from {:g} to {:g} px\n",
                            fit.degree(), fit.sigma(), fit.leaveOneOutRms(), fit.minPx(), fit.maxPx());
}

std::string converted(const ScaleFit& fit, const std::vector<double>& at_px) {
  std::string text;
  for (const double robot_px : at_px) {
    const auto ceiling_px = fit.ceilingPx(robot_px);
    if (!ceiling_px)
      throw omnifleet::options::Error(fmt::format(
          "--at: {:g} px is outside of the fitted interval {:g}-{:g} px; the polynomial is not valid there. "
          "Add pairs at this distance",
          robot_px, fit.minPx(), fit.maxPx()));
    text += fmt::format("{:g} px -> {:.2f} px\n", robot_px, *ceiling_px);
  }
  return text;
}

}  // namespace omnifleet::fit_scale
