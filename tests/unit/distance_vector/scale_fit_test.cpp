#include "distance_vector/scale_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "distance_vector/options.h"
#include "fit_scale/fit_scale_run.h"
#include "options/options.h"
#include "tests/test_data.h"

namespace omnifleet::distance_vector {
namespace {

std::string writtenPairs(const test::TempFolder& folder, const std::string& text) {
  const std::string path = folder / "pairs.csv";
  std::ofstream(path) << text;
  return path;
}

std::string tableText() {
  std::string text = "d_robot_px,d_ceiling_px\n";
  for (const ScalePair& pair : paperTable())
    text += std::to_string(pair.robot_px) + "," + std::to_string(pair.ceiling_px) + "\n";
  return text;
}

// The printed polynomial has rounded coefficients: it is 3.1–5.8 % below the printed α in every row, and
// 3.1–6.0 % below d_c/d_r, which the table rounds to two digits.
TEST(PaperAlpha, LiesBelowTheTableInEveryRow) {
  const double printed[] = {1.19, 1.20, 1.21, 1.23, 1.25, 1.28, 1.37, 1.57, 1.75, 2.10};
  double least = 1.0, most = 0.0, most_of_ratio = 0.0;
  for (std::size_t i = 0; i < paperTable().size(); ++i) {
    const ScalePair& pair = paperTable()[i];
    const auto alpha = paperAlpha(pair.robot_px);
    ASSERT_TRUE(alpha);
    EXPECT_NEAR(pair.alpha(), printed[i], 0.0051);
    least = std::min(least, 1.0 - *alpha / printed[i]);
    most = std::max(most, 1.0 - *alpha / printed[i]);
    most_of_ratio = std::max(most_of_ratio, 1.0 - *alpha / pair.alpha());
  }
  EXPECT_NEAR(least, 0.031, 0.001);
  EXPECT_NEAR(most, 0.058, 0.001);
  EXPECT_NEAR(most_of_ratio, 0.060, 0.001);
}

TEST(PaperAlpha, RefusesDistancesOutsideOfItsTable) {
  EXPECT_FALSE(paperAlpha(61.9));
  EXPECT_FALSE(paperAlpha(121.1));
  EXPECT_FALSE(paperAlpha(std::nan("")));
  EXPECT_TRUE(paperAlpha(62.0));
  EXPECT_TRUE(paperAlpha(121.0));
}

TEST(ScaleFit, RecoversAPolynomialOfDegreeFour) {
  std::vector<ScalePair> pairs;
  const auto truth = [](double d) {
    return 1.0 + 3e-3 * (d - 60) + 2e-5 * std::pow(d - 80, 2) + 3e-8 * std::pow(d - 90, 4);
  };
  for (double d = 60; d <= 120; d += 5) pairs.push_back({d, d * truth(d)});
  const ScaleFit fit(pairs, 4);
  for (double d = 60; d <= 120; d += 1) EXPECT_NEAR(*fit.alpha(d), truth(d), 1e-10);
  const auto powers = fit.powers();
  ASSERT_EQ(powers.size(), 5u);
  for (double d = 60; d <= 120; d += 7) {
    double sum = 0.0;
    for (std::size_t k = powers.size(); k-- > 0;) sum = sum * d + powers[k];
    EXPECT_NEAR(sum, truth(d), 1e-8);
  }
}

TEST(ScaleFit, RefusesToExtrapolate) {
  const ScaleFit fit(paperTable(), 4);
  EXPECT_FALSE(fit.alpha(61.99));
  EXPECT_FALSE(fit.alpha(121.01));
  EXPECT_FALSE(fit.ceilingPx(0.0));
  EXPECT_TRUE(fit.alpha(62.0));
  EXPECT_NEAR(*fit.ceilingPx(101.0), 138.0, 4.0);
}

// The fit must be much better than the printed polynomial, whose error is 0.05.
TEST(ScaleFit, FitsTheTableBetterThanThePaper) {
  const ScaleFit fit(paperTable());
  for (const double residual : fit.residuals()) EXPECT_LT(std::abs(residual), 0.03);
}

// The reference leaves each pair out and fits anew.
TEST(ScaleFit, LeaveOneOutErrorIsThatOfRepeatedFits) {
  const auto& pairs = paperTable();
  const ScaleFit fit(pairs, 3);
  // The first and the last pair define the interval of the basis, not the polynomial: compare through powers.
  double sum = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    auto others = pairs;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const auto powers = ScaleFit(others, 3).powers();
    double alpha = 0.0;
    for (std::size_t k = powers.size(); k-- > 0;) alpha = alpha * pairs[i].robot_px + powers[k];
    sum += std::pow(alpha - pairs[i].alpha(), 2);
  }
  EXPECT_NEAR(fit.leaveOneOutRms(), std::sqrt(sum / static_cast<double>(pairs.size())), 1e-6);
}

TEST(ScaleFit, ChoosesALowDegreeForNoisyLines) {
  std::vector<ScalePair> pairs;
  for (int i = 0; i < 12; ++i) {
    const double d = 60 + 5 * i;
    pairs.push_back({d, d * (1.0 + 0.002 * d + (i % 2 ? 0.01 : -0.01))});
  }
  EXPECT_LE(ScaleFit(pairs).degree(), 2);
  EXPECT_GE(ScaleFit(pairs).degree(), 1);
}

TEST(ScaleFit, RejectsUnusablePairs) {
  EXPECT_THROW(ScaleFit({}), options::Error);
  EXPECT_THROW(ScaleFit({{60, 70}}), options::Error);
  EXPECT_THROW(ScaleFit({{60, 70}, {60, 71}, {60, 72}}), options::Error);
  EXPECT_THROW(ScaleFit({{60, 70}, {70, 80}, {80, 90}}, 4), options::Error);
  EXPECT_THROW(ScaleFit({{60, 70}, {-1, 80}, {80, 90}}), options::Error);
  EXPECT_THROW(ScaleFit({{60, 70}, {70, std::nan("")}, {80, 90}}), options::Error);
}

TEST(ScaleFit, ReadsPairsAndNamesBadLines) {
  const test::TempFolder folder;
  const auto pairs = ScaleFit::readPairs(writtenPairs(folder, "# measured\n" + tableText()));
  ASSERT_EQ(pairs.size(), 10u);
  EXPECT_EQ(pairs[9].ceiling_px, 254.0);
  for (const char* bad : {"62,74\n70\n", "62,74\n70,80,90\n", "62,74\n70,abc\n", "62,74\n-70,80\n"}) {
    try {
      ScaleFit::readPairs(writtenPairs(folder, bad));
      FAIL() << bad;
    } catch (const options::Error& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("pairs.csv:2:"));
    }
  }
  EXPECT_THROW(ScaleFit::readPairs(writtenPairs(folder, "\n")), options::Error);
  EXPECT_THROW(ScaleFit::readPairs(folder / "missing.csv"), options::Error);
}

