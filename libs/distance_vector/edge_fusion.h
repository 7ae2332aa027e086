#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "distance_vector/column_edges.h"

namespace omnifleet::distance_vector {

/// One edge per column from the two of ColumnEdges. Luma shows the shape of a boundary with little noise, hue
/// its place without the shift of shadows. So the offset between both is averaged over neighbouring columns
/// whose boundary continues, and taken off the edge in luma. The offsets of the whole image say how far
/// shadows shift edges in this scene: with that σ the offset is shrunk where hue is uncertain (an image
/// without shadows gives the edges in luma), and an edge without hue is moved by their median and gets their
/// scatter as σ. Where the edges in luma scatter more than those in hue, they lie on texture, and the edge is
/// that in hue.
class EdgeFusion {
 public:
  using Pair = ColumnEdges::Pair;
  /// Row (pixels) and σ; NaN: no edge.
  struct Edge {
    float row, sigma_px;
  };

  /// @param window_px columns to either side over which an offset is averaged
  /// @param jump_px larger steps between columns end a boundary
  /// @param shared_px σ of edges in hue that neighbouring columns share
  EdgeFusion(int window_px, float jump_px, float shared_px)
      : window_px_(window_px), jump_px_(jump_px), shared_px_(shared_px) {}

  /// @param pairs one per column, from left to right. Valid until the next call.
  const std::vector<Edge>& fuse(const std::vector<Pair>& pairs);
  /// Median shift of luma in the last image that had offsets, in pixels (positive: towards the camera), and
  /// its scatter.
  float shift() const { return shift_; }
  float scatter() const { return scatter_; }

 private:
  struct Offset {
    bool is_known = false;
    float mean_px = 0.0f, variance = 0.0f;  ///< of luma against hue
  };
  Offset offsetAround(const std::vector<Pair>& pairs, std::size_t u) const;
  void measureScene(const std::vector<Pair>& pairs);
  std::optional<Edge> smootherHue(const std::vector<Pair>& pairs, std::size_t u) const;
  Edge fuseColumn(const Pair& here, const Offset& offset) const;

  int window_px_;
  float jump_px_, shared_px_;
  float shift_ = 0.0f, scatter_ = 0.0f;
  std::vector<Offset> offsets_;
  std::vector<float> means_;
  std::vector<Edge> edges_;
};

}  // namespace omnifleet::distance_vector
