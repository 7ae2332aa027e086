#include "markers/plane_window.h"

namespace omnifleet::markers {

/// Lagrange polynomials and their derivatives for equidistant nodes.
PlaneWindow::Weights PlaneWindow::weights(const double (&nodes)[kNodes], double at) {
  const double scale = 1.0 / (nodes[1] - nodes[0]), t = (at - nodes[0]) * scale;
  const double a = t, b = t - 1.0, c = t - 2.0, d = t - 3.0;
  return {{-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0},
          {-scale * (c * d + b * d + b * c) / 6.0, scale * (c * d + a * d + a * c) / 2.0,
           -scale * (b * d + a * d + a * b) / 2.0, scale * (b * c + a * c + a * b) / 6.0}};
}

bool PlaneWindow::set(const lens::Camera& camera, double height_m, const cv::Rect& window) {
  for (int k = 0; k < kNodes; ++k) {
    u_[k] = window.x + (window.width - 0.5) * k / (kNodes - 1) - 0.25;
    v_[k] = window.y + (window.height - 0.5) * k / (kNodes - 1) - 0.25;
  }
  for (int j = 0; j < kNodes; ++j) {
    for (int i = 0; i < kNodes; ++i) {
      const auto point = camera.planeFromPixel({u_[i], v_[j]}, height_m);
      if (!point) return false;
      nodes_[j][i] = *point;
    }
  }
  left_ = window.x;
  columns_.clear();
  for (int x = 0; x < window.width; ++x) columns_.push_back(weights(u_, window.x + x));
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

void PlaneWindow::setRow(double v) {
  const Weights at = weights(v_, v);
  for (int i = 0; i < kNodes; ++i) {
    row_[i].setZero();
    for (int j = 0; j < kNodes; ++j) row_[i] += at.value[j] * nodes_[j][i];
  }
}

}  // namespace omnifleet::markers
