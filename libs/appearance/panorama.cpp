#include "appearance/panorama.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

namespace omnifleet::appearance {
namespace {

constexpr double kDegree = M_PI / 180.0;
constexpr double kPixelsPerSample = 3.0;  ///< px: a cell of this width is still represented by one pixel

constexpr double kRim_px = 1.5;  ///< px: width of the mixed rim

const char* projectionName(const lens::CameraModel& model) {
  if (model.kind == lens::CameraKind::kEquirectangular) return "equirectangular";
  switch (model.projection) {
    case lens::Projection::kOrthographic:
      return "orthographic";
    case lens::Projection::kEquidistant:
      return "equidistant";
    case lens::Projection::kEquisolid:
      return "equisolid";
    case lens::Projection::kStereographic:
      return "stereographic";
    case lens::Projection::kKannalaBrandt:
      return "kannala_brandt";
    case lens::Projection::kOcam:
      return "ocam";
    case lens::Projection::kPinhole:
      break;
  }
  return "pinhole";
}

std::string describe(const std::string& projection, const cv::Size& image) {
  return fmt::format("{} {}x{}", projection, image.width, image.height);
}

bool inside(const Eigen::Vector2d& pixel, const cv::Size& image) {
  return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < image.width - 0.5 &&
         pixel.y() < image.height - 0.5;
}

Eigen::Vector3d direction(double bearing, double elevation) {
  return {std::cos(elevation) * std::cos(bearing), std::cos(elevation) * std::sin(bearing),
          std::sin(elevation)};
}

/// Pixel of a direction of base_link. Empty outside of the image and on the own body.
class CameraPixels {
 public:
  explicit CameraPixels(const lens::Camera& camera)
      : camera_(camera), camera_from_parent_(camera.parentFromCamera().linear().transpose()) {}

  std::optional<Eigen::Vector2d> operator()(double bearing, double elevation) const {
    const lens::CameraModel& model = camera_.model();
    const auto pixel = camera_.lens().pixelFromRay(camera_from_parent_ * direction(bearing, elevation));
    if (!pixel || !inside(*pixel, {model.image_width_px, model.image_height_px})) return std::nullopt;
    const Eigen::Vector2d outwards = *pixel - model.principal_point_px;
    const double radius_px = outwards.norm();
    if (radius_px < model.self_mask_radius_px) return std::nullopt;
    // The pixels at the rim of a fisheye image are mixed with the black beyond it.
    if (!camera_.lens().rayFromPixel(*pixel + outwards * (kRim_px / std::max(radius_px, 1.0))))
      return std::nullopt;
    return pixel;
  }

