#include "appearance/signature.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "tests/unit/appearance/textured_room.h"

namespace omnifleet::appearance {
namespace {

cv::Mat1b shifted(const cv::Mat1b& panorama, int columns) {
  cv::Mat1b out(panorama.size());
  for (int c = 0; c < panorama.cols; ++c) panorama.col(c).copyTo(out.col((c + columns) % panorama.cols));
  return out;
}

class SignatureTest : public testing::Test {
 protected:
  const Unwrapper unwrapper_ = test::roomUnwrapper();
  const cv::Mat1b panorama_ = test::TexturedRoom(1).panorama({0.4, -0.3, 0.2}, {});
};

TEST_F(SignatureTest, EqualsDiscreteFourierTransformOfRows) {
  SignatureOptions options;
  options.rows = options.stored_rows = 64;  // the paper's: each row of the panorama
  options.stored_modules = options.stored_phases = 8;
  const Signature signature = SignatureMaker(unwrapper_, options).compute(panorama_);
  ASSERT_EQ(signature.spectrum.rows(), 64);
  for (const int row : {0, 31, 63}) {
    for (const int k : {1, 5, 64, 128}) {
      std::complex<double> sum = 0.0;
      for (int n = 0; n < 512; ++n)
        sum += double(panorama_(row, n)) * std::polar(1.0, -2.0 * M_PI * k * n / 512);
      sum /= 512.0;
      // Single precision of a sum of 512 grey levels.
      EXPECT_NEAR(std::abs(std::complex<double>(signature.spectrum(row, k - 1)) - sum), 0.0, 1e-4);
      EXPECT_NEAR(signature.modules(row, k - 1), std::abs(sum), 1e-4);
    }
  }
}

TEST_F(SignatureTest, ModulesIgnoreColumnShiftAndPhasesFollowEquation1) {
  SignatureMaker maker(unwrapper_, {});
  const Signature before = maker.compute(panorama_);
  for (const int q : {1, 7, 100, 300, 511}) {
    const Signature after = maker.compute(shifted(panorama_, q));
    EXPECT_LT(distance(before, after), 1e-4 * before.modules.matrix().norm()) << q;  // single precision
    for (int row = 0; row < 16; ++row) {
      for (int k = 1; k <= 64; ++k) {
        const std::complex<float> expected =
            before.spectrum(row, k - 1) * std::polar(1.0f, static_cast<float>(-2.0 * M_PI * q * k / 512));
        EXPECT_LT(std::abs(after.spectrum(row, k - 1) - expected), 2e-4f);
      }
    }
  }
}

TEST_F(SignatureTest, PhasesAreAnglesOfSpectrum) {
  const Signature signature = SignatureMaker(unwrapper_, {}).compute(panorama_);
  const Eigen::ArrayXXf phases = signature.phases(64);
  ASSERT_EQ(phases.cols(), 64);
  EXPECT_FLOAT_EQ(phases(3, 10), std::arg(signature.spectrum(3, 10)));
  EXPECT_THROW(signature.phases(129), std::invalid_argument);
}

TEST_F(SignatureTest, DistanceIsEquation2) {
  SignatureMaker maker(unwrapper_, {});
  const Signature a = maker.compute(panorama_),
                  b = maker.compute(test::TexturedRoom(1).panorama({0.5, -0.3, 0.2}, {}));
  double sum = 0.0, norm_a = 0.0, norm_b = 0.0;
  for (int row = 0; row < 16; ++row) {
    for (int k = 0; k < 128; ++k) {
      sum += std::pow(double(a.modules(row, k)) - double(b.modules(row, k)), 2);
      norm_a += std::pow(double(a.modules(row, k)), 2);
      norm_b += std::pow(double(b.modules(row, k)), 2);
    }
  }
  EXPECT_NEAR(distance(a, b), std::sqrt(sum), 1e-3);
  EXPECT_NEAR(difference(a, b), std::sqrt(sum) / (0.5 * (std::sqrt(norm_a) + std::sqrt(norm_b))), 1e-4);
  EXPECT_EQ(distance(a, a), 0.0);
}

TEST_F(SignatureTest, DistanceGrowsWithDisplacement) {
  const test::TexturedRoom room(2);
  SignatureMaker maker(unwrapper_, {});
  const Signature origin = maker.compute(room.panorama({0.0, 0.0, 0.0}, {}));
  double last = 0.0;
  for (const double metres : {0.02, 0.05, 0.1, 0.2}) {
    const double now = difference(origin, maker.compute(room.panorama({metres, 0.0, 2.0}, {})));
    EXPECT_GT(now, 1.2 * last) << metres;
    last = now;
  }
}

TEST_F(SignatureTest, ShapeDifferenceIgnoresExposure) {
  SignatureMaker maker(unwrapper_, {});
  cv::Mat1b darker;
  panorama_.convertTo(darker, CV_8U, 0.6, 20.0);
  const Signature a = maker.compute(panorama_), b = maker.compute(darker);
  EXPECT_GT(difference(a, b), 0.4);
  EXPECT_LT(shapeDifference(a, b), 0.01);  // rounding to grey levels
}

TEST_F(SignatureTest, InterpolatesOccludedSector) {
  cv::Mat1b occluded = panorama_.clone();
  occluded.colRange(100, 180).setTo(3);
  const Signature signature = SignatureMaker(unwrapper_, {}).compute(occluded);
  for (int c = 0; c < 512; ++c) EXPECT_EQ(signature.weight[c], c >= 99 && c <= 180 ? 0.0f : 1.0f) << c;
  // Without the interpolation the black sector dominates the spectrum.
  SignatureOptions literal;
  literal.dark_level = 0.0;
  const Signature plain = SignatureMaker(unwrapper_, literal).compute(occluded);
  EXPECT_EQ(plain.weight.minCoeff(), 1.0f);
  EXPECT_GT(plain.modules.matrix().norm(), 1.2f * signature.modules.matrix().norm());
}

TEST_F(SignatureTest, BlackPanoramaShowsNothing) {
  const Signature signature = SignatureMaker(unwrapper_, {}).compute(cv::Mat1b(64, 512, std::uint8_t{0}));
  EXPECT_EQ(signature.weight.maxCoeff(), 0.0f);
  EXPECT_EQ(signature.modules.maxCoeff(), 0.0f);
  EXPECT_EQ(difference(signature, signature), 0.0);
}

TEST_F(SignatureTest, RefusesOtherFormatsByFieldAndValues) {
  PanoramaOptions lower;
  lower.least_elevation_deg = -20.0;
  const Signature a = SignatureMaker(unwrapper_, {}).compute(panorama_);
  const Signature b = SignatureMaker(test::roomUnwrapper(lower), {}).compute(panorama_);
  try {
    distance(a, b);
    FAIL() << "signatures of different bands must not be compared";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("least elevation (degrees) is -12.0000 and -20.0000"));
  }
  const Unwrapper other_size = Unwrapper::fromEquirectangular({2048, 1024}, {});
  EXPECT_EQ(whyIncomparable(a.format, SignatureMaker(other_size, {}).format()),
            "camera is equirectangular 1024x512 and equirectangular 2048x1024");
  SignatureOptions more;
  more.stored_modules = 64;
  EXPECT_EQ(whyIncomparable(a.format, SignatureMaker(unwrapper_, more).format()),
            "stored modules is 128 and 64");
  EXPECT_EQ(whyIncomparable(a.format, a.format), "");
}

TEST_F(SignatureTest, RefusesImpossibleOptions) {
  SignatureOptions options;
  options.rows = 24;
  EXPECT_THROW(SignatureMaker(unwrapper_, options), options::Error);
  options.rows = 16;
  options.k1 = 256;
  EXPECT_THROW(SignatureMaker(unwrapper_, options), options::Error);
  SignatureMaker maker(unwrapper_, {});
  EXPECT_THROW(maker.compute(cv::Mat1b(64, 256)), std::invalid_argument);
}

}  // namespace
}  // namespace omnifleet::appearance
