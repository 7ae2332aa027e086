// Panorama, signature, compass and nearest place of one frame against a naive peer: remap of the image,
// conversion to grey, whole spectra by cv::dft, correlation over all turns in a loop, distances of float
// modules.

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "appearance/compass.h"
#include "appearance/place_database.h"
#include "appearance/stored_signature.h"
#include "geometry/pose2.h"
#include "tests/benchmark/benchmarks.h"

namespace omnifleet::bench {
namespace {

constexpr int kRows = 64, kColumns = 512, kPhases = 64, kCompared = 16;

lens::CameraModel appearanceCamera() {
  lens::CameraModel model;
  model.image_width_px = 1280;
  model.image_height_px = 960;
  model.principal_point_px = {639.5, 479.5};
  model.fov_deg = 185.0;
  model.focal_px = Eigen::Vector2d::Constant(479.0 / (92.5 * M_PI / 180.0));
  model.position_m = {0.0, 0.0, 0.4};
  return model;
}

/// Images of a pattern at infinity, seen at several headings.
struct TurningViews {
  lens::Camera camera{appearanceCamera()};
  std::vector<double> headings_rad;
  std::vector<cv::Mat> images;

  TurningViews() {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    std::vector<cv::Vec4d> waves;
    for (int k = 1; k <= 40; ++k)
      waves.push_back({double(k), 10.0 * unit(random), 2.0 * M_PI * unit(random), 60.0 / std::sqrt(k + 3.0)});
    for (int i = 0; i < 8; ++i) {
      const double heading = 0.07 * i;
      cv::Mat3b image(960, 1280, cv::Vec3b(0, 0, 0));
      for (int y = 0; y < image.rows; ++y) {
        for (int x = 0; x < image.cols; ++x) {
          const auto ray = camera.rayFromPixel({x, y});
          if (!ray) continue;
          const double bearing = heading + std::atan2(ray->y(), ray->x()), elevation = std::asin(ray->z());
          double grey = 128.0;
          for (const cv::Vec4d& w : waves)
            grey += w[3] * std::sin(w[0] * bearing + w[2]) * std::cos(w[1] * elevation);
          image(y, x) = cv::Vec3b::all(cv::saturate_cast<std::uint8_t>(grey));
        }
      }
      headings_rad.push_back(heading);
      images.push_back(image);
    }
  }
};

const TurningViews& turningViews() {
  static const TurningViews kViews;
  return kViews;
}

struct FrameAnswer {
  double turn_rad = 0.0;
  std::size_t nearest = 0;
};

/// Stored signatures: those of the views, then random ones.
std::vector<StoredSignature> storedPlaces(const appearance::Unwrapper& unwrapper, std::size_t count) {
  appearance::SignatureMaker maker(unwrapper, {});
  std::vector<StoredSignature> places;
  cv::Mat1b panorama;
  for (const cv::Mat& image : turningViews().images) {
    unwrapper.unwrap(image, panorama);
    places.push_back(appearance::store(maker.compute(panorama)));
  }
  std::mt19937 random(2);
  while (places.size() < count) {
    StoredSignature place = places.front();
    for (std::uint8_t& byte : place.bytes) byte = static_cast<std::uint8_t>(random());
    places.push_back(place);
  }
  return places;
}

class AppearanceFrame {
 public:
  explicit AppearanceFrame(std::size_t places)
      : unwrapper_(appearance::Unwrapper::fromCamera(turningViews().camera, {})),
        maker_(unwrapper_, {}),
        database_(maker_.format()) {
    for (const StoredSignature& place : storedPlaces(unwrapper_, places))
      database_.add(maker_.format(), place);
  }

  FrameAnswer process(const cv::Mat& image) {
    unwrapper_.unwrap(image, panorama_);
    maker_.compute(panorama_, signature_);
    compass_.prepare(signature_, now_);
    FrameAnswer answer;
    if (!before_.format.camera.empty())
      answer.turn_rad = compass_.compare(before_, now_, {0.0, 0.02, 0.05}).turn_rad;
    answer.nearest = database_.nearest(signature_.format, appearance::store(signature_), 5).front().index;
    std::swap(before_, now_);
    return answer;
  }

 private:
  appearance::Unwrapper unwrapper_;
  appearance::SignatureMaker maker_;
  appearance::PlaceDatabase database_;
  appearance::Compass compass_;
  appearance::Compass::View before_, now_;
  cv::Mat1b panorama_;
  appearance::Signature signature_;
};

/// The same answers by plain calls.
class NaiveAppearance {
 public:
  explicit NaiveAppearance(std::size_t places) {
    const auto unwrapper = appearance::Unwrapper::fromCamera(turningViews().camera, {});
    const auto& camera = turningViews().camera;
    map_.create(kRows, kColumns, CV_32FC2);
    const double row_rad = (unwrapper.mostElevation_rad() - unwrapper.leastElevation_rad()) / kRows;
    for (int row = 0; row < kRows; ++row) {
      for (int column = 0; column < kColumns; ++column) {
        const double bearing = 2.0 * M_PI * column / kColumns,
                     elevation = unwrapper.mostElevation_rad() - (row + 0.5) * row_rad;
        const Eigen::Vector3d ray(std::cos(elevation) * std::cos(bearing),
                                  std::cos(elevation) * std::sin(bearing), std::sin(elevation));
        const auto pixel = camera.lens().pixelFromRay(camera.parentFromCamera().linear().transpose() * ray);
        map_.at<cv::Vec2f>(row, column) = {static_cast<float>(pixel->x()), static_cast<float>(pixel->y())};
      }
    }
    const SignatureFormat format = appearance::SignatureMaker(unwrapper, {}).format();
    for (const StoredSignature& place : storedPlaces(unwrapper, places))
      places_.push_back(logarithms(appearance::restore(format, place).modules.leftCols(kCompared)));
  }

