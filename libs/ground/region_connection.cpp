#include "ground/region_connection.h"

#include <algorithm>
#include <tuple>

namespace omnifleet::ground {

ConnectionOptions ConnectionOptions::read(const options::Section& section) {
  ConnectionOptions o;
  section.read("method", o.method, {"pixels", "rectangles"});
  section.read("gap_px", o.gap_px, {0, 200});
  section.finish();
  return o;
}

int pixelGap(const Blob& a, const Blob& b, int limit) {
  int best = limit + 1;
  std::size_t first = 0;
  for (const Run& run : a.runs) {
    while (first < b.runs.size() && b.runs[first].row < run.row - limit - 1) ++first;
    for (std::size_t k = first; k < b.runs.size() && b.runs[k].row <= run.row + limit + 1; ++k) {
      const Run& other = b.runs[k];
      const int rows = std::abs(other.row - run.row) - 1;
      const int columns = std::max(other.begin - run.end, run.begin - other.end);
      best = std::min(best, std::max({rows, columns, 0}));
    }
  }
  return best;
}

bool RegionConnection::close(const Blob& a, const Blob& b) const {
  const int gap = options_.gap_px;
  const cv::Rect grown(a.rect.x - gap, a.rect.y - gap, a.rect.width + 2 * gap, a.rect.height + 2 * gap);
  if (options_.method == "rectangles") return !(grown & b.rect).empty();
  const cv::Rect touching(grown.x - 1, grown.y - 1, grown.width + 2, grown.height + 2);
  return !(touching & b.rect).empty() && pixelGap(a, b, gap) <= gap;
}

const std::vector<Blob>& RegionConnection::connect(const std::vector<Blob>& blobs) {
  pool_.give(blobs_);
  for (const Blob& blob : blobs) {
    Blob copy = pool_.take();
    copy.label = blob.label;
    copy.rect = blob.rect;
    copy.area_px = blob.area_px;
    copy.runs.assign(blob.runs.begin(), blob.runs.end());
    blobs_.push_back(std::move(copy));
  }
  const auto byRow = [](const Run& a, const Run& b) {
    return std::tie(a.row, a.begin) < std::tie(b.row, b.begin);
  };
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t n = 0; n < blobs_.size(); ++n) {
      for (std::size_t m = n + 1; m < blobs_.size();) {
        if (!close(blobs_[n], blobs_[m])) {
          ++m;
          continue;
        }
        auto& runs = blobs_[n].runs;
        const auto middle = static_cast<std::ptrdiff_t>(runs.size());
        runs.insert(runs.end(), blobs_[m].runs.begin(), blobs_[m].runs.end());
        std::inplace_merge(runs.begin(), runs.begin() + middle, runs.end(), byRow);
        blobs_[n].rect |= blobs_[m].rect;
        blobs_[n].area_px += blobs_[m].area_px;
        pool_.give(std::move(blobs_[m]));
        blobs_.erase(blobs_.begin() + static_cast<std::ptrdiff_t>(m));
        changed = true;
      }
    }
  }
  std::sort(blobs_.begin(), blobs_.end(), [](const Blob& a, const Blob& b) {
    return std::tie(a.rect.y, a.rect.x, a.label) < std::tie(b.rect.y, b.rect.x, b.label);
  });
  for (std::size_t n = 0; n < blobs_.size(); ++n) blobs_[n].label = static_cast<int>(n) + 1;
  return blobs_;
}

}  // namespace omnifleet::ground
