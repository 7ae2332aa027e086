#include "fit_scale/fit_scale_run.h"

#include <fmt/format.h>

#include "dataset/atomic_file.h"
#include "options/options.h"

namespace omnifleet::fit_scale {

using distance_vector::ScaleFit;

ScaleFit run(const Options& options) {
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