  FrameAnswer process(const cv::Mat& image) {
    cv::Mat grey, panorama, values, spectrum;
    cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    cv::remap(grey, panorama, map_, {}, cv::INTER_LINEAR);
    panorama.convertTo(values, CV_32F);
    cv::dft(values, spectrum, cv::DFT_ROWS | cv::DFT_COMPLEX_OUTPUT);
    FrameAnswer answer;
    if (!before_.empty()) answer.turn_rad = turnTo(spectrum);
    answer.nearest = nearestTo(spectrum);
    before_ = spectrum;
    return answer;
  }

 private:
  static Eigen::ArrayXXf logarithms(const Eigen::ArrayXXf& modules) {
    Eigen::ArrayXXf logs = (modules + 0.3f).log();
    return logs - logs.mean();
  }

  double turnTo(const cv::Mat& spectrum) const {
    std::vector<std::complex<float>> cross(kPhases + 1);
    for (int row = 0; row < kRows; ++row) {
      const auto *a = before_.ptr<std::complex<float>>(row), *b = spectrum.ptr<std::complex<float>>(row);
      for (int k = 1; k <= kPhases; ++k) cross[static_cast<std::size_t>(k)] += b[k] * std::conj(a[k]);
    }
    double best = -1e30, turn = 0.0;
    for (int column = 0; column < kColumns; ++column) {
      double sum = 0.0;
      for (int k = 1; k <= kPhases; ++k) {
        const double angle = 2.0 * M_PI * k * column / kColumns;
        sum += std::real(std::complex<double>(cross[static_cast<std::size_t>(k)]) * std::polar(1.0, -angle));
      }
      if (sum > best) best = sum, turn = 2.0 * M_PI * column / kColumns;
    }
    return wrapAngle(turn);
  }

  std::size_t nearestTo(const cv::Mat& spectrum) const {
    Eigen::ArrayXXf modules(8, kCompared);
    for (int row = 0; row < 8; ++row) {
      for (int k = 1; k <= kCompared; ++k) {
        std::complex<float> sum = 0.0f;
        for (int i = 0; i < kRows / 8; ++i) sum += spectrum.ptr<std::complex<float>>(row * kRows / 8 + i)[k];
        modules(row, k - 1) = std::abs(sum) / (kColumns * kRows / 8);
      }
    }
    const Eigen::ArrayXXf query = logarithms(modules);
    std::size_t best = 0;
    float least = std::numeric_limits<float>::max();
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const float distance = (places_[i] - query).abs().sum();
      if (distance < least) least = distance, best = i;
    }
    return best;
  }

  cv::Mat map_, before_;
  std::vector<Eigen::ArrayXXf> places_;
};

/// Both must find the turn, and a place among the views: the pattern is at infinity, so all views look alike.
void checkAnswers(benchmark::State& state, std::size_t places) {
  AppearanceFrame frame(places);
  NaiveAppearance naive(places);
  const TurningViews& v = turningViews();
  for (std::size_t i = 0; i < v.images.size(); ++i) {
    const FrameAnswer a = frame.process(v.images[i]), b = naive.process(v.images[i]);
    if (a.nearest >= v.images.size() || b.nearest >= v.images.size())
      state.SkipWithError("the nearest place is wrong");
    if (i == 0) continue;
    const double truth = v.headings_rad[i] - v.headings_rad[i - 1];
    // Half a column for the naive compass, a tenth of a degree for the other.
    if (std::abs(a.turn_rad - truth) > 0.0018 || std::abs(b.turn_rad - truth) > M_PI / kColumns + 1e-6)
      state.SkipWithError("the turn is wrong");
  }
}

template <typename Frame, std::size_t kPlaces>
void measureAppearance(benchmark::State& state) {
  checkAnswers(state, kPlaces);
  Frame frame(kPlaces);
  const auto& images = turningViews().images;
  for (const cv::Mat& image : images) frame.process(image);
  Samples samples(state);
  samples.reserve();
  std::size_t i = 0;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    benchmark::DoNotOptimize(frame.process(images[i++ % images.size()]));
    samples.add(threadCpuMs() - begun);
  }
  samples.report();
}

void measureUnwrap(benchmark::State& state) {
  const auto unwrapper = appearance::Unwrapper::fromCamera(turningViews().camera, {});
  const auto& images = turningViews().images;
  cv::Mat1b panorama;
  unwrapper.unwrap(images[0], panorama);
  Samples samples(state);
  samples.reserve();
  const MemoryWatch memory;
  std::size_t i = 0;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    unwrapper.unwrap(images[i++ % images.size()], panorama);
    samples.add(threadCpuMs() - begun);
  }
  memory.report(state);
  samples.report();
}

}  // namespace

void registerAppearance(const Plan& plan) {
  const int iterations = plan.iterations(400);
  const auto add = [&](const char* name, void (*run)(benchmark::State&)) {
    benchmark::RegisterBenchmark(name, run)
        ->Iterations(iterations)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  add("appearance/unwrap", measureUnwrap);
  add("appearance/frame/1000", measureAppearance<AppearanceFrame, 1000>);
  add("appearance/frame/1000/naive", measureAppearance<NaiveAppearance, 1000>);
  add("appearance/frame/10000", measureAppearance<AppearanceFrame, 10000>);
  add("appearance/frame/10000/naive", measureAppearance<NaiveAppearance, 10000>);
}

}  // namespace omnifleet::bench
