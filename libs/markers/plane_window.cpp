#include "markers/plane_window.h"

#include "geometry/wide.h"

namespace omnifleet::markers {
namespace {

OMNIFLEET_WIDE void interpolate(const std::vector<float> (&columns)[4], const Eigen::Vector2f (&nodes)[4],
                                int count, float* x_m, float* y_m) {
  const float *a = columns[0].data(), *b = columns[1].data(), *c = columns[2].data(), *d = columns[3].data();
  const float ax = nodes[0].x(), bx = nodes[1].x(), cx = nodes[2].x(), dx = nodes[3].x();
  const float ay = nodes[0].y(), by = nodes[1].y(), cy = nodes[2].y(), dy = nodes[3].y();
#pragma GCC ivdep
  for (int k = 0; k < count; ++k) {
    x_m[k] = (a[k] * ax + b[k] * bx) + (c[k] * cx + d[k] * dx);
    y_m[k] = (a[k] * ay + b[k] * by) + (c[k] * cy + d[k] * dy);
  }
}

}  // namespace

/// Lagrange polynomials and their derivatives for equidistant nodes.
PlaneWindow::Weights PlaneWindow::weights(const double (&nodes)[kNodes], double at) {
  const double scale = 1.0 / (nodes[1] - nodes[0]), t = (at - nodes[0]) * scale;
  const double a = t, b = t - 1.0, c = t - 2.0, d = t - 3.0;
  return {{-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0},
          {-scale * (c * d + b * d + b * c) / 6.0, scale * (c * d + a * d + a * c) / 2.0,
           -scale * (b * d + a * d + a * b) / 2.0, scale * (b * c + a * c + a * b) / 6.0}};
}

bool PlaneWindow::set(const lens::Camera& camera, double height_m, const cv::Rect& window,
                      const Pose2& map_from_frame) {
  for (int k = 0; k < kNodes; ++k) {
    u_[k] = window.x + (window.width - 0.5) * k / (kNodes - 1) - 0.25;
    v_[k] = window.y + (window.height - 0.5) * k / (kNodes - 1) - 0.25;
  }
  const Pose2 frame_from_map = map_from_frame.inverse();
  for (int j = 0; j < kNodes; ++j) {
    for (int i = 0; i < kNodes; ++i) {
      const auto point = camera.planeFromPixel({u_[i], v_[j]}, height_m);
      if (!point) return false;
      nodes_[j][i] = frame_from_map * *point;
    }
  }
  width_ = window.width;
  for (auto& column : columns_) column.resize(static_cast<std::size_t>(width_));
  for (int x = 0; x < width_; ++x) {
    const Weights at = weights(u_, window.x + x);
    for (int i = 0; i < kNodes; ++i)
      columns_[i][static_cast<std::size_t>(x)] = static_cast<float>(at.value[i]);
  }
  const Weights across = weights(u_, window.x + 0.5 * (window.width - 1)),
                down = weights(v_, window.y + 0.5 * (window.height - 1));
  scale_.setZero();
  for (int j = 0; j < kNodes; ++j) {
    for (int i = 0; i < kNodes; ++i) {
      scale_.col(0) += across.slope[i] * down.value[j] * nodes_[j][i];
      scale_.col(1) += across.value[i] * down.slope[j] * nodes_[j][i];
    }
  }
  return true;
}

void PlaneWindow::row(int v, float* x_m, float* y_m) {
  const Weights at = weights(v_, v);
  Eigen::Vector2f nodes[kNodes];
  for (int i = 0; i < kNodes; ++i) {
    Eigen::Vector2d node(0.0, 0.0);
    for (int j = 0; j < kNodes; ++j) node += at.value[j] * nodes_[j][i];
    nodes[i] = node.cast<float>();
  }
  interpolate(columns_, nodes, width_, x_m, y_m);
}

}  // namespace omnifleet::markers
