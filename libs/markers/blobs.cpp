#include "markers/blobs.h"

#include <algorithm>

namespace omnifleet::markers {

/// Merges windows that overlap or touch.
void BlobFinder::separate(const std::vector<cv::Rect>& windows) {
  windows_.clear();
  for (cv::Rect window : windows) {
    if (window.empty()) continue;
    for (std::size_t i = 0; i < windows_.size();) {
      const cv::Rect& other = windows_[i];
      const cv::Rect grown(other.x - 1, other.y - 1, other.width + 2, other.height + 2);
      if ((grown & window).empty()) {
        ++i;
        continue;
      }
      window |= other;
      windows_.erase(windows_.begin() + static_cast<std::ptrdiff_t>(i));
      i = 0;
    }
    windows_.push_back(window);
  }
  std::sort(windows_.begin(), windows_.end(), [](const cv::Rect& a, const cv::Rect& b) { return a.x < b.x; });
}

void BlobFinder::scan(const cv::Mat& bgr, const ColourTable& table) {
  runs_.clear();
  row_begin_.assign(1, 0);
  for (int y = 0; y < bgr.rows; ++y) {
    for (const cv::Rect& window : windows_) {
      if (y >= window.y && y < window.y + window.height)
        scanRow(bgr, table, y, window.x, window.x + window.width);
    }
    row_begin_.push_back(static_cast<int>(runs_.size()));
  }
}

void BlobFinder::scanRow(const cv::Mat& bgr, const ColourTable& table, int y, int begin, int end) {
  const std::uint8_t* row = bgr.ptr<std::uint8_t>(y);
  std::uint8_t current = 0;
  for (int x = begin; x < end;) {
    if (current == 0)
      x += ColourTable::kBlock * table.blocksWithout(row + 3 * x, (end - x) / ColourTable::kBlock);
    const int block_end = std::min(x + ColourTable::kBlock, end);
    for (; x < block_end; ++x) {
      const std::uint8_t colour = table.labelOf(row + 3 * x);
      if (colour == current) continue;
      if (current != 0) runs_.back().end = x;
      if (colour != 0) runs_.push_back({y, x, end, colour, -1});
      current = colour;
    }
  }
}

bool BlobFinder::isWhole(const Blob& blob) const {
  for (const cv::Rect& window : windows_) {
    if (!window.contains({blob.left, blob.top})) continue;
    const int right = window.x + window.width, bottom = window.y + window.height;
    return (blob.left > window.x || window.x == 0) && (blob.top > window.y || window.y == 0) &&
           (blob.right + 1 < right || right == image_.width) &&
           (blob.bottom + 1 < bottom || bottom == image_.height);
  }
  return false;
}

int BlobFinder::root(int run) {
  while (parent_[static_cast<std::size_t>(run)] != run) {
    auto& up = parent_[static_cast<std::size_t>(run)];
    up = parent_[static_cast<std::size_t>(up)];
    run = up;
  }
  return run;
}

void BlobFinder::connect(bool any_class) {
  parent_.resize(runs_.size());
  for (std::size_t i = 0; i < runs_.size(); ++i) parent_[i] = static_cast<int>(i);
  // Runs of one row that touch have different labels.
  for (std::size_t i = 1; any_class && i < runs_.size(); ++i) {
    if (runs_[i].row == runs_[i - 1].row && runs_[i].begin == runs_[i - 1].end) parent_[i] = parent_[i - 1];
  }
  for (std::size_t y = 1; y + 1 < row_begin_.size(); ++y) {
    int above = row_begin_[y - 1];
    for (int i = row_begin_[y]; i < row_begin_[y + 1]; ++i) {
      const Run& run = runs_[static_cast<std::size_t>(i)];
      while (above < row_begin_[y] && runs_[static_cast<std::size_t>(above)].end < run.begin) ++above;
      for (int j = above; j < row_begin_[y] && runs_[static_cast<std::size_t>(j)].begin <= run.end; ++j) {
        if (!any_class && runs_[static_cast<std::size_t>(j)].colour != run.colour) continue;
        const int a = root(i), b = root(j);
        parent_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
      }
    }
  }
}

const std::vector<Blob>& BlobFinder::find(const cv::Mat& bgr, const ColourTable& table, int min_area_px) {
  return find(bgr, table, min_area_px, {cv::Rect({0, 0}, bgr.size())});
}

const std::vector<Blob>& BlobFinder::find(const cv::Mat& bgr, const ColourTable& table, int min_area_px,
                                          const std::vector<cv::Rect>& windows) {
  image_ = bgr.size();
  separate(windows);
  scan(bgr, table);
  connect(false);
  collect(
      [min_area_px](const Blob& blob) {
        return blob.area_px >= min_area_px && blob.colour != ColourTable::kMixture;
      },
      blobs_);
  return blobs_;
}

const std::vector<Blob>& BlobFinder::objects(int min_area_px) {
  connect(true);
  collect([min_area_px](const Blob& blob) { return blob.area_px >= min_area_px; }, objects_);
  for (Blob& object : objects_) object.colour = 0;
  return objects_;
}

/// Sums connected runs up to blobs.
template <typename Wanted>
void BlobFinder::collect(const Wanted& wanted, std::vector<Blob>& blobs) {
  all_.clear();
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    Run& run = runs_[i];
    const int first = root(static_cast<int>(i));
    if (first == static_cast<int>(i)) {
      run.blob = static_cast<int>(all_.size());
      all_.push_back({run.colour, 0, run.begin, run.row, run.end - 1, run.row, 0.0, 0.0});
    } else {
      run.blob = runs_[static_cast<std::size_t>(first)].blob;
    }
    Blob& blob = all_[static_cast<std::size_t>(run.blob)];
    const int length = run.end - run.begin;
    blob.area_px += length;
    blob.sum_x += 0.5 * length * (run.begin + run.end - 1);
    blob.sum_y += 1.0 * length * run.row;
    blob.left = std::min(blob.left, run.begin);
    blob.right = std::max(blob.right, run.end - 1);
    blob.bottom = run.row;
  }
  blobs.clear();
  std::copy_if(all_.begin(), all_.end(), std::back_inserter(blobs),
               [&](const Blob& blob) { return wanted(blob) && isWhole(blob); });
}

}  // namespace omnifleet::markers
