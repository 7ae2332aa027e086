#include "tests/raycast/room_decoration.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::raycast {
namespace {

using Colour = Eigen::Vector3d;

constexpr double kToCorner_m = 0.3;  // from the end of a wall to the first fixture

/// What all walls of a house have in common.
struct Style {
  Colour skirting, leaf, frame, curtain;
  double skirting_m = 0.0;
  bool dado = false;  ///< the lower part of the walls has another colour
  Colour dado_colour;
};

Style styleOf(Random& random) {
  Style style;
  const Colour wood(0.48, 0.30, 0.16), white(0.80, 0.80, 0.76), grey(0.35, 0.38, 0.42);
  const auto material = [&] {
    const Colour materials[] = {wood, white, grey};
    return Colour(random.between(0.8, 1.15) * materials[random.below(3)]);
  };
  style.skirting = material();
  style.leaf = material();
  style.frame = random.between(0.5, 0.8) * material();
  style.curtain = random.colour(0.1, 0.7);
  style.skirting_m = random.between(0.05, 0.10);
  style.dado = random.below(3) == 0;
  style.dado_colour = random.colour(0.25, 0.75);
  return style;
}

/// One inner side of a wall.
class Side {
 public:
  Side(const House& house, Solid& wall, const Eigen::Vector2d& normal)
      : house_(house), wall_(wall), normal_(normal), along_(-normal.y(), normal.x()) {}

  double length() const { return std::abs(wall_.size_m.dot(along_)); }

  /// The place 5 cm in front of the side, in the map.
  Eigen::Vector2d placeAt(double along_m) const {
    const double out = 0.5 * std::abs(wall_.size_m.dot(normal_)) + 0.05;
    return wall_.map_from_solid * Eigen::Vector2d(out * normal_ + along_m * along_);
  }
  bool isInside(double along_m) const { return contains(house_.inside, placeAt(along_m)); }

  void add(double begin_m, double end_m, double bottom_m, double top_m, const Colour& albedo,
           double stripe_m = 0.0) {
    wall_.panels.push_back({normal_, begin_m, end_m, bottom_m, top_m, albedo, stripe_m});
  }

 private:
  const House& house_;
  Solid& wall_;
  Eigen::Vector2d normal_, along_;
};

enum class Fixture { kDoor, kGlazedDoor, kRadiator, kCurtain, kPinBoard, kSocket, kCount };

double widthOf(Fixture fixture, Random& random) {
  switch (fixture) {
    case Fixture::kDoor:
      return random.between(0.95, 1.1);
    case Fixture::kGlazedDoor:
      return random.between(0.9, 1.6);
    case Fixture::kRadiator:
      return random.between(0.7, 1.5);
    case Fixture::kCurtain:
      return random.between(0.4, 1.0);
    case Fixture::kPinBoard:
      return random.between(0.5, 1.2);
    default:
      return 0.08;
  }
}

void addFixture(Side& side, Fixture fixture, double begin, double end, const Style& style, Random& random) {
  constexpr double kFrame_m = 0.07, kDoor_m = 2.05;
  const Colour white(0.78, 0.78, 0.75);
  switch (fixture) {
    case Fixture::kDoor:
      side.add(begin, end, 0.0, kDoor_m, style.frame);
      side.add(begin + kFrame_m, end - kFrame_m, 0.0, kDoor_m - kFrame_m, style.leaf);
      break;
    case Fixture::kGlazedDoor:
      side.add(begin, end, 0.0, kDoor_m, white);
      side.add(begin + kFrame_m, end - kFrame_m, 0.12, kDoor_m - kFrame_m, {0.85, 0.92, 0.98});
      break;
    case Fixture::kRadiator:
      side.add(begin, end, 0.12, random.between(0.5, 0.75), white, 0.05);
      side.add(begin, end, 0.9, 2.0, {0.85, 0.92, 0.98});  // the window above
      break;
    case Fixture::kCurtain:
      side.add(begin, end, 0.02, 2.2, style.curtain, random.between(0.08, 0.14));
      break;
    case Fixture::kPinBoard: {
      const double bottom = random.between(0.2, 0.45);
      side.add(begin, end, bottom, bottom + random.between(0.4, 0.9), random.colour(0.05, 0.8));
      side.add(begin + 0.05, begin + 0.26, bottom + 0.06, bottom + 0.35, random.colour(0.3, 0.85));
      side.add(end - 0.2, end - 0.06, bottom + 0.04, bottom + 0.24, random.colour(0.05, 0.85));
      break;
    }
    default:
      side.add(begin, end, 0.26, 0.34, white);
  }
}

/// Fixtures one after another, with 0.2 to 1.1 m in between. Returns the middles of the doors.
std::vector<Eigen::Vector2d> furnishSide(Side& side, bool with_door, const Style& style, Random& random) {
  const double half = 0.5 * side.length();
  if (style.dado) side.add(-half, half, 0.0, 0.9, style.dado_colour);
  side.add(-half, half, 0.0, style.skirting_m, style.skirting);
  std::vector<Eigen::Vector2d> doors;
  double end = -half + kToCorner_m;
  for (;;) {
    const double begin = end + random.between(0.2, 1.1);
    Fixture fixture = static_cast<Fixture>(random.below(static_cast<int>(Fixture::kCount)));
    if (with_door && doors.empty()) fixture = Fixture::kDoor;
    end = begin + widthOf(fixture, random);
    if (end > half - kToCorner_m) return doors;
    const double middle = 0.5 * (begin + end);
    if (!side.isInside(begin) || !side.isInside(middle) || !side.isInside(end)) continue;
    addFixture(side, fixture, begin, end, style, random);
    if (fixture == Fixture::kDoor || fixture == Fixture::kGlazedDoor) doors.push_back(side.placeAt(middle));
  }
}

Front frontFor(const Solid& piece, Random& random) {
  const double shorter = piece.size_m.minCoeff(), longer = piece.size_m.maxCoeff();
  if (piece.round || piece.height_m < 0.4) return Front::kPlain;
  if (shorter <= 0.4 && longer >= 0.55 && piece.height_m >= 0.9) return Front::kBooks;
  if (piece.height_m >= 1.6) return Front::kDoors;
  if (longer >= 1.3) return Front::kCushions;
  return random.below(2) == 0 ? Front::kDrawers : Front::kPlain;
}

}  // namespace

void decorateWalls(House& house, Random& random) {
  const Style style = styleOf(random);
  double longest_m = 0.0;
  for (const Solid& wall : house.walls) longest_m = std::max(longest_m, wall.size_m.maxCoeff());
  for (Solid& wall : house.walls) {
    if (wall.surface != Surface::kMatt) continue;
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Vector2d normal =
          wall.size_m.x() > wall.size_m.y() ? Eigen::Vector2d(0.0, sign) : Eigen::Vector2d(sign, 0.0);
      Side side(house, wall, normal);
      if (!side.isInside(-0.5 * side.length() + kToCorner_m)) continue;
      const bool is_long = wall.size_m.maxCoeff() == longest_m;
      for (const Eigen::Vector2d& door : furnishSide(side, is_long, style, random))
        house.doors.push_back(door);
    }
  }
}

void decorateFurniture(House& house, Random& random) {
  for (Solid& piece : house.furniture) {
    piece.front = frontFor(piece, random);
    piece.texture = static_cast<unsigned>(random.below(1 << 20));
  }
}

}  // namespace omnifleet::raycast