TEST(FitScale, WritesAFileThatGivesTheSameScale) {
  const test::TempFolder folder;
  fit_scale::Options options;
  options.pairs = writtenPairs(folder, tableText());
  options.out = folder / "out/scale.yaml";
  options.plot = folder / "alpha.png";
  const ScaleFit fit = fit_scale::run(options);
  const ScaleFit again = ScaleFit::load(options.out);
  EXPECT_EQ(again.degree(), fit.degree());
  for (double d = 62; d <= 121; d += 3) EXPECT_NEAR(*again.alpha(d), *fit.alpha(d), 1e-9);
  EXPECT_FALSE(again.alpha(61));
  const cv::Mat picture = cv::imread(options.plot);
  EXPECT_EQ(picture.size(), cv::Size(800, 600));
  const std::string table = fit_scale::table(fit);
  EXPECT_THAT(table, testing::HasSubstr("2.0992"));  // 254/121
  EXPECT_THAT(table, testing::HasSubstr("%"));
}

TEST(FitScale, WritesAnOverlayForTheLiteralMethod) {
  const test::TempFolder folder;
  fit_scale::Options options;
  options.pairs = writtenPairs(folder, tableText());
  options.out = folder / "it's/scale.yaml";
  options.overlay = folder / "overlay.yaml";
  EXPECT_THROW(fit_scale::run(options), options::Error);  // without metres per pixel
  options.metres_per_ceiling_px = 0.0042;
  fit_scale::run(options);
  const auto literal = options::Section::load(options.overlay)
                           .child("services")
                           .child("local_mapper")
                           .child("distance_vector")
                           .child("literal");
  const LiteralOptions read = LiteralOptions::read(literal);
  EXPECT_EQ(read.metres_per_ceiling_px, 0.0042);
  EXPECT_EQ(ScaleFit::load(read.scale_file).pairs().size(), 10u);
}

TEST(FitScale, RefusesDistancesOutsideOfThePairs) {
  const ScaleFit fit(paperTable());
  EXPECT_THAT(fit_scale::converted(fit, {75.0}), testing::HasSubstr("75 px ->"));
  try {
    fit_scale::converted(fit, {75.0, 150.0});
    FAIL() << "extrapolated";
  } catch (const options::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("150 px is outside of the fitted interval 62-121 px"));
  }
}

}  // namespace
}  // namespace omnifleet::distance_vector
