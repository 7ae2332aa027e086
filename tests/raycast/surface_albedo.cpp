#include "tests/raycast/surface_albedo.h"

#include <algorithm>
#include <cmath>

#include "tests/raycast/value_noise.h"

namespace omnifleet::raycast {
namespace {

using Vector = Eigen::Vector3d;

/// Share of an interval of length `blur_m` around `at_m` that lies in joints of `width_m`, one per
/// `period_m`.
double coveredShare(double at_m, double blur_m, double width_m, double period_m) {
  double covered_m = 0.0;
  for (const double begin_m : {0.0, period_m})
    covered_m += std::max(
        0.0, std::min(at_m + 0.5 * blur_m, begin_m + width_m) - std::max(at_m - 0.5 * blur_m, begin_m));
  return std::min(1.0, covered_m / blur_m);
}

Vector parquet(Vector albedo, double x, double y, unsigned seed, double blur_m) {
  constexpr double kWide = 0.09, kLong = 0.9;
  const int row = static_cast<int>(std::floor(y / kWide));
  const double along = (x + 0.37 * row + randomAt(row, 7, seed)) / kLong;
  const int plank = static_cast<int>(std::floor(along));
  const double bright = 1 + 0.18 * (randomAt(row, plank, seed) - 0.5),
               hue = 0.05 * (randomAt(row, plank, seed + 1) - 0.5),
               texture = 1 + 0.10 * (smoothAt(8 * x, 150 * y, seed + 2) - 0.5);
  albedo = bright * texture * albedo.cwiseProduct(Vector(1 + hue, 1.0, 1 - hue));
  const double across = y / kWide - row;
  if (blur_m > 0.0) {
    const double joint = std::max(coveredShare(kWide * across, blur_m, 0.012 * kWide, kWide),
                                  coveredShare(kLong * (along - plank), blur_m, 0.0015 * kLong, kLong));
    return (1.0 - 0.45 * joint) * albedo;
  }
  const bool joint = across < 0.012 || along - plank < 0.0015;
  return joint ? Vector(0.55 * albedo) : albedo;
}

/// Each fibre (cell of 4 mm) has its own random hue. Four samples of different fibres halve the contrast.
Vector carpet(Vector albedo, double x, double y, unsigned seed, double blur_m) {
  constexpr double kFibre = 0.004;
  const int i = static_cast<int>(std::floor(x / kFibre)), j = static_cast<int>(std::floor(y / kFibre));
  const double contrast = 0.35 / std::clamp(2.0 * blur_m / kFibre, 1.0, 2.0);
  for (unsigned k = 0; k < 3; ++k) albedo[k] *= 1 + contrast * (randomAt(i, j, seed + k) - 0.5);
  return (1 + 0.15 * (smoothAt(6 * x, 6 * y, seed) - 0.5)) * albedo;
}

Vector lino(const Vector& albedo, double x, double y, unsigned seed) {
  return (1 + 0.16 * (smoothAt(15 * x + 4 * smoothAt(3 * x, 3 * y, seed), 15 * y, seed + 3) - 0.5)) * albedo;
}

Vector concrete(const Vector& albedo, double x, double y, unsigned seed) {
  const double stain = std::max(0.0, smoothAt(1.3 * x, 1.3 * y, seed + 5) - 0.65);
  const double mottle =
      1 + 0.10 * (smoothAt(40 * x, 40 * y, seed) - 0.5) + 0.12 * (smoothAt(4 * x, 4 * y, seed + 2) - 0.5);
  return mottle * (1 - 0.6 * stain) * albedo;
}

/// Books stand between boards 32 cm apart; each spine has its own colour and height.
Vector books(const Solid& solid, double along, double up, unsigned seed) {
  constexpr double kShelf_m = 0.32, kBoard_m = 0.02, kSpine_m = 0.032, kPlinth_m = 0.06;
  const int shelf = static_cast<int>(std::floor((up - kPlinth_m) / kShelf_m));
  const double above = up - kPlinth_m - shelf * kShelf_m;
  if (up < kPlinth_m || above < kBoard_m) return solid.albedo;
  const int spine = static_cast<int>(std::floor(along / kSpine_m + 0.6 * randomAt(shelf, 3, seed)));
  const double height = (kShelf_m - kBoard_m) * (0.55 + 0.4 * randomAt(spine, shelf, seed + 1));
  if (above - kBoard_m > height || randomAt(spine / 4, shelf, seed + 2) < 0.2) return 0.15 * solid.albedo;
  return {0.05 + 0.6 * randomAt(spine, shelf, seed + 3), 0.05 + 0.6 * randomAt(spine, shelf, seed + 4),
          0.05 + 0.6 * randomAt(spine, shelf, seed + 5)};
}

/// True within `gap_m` of a multiple of `period_m`.
bool isGap(double at_m, double period_m, double gap_m) {
  return std::abs(at_m - period_m * std::round(at_m / period_m)) < 0.5 * gap_m;
}

Vector frontOf(const Solid& solid, double along, double width, double up, unsigned seed) {
  constexpr double kGap_m = 0.008, kDark = 0.25;
  switch (solid.front) {
    case Front::kBooks:
      if (0.5 * width - std::abs(along) < 0.02) return solid.albedo;
      return books(solid, along, up, seed);
    case Front::kDoors:
      if (up < 0.07) return kDark * solid.albedo;
      return (isGap(along, 0.5 * width, kGap_m) ? kDark : 1.0) * solid.albedo;
    case Front::kDrawers: {
      const bool handle = std::abs(along) < 0.06 && std::abs(up - 0.2 * std::floor(up / 0.2) - 0.12) < 0.012;
      if (handle) return Vector::Constant(0.6);
      return (isGap(up, 0.2, kGap_m) ? kDark : 1.0) * solid.albedo;
    }
    case Front::kCushions:
      if (up < 0.05) return kDark * solid.albedo;
      return (isGap(along, width / 3.0, 2.0 * kGap_m) || isGap(up, 0.4, 2.0 * kGap_m) ? 0.6 : 1.0) *
             solid.albedo;
    default:
      return solid.albedo;
  }
}

/// The panel in front at this place of a side; null if there is none.
const Panel* panelAt(const Solid& solid, const Eigen::Vector2d& normal, double along, double up) {
  for (auto panel = solid.panels.rbegin(); panel != solid.panels.rend(); ++panel)
    if (panel->normal.dot(normal) > 0.5 && along > panel->begin_m && along < panel->end_m &&
        up > panel->bottom_m && up < panel->top_m)
      return &*panel;
  return nullptr;
}

}  // namespace

Vector floorAlbedo(const Room& room, const Eigen::Vector2d& at, double blur_m) {
  for (auto marking = room.markings.rbegin(); marking != room.markings.rend(); ++marking) {
    const Eigen::Vector2d own = marking->map_from_marking.inverse() * at;
    if ((2.0 * own.cwiseAbs() - marking->size_m).maxCoeff() < 0) return marking->albedo;
  }
  switch (room.floor) {
    case Floor::kParquet:
      return parquet(room.floor_albedo, at.x(), at.y(), room.seed, blur_m);
    case Floor::kCarpet:
      return carpet(room.floor_albedo, at.x(), at.y(), room.seed, blur_m);
    case Floor::kConcrete:
      return concrete(room.floor_albedo, at.x(), at.y(), room.seed);
    case Floor::kPlain:
      return room.floor_albedo;
    default:
      return lino(room.floor_albedo, at.x(), at.y(), room.seed);
  }
}

Vector solidAlbedo(const Room& room, const Solid& solid, const Vector& at, const Vector& own,
                   const Vector& own_normal) {
  const int square =
      static_cast<int>(std::floor(25 * at.z())) + static_cast<int>(std::floor(15 * (at.x() + at.y())));
  const double factor = solid.chequered && square % 2 != 0 ? 0.7 : 1.0;
  if ((solid.panels.empty() && solid.front == Front::kPlain) || own_normal.z() > 0.5)
    return factor * solid.albedo;
  const Eigen::Vector2d normal = own_normal.head<2>(), beside(-normal.y(), normal.x());
  const double along = own.head<2>().dot(beside), up = own.z();
  const Panel* panel = panelAt(solid, normal, along, up);
  if (panel == nullptr)
    return factor * frontOf(solid, along, std::abs(solid.size_m.dot(beside)), up, room.seed + solid.texture);
  const bool dark =
      panel->stripe_m > 0.0 && std::fmod(along - panel->begin_m, panel->stripe_m) < 0.4 * panel->stripe_m;
  return (dark ? 0.65 : 1.0) * panel->albedo;
}

}  // namespace omnifleet::raycast
