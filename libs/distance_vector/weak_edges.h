#pragma once

#include <vector>

#include "distance_vector/edge_fusion.h"
#include "distance_vector/floor_walk.h"

namespace omnifleet::distance_vector {

/// Edges of low contrast scatter by half a pixel and more, and some lie on the texture beside them.
/// Boundaries of objects are straight over a few columns, so each weak edge is replaced by a robust line
/// through its weak neighbours: of the windows to its left, around it and to its right the one that scatters
/// least, so that corners stay. σ is that of the line at the column; an edge without a line is dropped.
class WeakEdges {
 public:
  /// @param window_px columns of a window @param jump_px larger steps between columns end a boundary
  /// @param outlier_sigmas edges farther from the line have no weight
  /// @param shared_px σ that all edges of a line share
  WeakEdges(int window_px, float jump_px, float outlier_sigmas, float shared_px)
      : window_px_(window_px), jump_px_(jump_px), outlier_sigmas_(outlier_sigmas), shared_px_(shared_px) {}

  /// @param ends, edges one per column, from left to right @return one edge per column, equal to `edges`
  /// where the end is not weak; valid until the next call
  const std::vector<EdgeFusion::Edge>& smooth(const std::vector<ColumnEnd>& ends,
                                              const std::vector<EdgeFusion::Edge>& edges);

 private:
  struct Line {
    bool is_found = false;
    float row = 0.0f, variance = 0.0f;  ///< pixels, pixels²: at the column
    float scatter = 0.0f;               ///< pixels, of the edges around the line
  };
  Line fit(const std::vector<ColumnEnd>& ends, const std::vector<EdgeFusion::Edge>& edges, int u, int first,
           int end);

  static float correlation(const std::vector<ColumnEnd>& ends, const std::vector<EdgeFusion::Edge>& edges,
                           int u, int first, int end, float level, float slope, float limit);
  int window_px_;
  float jump_px_, outlier_sigmas_, shared_px_;
  std::vector<EdgeFusion::Edge> smoothed_;
  std::vector<float> residuals_;
};

}  // namespace omnifleet::distance_vector
