#include "markers/blobs.h"

#include <algorithm>

namespace omnifleet::markers {

void BlobFinder::scan(const cv::Mat& bgr, const ColourTable& table) {
  runs_.clear();
  row_begin_.assign(1, 0);
  for (int y = 0; y < bgr.rows; ++y) {
    const std::uint8_t* pixel = bgr.ptr<std::uint8_t>(y);
    std::uint8_t current = 0;
    for (int x = 0; x < bgr.cols; ++x, pixel += 3) {
      const std::uint8_t colour = table.classOf(pixel);
      if (colour == current) continue;
      if (current != 0) runs_.back().end = x;
      if (colour != 0) runs_.push_back({y, x, bgr.cols, colour, -1});
      current = colour;
    }
    row_begin_.push_back(static_cast<int>(runs_.size()));
  }
}

int BlobFinder::root(int run) {
  while (parent_[static_cast<std::size_t>(run)] != run) {
    auto& up = parent_[static_cast<std::size_t>(run)];
    up = parent_[static_cast<std::size_t>(up)];
    run = up;
  }
  return run;
}

void BlobFinder::connect() {
  parent_.resize(runs_.size());
  for (std::size_t i = 0; i < runs_.size(); ++i) parent_[i] = static_cast<int>(i);
  for (std::size_t y = 1; y + 1 < row_begin_.size(); ++y) {
    int above = row_begin_[y - 1];
    for (int i = row_begin_[y]; i < row_begin_[y + 1]; ++i) {
      const Run& run = runs_[static_cast<std::size_t>(i)];
      while (above < row_begin_[y] && runs_[static_cast<std::size_t>(above)].end < run.begin) ++above;
      for (int j = above; j < row_begin_[y] && runs_[static_cast<std::size_t>(j)].begin <= run.end; ++j) {
        if (runs_[static_cast<std::size_t>(j)].colour != run.colour) continue;
        const int a = root(i), b = root(j);
        parent_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
      }
    }
  }
}

const std::vector<Blob>& BlobFinder::find(const cv::Mat& bgr, const ColourTable& table, int min_area_px) {
  scan(bgr, table);
  connect();
  all_.clear();
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    Run& run = runs_[i];
    const int first = root(static_cast<int>(i));
    if (first == static_cast<int>(i)) {
      run.blob = static_cast<int>(all_.size());
      all_.push_back({run.colour, 0, run.begin, run.row, run.end - 1, run.row});
    } else {
      run.blob = runs_[static_cast<std::size_t>(first)].blob;
    }
    Blob& blob = all_[static_cast<std::size_t>(run.blob)];
    blob.area_px += run.end - run.begin;
    blob.left = std::min(blob.left, run.begin);
    blob.right = std::max(blob.right, run.end - 1);
    blob.bottom = run.row;
  }
  blobs_.clear();
  std::copy_if(all_.begin(), all_.end(), std::back_inserter(blobs_),
               [&](const Blob& blob) { return blob.area_px >= min_area_px; });
  return blobs_;
}

}  // namespace omnifleet::markers