 private:
  const lens::Camera& camera_;
  Eigen::Matrix3d camera_from_parent_;
};

/// Largest elevation, at most `most`, that the camera sees at half of all bearings or more.
double seenElevation(const CameraPixels& pixels, double least, double most) {
  constexpr int kSteps = 64, kBearings = 90;
  for (int step = 0; step <= kSteps; ++step) {
    const double elevation = most - (most - least) * step / kSteps;
    int seen = 0;
    for (int k = 0; k < kBearings; ++k) seen += pixels(2.0 * M_PI * k / kBearings, elevation) ? 1 : 0;
    if (2 * seen >= kBearings) return elevation;
  }
  return most;
}

PixelSample sampleAt(const Eigen::Vector2d& pixel, const cv::Size& image) {
  auto x = std::clamp<long>(std::lround(pixel.x()), 0, image.width - 1);
  const auto y = std::clamp<long>(std::lround(pixel.y()), 0, image.height - 1);
  if (y == image.height - 1 && x == image.width - 1 && x > 0) --x;  // see averagePixels()
  return {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
}

/// Samples along one axis of a cell that is `extent_px` long.
int samplesFor(double extent_px, int max_samples) {
  return std::clamp(static_cast<int>(std::ceil(extent_px / kPixelsPerSample)), 1, max_samples);
}

}  // namespace

PanoramaOptions PanoramaOptions::read(const options::Section& section) {
  PanoramaOptions o;
  section.read("rows", o.rows, {1, 1024});
  section.read("columns", o.columns, {64, 4096});
  section.read("least_elevation_deg", o.least_elevation_deg, {-90.0, 90.0});
  section.read("most_elevation_deg", o.most_elevation_deg, {-90.0, 90.0});
  section.read("max_samples", o.max_samples, {1, 8});
  section.read("hidden_deg", o.hidden_deg, {-360.0, 720.0});
  if (o.columns % kBlockColumns != 0)
    section.fail("columns", fmt::format("must be a multiple of {}, got {}", kBlockColumns, o.columns));
  if (!(o.least_elevation_deg < o.most_elevation_deg))
    section.fail("least_elevation_deg", "must be below most_elevation_deg");
  if (o.hidden_deg.size() % 2 != 0) section.fail("hidden_deg", "needs pairs of bearings (begin, end)");
  section.finish();
  return o;
}

template <typename PixelOf>
Unwrapper Unwrapper::build(const cv::Size& image, const PanoramaOptions& options, double least_rad,
                           double most_rad, std::string camera, const PixelOf& pixelOf) {
  if (options.columns % kBlockColumns != 0 || image.width < 2 || image.width > UINT16_MAX ||
      image.height > UINT16_MAX)
    throw options::Error(fmt::format("panorama: {} columns (a multiple of {} is needed) of an image of {}x{}",
                                     options.columns, kBlockColumns, image.width, image.height));
  Unwrapper u;
  u.image_ = image;
  u.camera_ = std::move(camera);
  u.least_rad_ = least_rad;
  u.most_rad_ = most_rad;
  u.valid_ = cv::Mat1b(options.rows, options.columns, std::uint8_t{0});
  const double row_rad = (most_rad - least_rad) / options.rows, column_rad = 2.0 * M_PI / options.columns;
  const auto at = [&](double row, double column) {
    return pixelOf(column * column_rad, most_rad - (row + 0.5) * row_rad);
  };

  // Extent of the cells in the image, the largest of some of them.
  double across_px = 1.0, along_px = 1.0;
  for (int row = 0; row < options.rows; row += std::max(1, options.rows / 8)) {
    for (int column = 0; column < options.columns; column += std::max(1, options.columns / 16)) {
      const auto centre = at(row, column), right = at(row, column + 1), below = at(row + 1, column);
      if (centre && right) along_px = std::max(along_px, (*right - *centre).norm());
      if (centre && below) across_px = std::max(across_px, (*below - *centre).norm());
    }
  }
  const int across = samplesFor(across_px, options.max_samples),
            along = samplesFor(std::min(along_px, 0.5 * image.width), options.max_samples);
  u.samples_per_cell_ = across * along;
  u.samples_.reserve(static_cast<std::size_t>(options.rows * options.columns * u.samples_per_cell_));
  for (int block = 0; block < options.columns; block += kBlockColumns) {
    for (int row = 0; row < options.rows; ++row) {
      for (int column = block; column < block + kBlockColumns; ++column) {
        bool valid = true;
        for (int k = 0; k < u.samples_per_cell_; ++k) {
          const auto pixel =
              at(row + (k / along + 0.5) / across - 0.5, column + (k % along + 0.5) / along - 0.5);
          valid = valid && pixel;
          u.samples_.push_back(sampleAt(pixel.value_or(Eigen::Vector2d::Zero()), image));
        }
        u.valid_(row, column) = valid ? 255 : 0;
      }
    }
  }
  u.hide(options.hidden_deg);
  if (cv::countNonZero(u.valid_) == 0)
    throw options::Error(fmt::format(
        "panorama: the camera ({}) sees no direction between {:.1f} and {:.1f} degrees of elevation",
        u.camera_, least_rad / kDegree, most_rad / kDegree));
  u.findGaps();
  return u;
}

Unwrapper Unwrapper::fromCamera(const lens::Camera& camera, const PanoramaOptions& options) {
  const CameraPixels pixels(camera);
  const lens::CameraModel& model = camera.model();
  const cv::Size image(model.image_width_px, model.image_height_px);
  const double height = (options.most_elevation_deg - options.least_elevation_deg) * kDegree,
               most = seenElevation(pixels, -0.5 * M_PI, options.most_elevation_deg * kDegree);
  return build(image, options, std::max(most - height, -0.5 * M_PI), most,
               describe(projectionName(model), image), pixels);
}

Unwrapper Unwrapper::fromRing(const cv::Size& image, const Ring& ring, const PanoramaOptions& options) {
  if (!(ring.inner_radius_px >= 0.0 && ring.outer_radius_px > ring.inner_radius_px))
    throw options::Error(fmt::format("ring: the outer radius ({:g} px) must exceed the inner one ({:g} px)",
                                     ring.outer_radius_px, ring.inner_radius_px));
  const double least = options.least_elevation_deg * kDegree, most = options.most_elevation_deg * kDegree;
  const auto pixelOf = [&](double bearing, double elevation) -> std::optional<Eigen::Vector2d> {
    const double share = (elevation - least) / (most - least),
                 outwards = ring.sky_outside ? share : 1.0 - share,
                 radius = ring.inner_radius_px + outwards * (ring.outer_radius_px - ring.inner_radius_px),
                 angle = ring.ahead_deg * kDegree + (ring.counter_clockwise ? -bearing : bearing);
    const Eigen::Vector2d pixel = ring.centre_px + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    if (!inside(pixel, image)) return std::nullopt;
    return pixel;
  };
  return build(image, options, least, most, describe("ring", image), pixelOf);
}

Unwrapper Unwrapper::fromEquirectangular(const cv::Size& image, const PanoramaOptions& options) {
  const auto pixelOf = [&](double bearing, double elevation) -> std::optional<Eigen::Vector2d> {
    const double turn = 0.5 - bearing / (2.0 * M_PI), u = (turn - std::floor(turn)) * image.width - 0.5,
                 v = (0.5 - elevation / M_PI) * image.height - 0.5;
    if (v < -0.5 || v >= image.height - 0.5) return std::nullopt;
    return Eigen::Vector2d(std::max(u, 0.0), v);
  };
  return build(image, options, options.least_elevation_deg * kDegree, options.most_elevation_deg * kDegree,
               describe("equirectangular", image), pixelOf);
}

void Unwrapper::hide(const std::vector<double>& hidden_deg) {
  const double column_deg = 360.0 / valid_.cols;
  for (std::size_t i = 0; i + 1 < hidden_deg.size(); i += 2) {
    const int begin = static_cast<int>(std::floor(hidden_deg[i] / column_deg)),
              end = static_cast<int>(std::ceil(hidden_deg[i + 1] / column_deg));
    const int count = std::min(end > begin ? end - begin : end - begin + valid_.cols, valid_.cols);
    for (int k = 0; k < count; ++k) {
      const int column = ((begin + k) % valid_.cols + valid_.cols) % valid_.cols;
      valid_.col(column).setTo(0);
    }
  }
}

void Unwrapper::findGaps() {
  const int columns = valid_.cols;
  for (int row = 0; row < valid_.rows; ++row) {
    const std::uint8_t* valid = valid_.ptr(row);
    const int first = static_cast<int>(std::find(valid, valid + columns, 255) - valid);
    if (first == columns) {
      gaps_.push_back({row, 0, columns});
      continue;
    }
    for (int k = first; k < first + columns;) {
      int end = k;
      while (end < first + columns && valid[end % columns] == 0) ++end;
      if (end > k) gaps_.push_back({row, k % columns, end - k});
      k = std::max(end, k + 1);
    }
  }
}

void Unwrapper::fillGaps(cv::Mat1b& panorama) const {
  const int columns = panorama.cols;
  for (const Gap& gap : gaps_) {
    std::uint8_t* row = panorama.ptr(gap.row);
    if (gap.count == columns) {
      std::fill(row, row + columns, std::uint8_t{0});
      continue;
    }
    const int before = row[(gap.begin + columns - 1) % columns],
              after = row[(gap.begin + gap.count) % columns], parts = gap.count + 1;
    for (int k = 0; k < gap.count; ++k)
      row[(gap.begin + k) % columns] =
          static_cast<std::uint8_t>((before * (parts - 1 - k) + after * (k + 1) + parts / 2) / parts);
  }
}

void Unwrapper::unwrap(const cv::Mat& image, cv::Mat1b& panorama) const {
  if (image.size() != image_ || (image.type() != CV_8UC1 && image.type() != CV_8UC3))
    throw std::invalid_argument(
        fmt::format("panorama: the image is {}x{} of type {}; the table of {} needs 8-bit grey or BGR",
                    image.cols, image.rows, cv::typeToString(image.type()), camera_));
  panorama.create(valid_.rows, valid_.cols);
  averagePixels(image, samples_.data(), samples_per_cell_, panorama);
  fillGaps(panorama);
}

}  // namespace omnifleet::appearance
