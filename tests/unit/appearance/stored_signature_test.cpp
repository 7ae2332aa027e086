#include "appearance/stored_signature.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "appearance/compass.h"
#include "geometry/pose2.h"
#include "tests/unit/appearance/textured_room.h"

namespace omnifleet::appearance {
namespace {

Signature signatureAt(const Pose2& pose) {
  static const Unwrapper kUnwrapper = test::roomUnwrapper();
  static SignatureMaker maker(kUnwrapper, {});
  return maker.compute(test::TexturedRoom(3).panorama(pose, {}));
}

TEST(StoredSignature, TakesAtMostTwoKilobytes) {
  const StoredSignature stored = store(signatureAt({}));
  EXPECT_EQ(stored.bytes.size(), 8u * (128u + 64u));
  EXPECT_EQ(stored.scale.size(), 8u);
  EXPECT_LE(stored.bytes.size() + stored.scale.size() * sizeof(float), 2048u);
}

TEST(StoredSignature, ReturnsMeansOfRowsWithinHalfAUnit) {
  const Signature signature = signatureAt({0.3, 0.1, 1.0});
  const StoredSignature stored = store(signature);
  const Signature back = restore(signature.format, stored);
  ASSERT_EQ(back.modules.rows(), 8);
  for (int row = 0; row < 8; ++row) {
    const float unit = stored.scale[static_cast<std::size_t>(row)] / 255.0f;
    for (int k = 0; k < 64; ++k) {
      const std::complex<float> mean =
          0.5f * (signature.spectrum(2 * row, k) + signature.spectrum(2 * row + 1, k));
      EXPECT_NEAR(back.modules(row, k), std::abs(mean), 0.501f * unit);
      // A phase is half a unit of 2π/256 off at most.
      EXPECT_LT(std::abs(back.spectrum(row, k) - mean), 0.51f * unit + 0.0124f * std::abs(mean));
    }
  }
}

TEST(StoredSignature, StillCarriesTheTurn) {
  const Signature a = signatureAt({0.0, 0.0, 0.0}), b = signatureAt({0.0, 0.0, 2.0});
  Compass compass;
  const CompassResult result = compass.compare(restore(a.format, store(a)), restore(b.format, store(b)));
  EXPECT_TRUE(result.valid);
  EXPECT_NEAR(result.turn_rad, 2.0, 0.003);  // 8 rows and bytes instead of 16 rows and floats
}

TEST(StoredSignature, RefusesSizesThatContradictFormat) {
  const Signature signature = signatureAt({});
  StoredSignature stored = store(signature);
  EXPECT_EQ(whyMalformed(signature.format, stored), "");
  stored.bytes.pop_back();
  EXPECT_THAT(whyMalformed(signature.format, stored), testing::HasSubstr("1535 bytes, its format 1536"));
  EXPECT_THROW(restore(signature.format, stored), std::invalid_argument);
  stored = store(signature);
  stored.scale[2] = std::nanf("");
  EXPECT_THROW(restore(signature.format, stored), std::invalid_argument);
  stored.scale.pop_back();
  EXPECT_THROW(restore(signature.format, stored), std::invalid_argument);
}

}  // namespace
}  // namespace omnifleet::appearance
