// Panoramas that others took in a house: exact rotations, turns between near places, retrieval of places.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "appearance/compass.h"
#include "appearance/place_database.h"
#include "appearance/stored_signature.h"
#include "geometry/pose2.h"
#include "tests/test_data.h"

namespace omnifleet::appearance {
namespace {

constexpr double kDegree = M_PI / 180.0;

struct HousePanorama {
  std::string room, name;
  Eigen::Vector2d position_m;
  double heading_rad = 0.0;
  cv::Mat image;
  cv::Mat1b panorama;
  Signature signature;
};

class PanoramaHouse : public testing::Test {
 protected:
  void SetUp() override {
    OMNIFLEET_NEEDS_DATA(folder, "panorama_house");
    std::ifstream file(folder + "/zind_data.json");
    const nlohmann::json data = nlohmann::json::parse(file);
    const double metres = data["scale_meters_per_coordinate"]["floor_01"];
    // These cameras see the whole sphere: the band holds the walls.
    options_.least_elevation_deg = -25.0;
    options_.most_elevation_deg = 25.0;
    unwrapper_ = std::make_unique<Unwrapper>(Unwrapper::fromEquirectangular({2048, 1024}, options_));
    SignatureMaker maker(*unwrapper_, {});
    for (const auto& [room, parts] : data["merger"]["floor_01"].items()) {
      for (const auto& [part, panoramas] : parts.items()) {
        for (const auto& [name, entry] : panoramas.items()) {
          const auto& place = entry["floor_plan_transformation"];
          HousePanorama p;
          p.room = room;
          p.name = name;
          p.position_m = metres * Eigen::Vector2d(place["translation"][0], place["translation"][1]);
          // The rotation of the data is clockwise (README of the folder: columns shift against it).
          p.heading_rad = -double(place["rotation"]) * kDegree;
          p.image = cv::imread(folder + "/" + entry["image_path"].get<std::string>());
          ASSERT_FALSE(p.image.empty()) << name;
          unwrapper_->unwrap(p.image, p.panorama);
          p.signature = maker.compute(p.panorama);
          panoramas_.push_back(p);
        }
      }
    }
    ASSERT_EQ(panoramas_.size(), 32u);
  }

  const HousePanorama& named(const std::string& name) const {
    return *std::find_if(panoramas_.begin(), panoramas_.end(), [&](const auto& p) { return p.name == name; });
  }
  double turnTruth(const HousePanorama& from, const HousePanorama& to) const {
    return wrapAngle(to.heading_rad - from.heading_rad);
  }

