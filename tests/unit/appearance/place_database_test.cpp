#include "appearance/place_database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <random>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"
#include "tests/unit/appearance/textured_room.h"

namespace omnifleet::appearance {
namespace {

struct Stored {
  SignatureFormat format;
  StoredSignature signature;
};

Stored storedAt(const test::TexturedRoom& room, const Pose2& pose) {
  static const Unwrapper kUnwrapper = test::roomUnwrapper();
  static SignatureMaker maker(kUnwrapper, {});
  const Signature signature = maker.compute(room.panorama(pose, {}));
  return {signature.format, store(signature)};
}

SignatureFormat smallFormat() {
  SignatureFormat format;
  format.rows = format.stored_rows = 3;
  format.columns = 64;
  format.stored_modules = 10;
  format.stored_phases = 4;
  format.camera = "random 1x1";
  return format;
}

StoredSignature randomSignature(std::mt19937& random) {
  StoredSignature signature;
  for (int k = 0; k < 3 * 14; ++k) signature.bytes.push_back(static_cast<std::uint8_t>(random() & 255));
  signature.scale = {10.0f, 20.0f, 30.0f};
  return signature;
}

TEST(PlaceDatabase, EqualsExhaustiveSearch) {
  std::mt19937 random(1);
  PlaceDatabase database(smallFormat());
  std::vector<StoredSignature> places;
  for (int i = 0; i < 500; ++i) {
    places.push_back(randomSignature(random));
    EXPECT_EQ(database.add(smallFormat(), places.back()), static_cast<std::uint32_t>(i));
  }
  const StoredSignature query = randomSignature(random);
  std::vector<std::pair<double, std::uint32_t>> all;
  for (std::uint32_t i = 0; i < places.size(); ++i) {
    const auto logs = [&](const StoredSignature& s) {
      // Modules only; the phases depend on the heading. 0.3 grey levels are noise.
      Eigen::ArrayXd values(30);
      for (int row = 0; row < 3; ++row) {
        for (int k = 0; k < 10; ++k)
          values[10 * row + k] = 0.3 + s.scale[row] * s.bytes[row * 14 + k] / 255.0;
      }
      return Eigen::ArrayXd(values.log() - values.log().mean());
    };
    all.emplace_back((logs(query) - logs(places[i])).abs().mean(), i);
  }
  std::sort(all.begin(), all.end());
  const auto matches = database.nearest(smallFormat(), query, 7);
  ASSERT_EQ(matches.size(), 7u);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    // Each logarithm is rounded to 1/24, so the mean of 30 differences is off by 0.02 at most in 4 σ.
    EXPECT_NEAR(matches[i].distance, all[i].first, 0.02);
    const auto place =
        std::find_if(all.begin(), all.end(), [&](const auto& a) { return a.second == matches[i].index; });
    EXPECT_LT(place->first, all[6].first + 0.02);
  }
  EXPECT_EQ(database.nearest(smallFormat(), query, 1000).size(), 500u);
  EXPECT_LT(database.nearest(smallFormat(), query, 1, 20).front().index, 20u);
  EXPECT_TRUE(database.nearest(smallFormat(), query, 0).empty());
  EXPECT_TRUE(PlaceDatabase(smallFormat()).nearest(smallFormat(), query, 3).empty());
}

TEST(PlaceDatabase, FindsPlaceAtAnyHeading) {
  const test::TexturedRoom room(4);
  std::vector<Pose2> poses;
  for (int x = -3; x <= 3; ++x) {
    for (int y = -2; y <= 2; ++y) poses.push_back({0.6 * x, 0.6 * y, 0.0});
  }
  PlaceDatabase database(storedAt(room, {}).format);
  for (const Pose2& pose : poses) {
    const Stored stored = storedAt(room, pose);
    database.add(stored.format, stored.signature);
  }
  for (std::size_t i = 0; i < poses.size(); i += 4) {
    // 5 cm beside the place, at another heading; the next place is 60 cm away.
    const Stored query =
        storedAt(room, {poses[i].x_m + 0.04, poses[i].y_m - 0.03, 0.3 * static_cast<double>(i)});
    EXPECT_EQ(database.nearest(query.format, query.signature, 1).front().index, i);
  }
}

TEST(PlaceDatabase, RefusesOtherFormatByField) {
  std::mt19937 random(2);
  PlaceDatabase database(smallFormat());
  SignatureFormat other = smallFormat();
  other.camera = "random 2x2";
  try {
    database.add(other, randomSignature(random));
    FAIL() << "a place of another camera must be refused";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("camera is random 1x1 and random 2x2"));
  }
  StoredSignature cut = randomSignature(random);
  cut.bytes.pop_back();
  EXPECT_THROW(database.nearest(smallFormat(), cut, 1), std::invalid_argument);
  EXPECT_EQ(database.size(), 0u);
}

}  // namespace
}  // namespace omnifleet::appearance
