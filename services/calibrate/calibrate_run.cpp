#include "calibrate/calibrate_run.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <stdexcept>
#include <utility>

#include "dataset/atomic_file.h"
#include "dataset/image_names.h"

namespace omnifleet::calibrate {
namespace {

std::vector<std::filesystem::path> imagesIn(const Options& options) {
  std::vector<std::filesystem::path> images;
  std::set<std::string> others;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(options.images, error)) {
    const std::string name = entry.path().filename().string();
    if (::fnmatch(options.match.c_str(), name.c_str(), 0) != 0) continue;
    if (dataset::isImageName(entry.path()))
      images.push_back(entry.path());
    else if (entry.is_regular_file())
      others.insert(entry.path().extension().string());
  }
  if (error)
    throw options::Error(fmt::format("{}: cannot read this folder: {}", options.images, error.message()));
  if (images.empty()) {
    others.erase("");
    const std::string seen =
        others.empty() ? "" : fmt::format("; convert its {} files to png", fmt::join(others, ", "));
    throw options::Error(fmt::format("{}: no image ({}) matches '{}' (--match){}", options.images,
                                     dataset::imageExtensionsText(), options.match, seen));
  }
  std::sort(images.begin(), images.end());
  return images;
}

struct Search {
  cv::Size size;
  std::vector<calibration::View> views;
  std::vector<std::string> without_board;
};

/// Throws when an image shows a board of another size: the search in the other images would fail as well.
void checkSize(const calibration::Board& board, const cv::Mat& grey, const std::string& path) {
  const auto other = calibration::findOtherSize(grey, board);
  if (!other) return;
  throw options::Error(
      fmt::format("--board: {} shows {}x{} inner corners, not {}x{}; count the corners where four squares "
                  "meet, not squares",
                  path, other->columns, other->rows, board.columns, board.rows));
}

constexpr std::size_t kCheckedImages =
    3;  // check the board size only in the first images, if they show no board

Search findBoards(const Options& options, const std::function<void(const std::string&, bool)>& progress) {
  Search search;
  for (const std::filesystem::path& path : imagesIn(options)) {
    const std::string name = path.filename().string();
    const cv::Mat grey = cv::imread(path.string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
    if (grey.empty())
      throw options::Error(fmt::format("{}: cannot read this file as an image", path.string()));
    if (search.size.empty()) search.size = grey.size();
    if (grey.size() != search.size) {
      throw options::Error(
          fmt::format("{}: its size is {}×{}, but the images before have {}×{}; select the images of one "
                      "camera (--match)",
                      path.string(), grey.cols, grey.rows, search.size.width, search.size.height));
    }
    auto corners = calibration::findBoard(grey, options.board);
    progress(name, corners.has_value());
    if (!corners && search.views.empty() && search.without_board.size() < kCheckedImages)
      checkSize(options.board, grey, path.string());
    if (corners)
      search.views.push_back({name, std::move(*corners)});
    else
      search.without_board.push_back(name);
  }
  return search;
}

/// Throws when no lens model explains the corners, and names the image with the largest error.
void checkError(const Options& options, const Search& search, const calibration::Calibration& found) {
  const double rms_px = found.model.reprojection_rms_px;
  if (rms_px <= options.max_rms_px) return;
  const auto lens = lens::Lens::make(found.model);
  std::string worst;
  double worst_px = -1.0;
  for (std::size_t v = 0; v < search.views.size(); ++v) {
    const double px =
        calibration::reprojectionRms_px(*lens, options.board, search.views[v], found.camera_from_board[v]);
    if (px <= worst_px) continue;
    worst_px = px;
    worst = search.views[v].name;
  }
  throw std::runtime_error(
      fmt::format("reprojection error {:.1f} px RMS exceeds {:g} px (--max-rms-px), no file written; largest "
                  "error: {} with {:.1f} px. "
                  "Try another --projection (kannala_brandt and ocam fit most lenses), check that --board "
                  "counts inner corners, "
                  "exclude images with --match",
                  rms_px, options.max_rms_px, worst, worst_px));
}

}  // namespace

lens::Projection projectionFromName(const std::string& name) {
  using lens::Projection;
  constexpr std::array<std::pair<const char*, Projection>, 7> kNames{
      {{"orthographic", Projection::kOrthographic},
       {"equidistant", Projection::kEquidistant},
       {"equisolid", Projection::kEquisolid},
       {"stereographic", Projection::kStereographic},
       {"kannala_brandt", Projection::kKannalaBrandt},
       {"ocam", Projection::kOcam},
       {"pinhole", Projection::kPinhole}}};
  std::string allowed;
  for (const auto& [text, projection] : kNames) {
    if (name == text) return projection;
    allowed += allowed.empty() ? text : std::string(", ") + text;
  }
  throw options::Error(fmt::format("--projection: '{}' must be one of {}", name, allowed));
}

Report run(const Options& options, const std::function<void(const std::string&, bool)>& progress) {
  const Search search = findBoards(options, progress);
  calibration::Request request;
  request.projection = options.projection;
  request.image_width_px = search.size.width;
  request.image_height_px = search.size.height;
  request.fov_deg = options.fov_deg;
  calibration::Calibration found = calibration::calibrate(search.views, options.board, request);
  const auto measured = [&](const lens::CameraModel& model) {
    return calibration::reprojectionRms_px(*lens::Lens::make(model), options.board, search.views,
                                           found.camera_from_board);
  };
  found.model.reprojection_rms_px = measured(found.model);
  checkError(options, search, found);
  const std::string head = fmt::format(
      "# Calibrated with {} of {} images of a board of {}x{} inner corners, {} m squares.\n"
      "# The outermost corner is {:.1f}° from the axis; beyond it the model extrapolates.\n"
      "# Add position_m and rotation_rpy_deg of the camera.\n",
      search.views.size(), search.views.size() + search.without_board.size(), options.board.columns,
      options.board.rows, options.board.square_m, found.outermost_deg);
  dataset::writeAtomic(options.out, head + found.model.toYaml());

  Report report;
  report.model = lens::CameraModel::load(options.out);
  const auto lens = lens::Lens::make(report.model);
  for (std::size_t v = 0; v < search.views.size(); ++v) {
    report.used.push_back(search.views[v].name);
    report.rms_px.push_back(
        calibration::reprojectionRms_px(*lens, options.board, search.views[v], found.camera_from_board[v]));
  }
  report.without_board = search.without_board;
  report.total_rms_px = measured(report.model);
  report.outermost_deg = found.outermost_deg;
  return report;
}

std::string table(const Report& report) {
  std::string text;
  for (std::size_t i = 0; i < report.used.size(); ++i)
    text += fmt::format("{:<40} {:6.3f} px\n", report.used[i], report.rms_px[i]);
  for (const std::string& name : report.without_board) text += fmt::format("{:<40} no board found\n", name);
  text += fmt::format(
      "{} of {} images used, reprojection error {:.3f} px RMS, corners up to {:.1f}° from the axis\n",
      report.used.size(), report.used.size() + report.without_board.size(), report.total_rms_px,
      report.outermost_deg);
  return text;
}

}  // namespace omnifleet::calibrate