  PanoramaOptions options_;
  std::unique_ptr<Unwrapper> unwrapper_;
  std::vector<HousePanorama> panoramas_;
};

TEST_F(PanoramaHouse, RotationsByColumnShiftAreExact) {
  SignatureMaker maker(*unwrapper_, {});
  Compass compass;
  double largest = 0.0;
  for (const HousePanorama& p : panoramas_) {
    for (const int q : {1, 3, 50, 211, 400}) {
      cv::Mat1b turned(p.panorama.size());
      for (int c = 0; c < 512; ++c) p.panorama.col((c + q) % 512).copyTo(turned.col(c));
      const CompassResult result = compass.compare(p.signature, maker.compute(turned), {0.0, 0.02, 0.0});
      largest = std::max(largest, std::abs(wrapAngle(result.turn_rad - 2.0 * M_PI * q / 512)) / kDegree);
      EXPECT_GT(result.confidence, 0.5) << p.name;
    }
  }
  std::printf("rotations: largest error %.4f degrees\n", largest);
  EXPECT_LT(largest, 0.05);
}

TEST_F(PanoramaHouse, TurnBetweenNearPlacesIsRight) {
  const HousePanorama &a = named("pano_2"), &b = named("pano_3");
  const Eigen::Vector2d way = b.position_m - a.position_m;
  EXPECT_NEAR(way.norm(), 0.12, 0.01);
  Compass compass;
  CompassOptions literal;
  literal.method = CompassMethod::kLiteral;
  const double truth = turnTruth(a, b);
  const CompassResult result = compass.compare(a.signature, b.signature),
                      paper = Compass(literal).compare(a.signature, b.signature);
  std::printf("0.12 m apart: truth %.2f, parallax %.2f (sigma %.2f, confidence %.2f), literal %.2f degrees\n",
              truth / kDegree, result.turn_rad / kDegree, result.sigma_rad / kDegree, result.confidence,
              paper.turn_rad / kDegree);
  EXPECT_LT(std::abs(wrapAngle(result.turn_rad - truth)) / kDegree,
            1.5);  // the poses are hand-made to about 1°
}

TEST_F(PanoramaHouse, ConfidenceIsLowWhereCompassIsWrong) {
  Compass compass;
  int wrong = 0, wrong_confident = 0, right = 0, right_confident = 0, rooms_confident = 0, rooms = 0;
  double worst = 0.0;
  for (std::size_t i = 0; i < panoramas_.size(); ++i) {
    for (std::size_t j = i + 1; j < panoramas_.size(); ++j) {
      const CompassResult result = compass.compare(panoramas_[i].signature, panoramas_[j].signature);
      const bool confident = result.confidence > 0.5;
      if (panoramas_[i].room != panoramas_[j].room) {
        ++rooms;
        rooms_confident += confident ? 1 : 0;
        continue;
      }
      const double error =
          std::abs(wrapAngle(result.turn_rad - turnTruth(panoramas_[i], panoramas_[j]))) / kDegree;
      const bool is_wrong = error > 10.0;
      (is_wrong ? wrong : right) += 1;
      (is_wrong ? wrong_confident : right_confident) += confident ? 1 : 0;
      if (is_wrong) worst = std::max(worst, result.confidence);
    }
  }
  std::printf(
      "same room: %d wrong by more than 10 degrees, %d of them with confidence > 0.5 (highest %.2f); %d "
      "right, %d with "
      "confidence > 0.5; different rooms: %d pairs, %d with confidence > 0.5\n",
      wrong, wrong_confident, worst, right, right_confident, rooms, rooms_confident);
  EXPECT_GT(wrong, 20);  // bare walls, 1 to 10 m apart: most answers are wrong
  EXPECT_EQ(wrong_confident, 0);
  EXPECT_EQ(rooms_confident, 0);
  EXPECT_GE(right_confident, 1);
}

TEST_F(PanoramaHouse, RetrievesPlacesOfSameRoomWithoutFalseMatch) {
  struct Retrieved {
    double distance;
    bool same_room;
  };
  // Rooms differ most in the layout of the whole sphere, and in its coarse structure.
  PanoramaOptions sphere;
  sphere.least_elevation_deg = -80.0;
  sphere.most_elevation_deg = 80.0;
  SignatureOptions options;
  options.stored_rows = 16;
  options.stored_modules = 64;
  options.stored_phases = 32;
  PlaceDatabaseOptions coarse;
  coarse.modules = 8;
  const Unwrapper unwrapper = Unwrapper::fromEquirectangular({2048, 1024}, sphere);
  SignatureMaker maker(unwrapper, options);
  std::vector<StoredSignature> stored;
  for (const HousePanorama& p : panoramas_) {
    cv::Mat1b panorama;
    unwrapper.unwrap(p.image, panorama);
    stored.push_back(store(maker.compute(panorama)));
  }
  std::vector<Retrieved> found;
  int findable = 0;
  for (std::size_t i = 0; i < panoramas_.size(); ++i) {
    PlaceDatabase database(maker.format(), coarse);
    std::vector<std::string> rooms;
    for (std::size_t j = 0; j < panoramas_.size(); ++j) {
      if (j == i) continue;
      database.add(maker.format(), stored[j]);
      rooms.push_back(panoramas_[j].room);
    }
    findable += std::count(rooms.begin(), rooms.end(), panoramas_[i].room) > 0 ? 1 : 0;
    const auto match = database.nearest(maker.format(), stored[i], 1).front();
    found.push_back({match.distance, rooms[match.index] == panoramas_[i].room});
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.distance < b.distance; });
  std::printf("precision and recall of the nearest panorama (%d of 32 have another one in their room)\n",
              findable);
  int right = 0, right_before_false = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    right += found[i].same_room ? 1 : 0;
    if (right == static_cast<int>(i) + 1) right_before_false = right;
    std::printf("  distance <= %.4f: precision %.2f, recall %.2f\n", found[i].distance,
                double(right) / double(i + 1), double(right) / findable);
  }
  std::printf("recall without a false match %.2f; all: %d of %d\n", double(right_before_false) / findable,
              right, findable);
  // Bare rooms, 0.3 to 3 m apart: most places look like others elsewhere, so a threshold without a false
  // match finds one place in four.
  EXPECT_GE(right_before_false, 4);
  EXPECT_GE(right, 8);
}

}  // namespace
}  // namespace omnifleet::appearance
