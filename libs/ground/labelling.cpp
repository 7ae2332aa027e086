#include "ground/labelling.h"

#include <algorithm>

namespace omnifleet::ground {

void enlarge(const Blob& blocks, int block_px, Blob& pixels) {
  const cv::Rect& rect = blocks.rect;
  pixels.rect = {rect.x * block_px, rect.y * block_px, rect.width * block_px, rect.height * block_px};
  pixels.area_px = blocks.area_px * block_px * block_px;
  pixels.runs.clear();
  for (auto row = blocks.runs.begin(); row != blocks.runs.end();) {
    const auto end =
        std::find_if(row, blocks.runs.end(), [&](const Run& run) { return run.row != row->row; });
    for (int k = 0; k < block_px; ++k)
      for (auto run = row; run != end; ++run)
        pixels.runs.push_back({run->row * block_px + k, run->begin * block_px, run->end * block_px});
    row = end;
  }
}

Blob BlobPool::take() {
  Blob blob;
  if (!spare_.empty()) {
    blob = std::move(spare_.back());
    spare_.pop_back();
  }
  blob.runs.clear();
  blob.runs.reserve(most_runs_);
  return blob;
}

void BlobPool::give(Blob&& blob) {
  while (most_runs_ < blob.runs.size()) most_runs_ *= 2;
  spare_.push_back(std::move(blob));
}

void BlobPool::give(std::vector<Blob>& blobs) {
  for (Blob& blob : blobs) give(std::move(blob));
  blobs.clear();
}

const std::vector<Blob>& Labeller::label(const BitMask& objects, const BitArea& area, int min_area_px) {
  findRuns(objects, area);
  joinRows();
  collect(min_area_px);
  return blobs_;
}

void Labeller::findRuns(const BitMask& objects, const BitArea& area) {
  runs_.clear();
  row_begin_.assign(static_cast<std::size_t>(objects.image().height) + 1, 0);
  int row = 0;
  const auto beginRow = [&] { row_begin_[static_cast<std::size_t>(row++)] = static_cast<int>(runs_.size()); };
  const auto& spans = area.spans();
  for (std::size_t first = 0, last = 0; first < spans.size(); first = last) {
    while (last < spans.size() && spans[last].cell_row == spans[first].cell_row) ++last;
    const int top = spans[first].cell_row * FloorView::kCell;
    while (row < top) beginRow();
    while (row < top + FloorView::kCell) {
      const int y = row;
      beginRow();
      for (std::size_t k = first; k < last; ++k) findRunsOf(objects.row(y), y, spans[k]);
    }
  }
  while (row <= objects.image().height) beginRow();
}

void Labeller::findRunsOf(const BitMask::Word* words, int row, const BitArea::Span& span) {
  BitMask::Word before = 0;  // last bit of the previous word
  int begin = -1;            // first column of the open run; -1: no run is open
  for (int k = span.begin; k < span.end; ++k) {
    BitMask::Word changes = words[k] ^ (words[k] << 1 | before);
    before = words[k] >> (BitMask::kBits - 1);
    for (; changes != 0; changes &= changes - 1) {
      const int x = k * BitMask::kBits + __builtin_ctzll(changes);
      if (begin >= 0) runs_.push_back({row, begin, x});
      begin = begin >= 0 ? -1 : x;
    }
  }
  if (begin >= 0) runs_.push_back({row, begin, span.end * BitMask::kBits});
}

int Labeller::root(int run) {
  while (parent_[static_cast<std::size_t>(run)] != run) {
    auto& parent = parent_[static_cast<std::size_t>(run)];
    parent = parent_[static_cast<std::size_t>(parent)];
    run = parent;
  }
  return run;
}

void Labeller::unite(int a, int b) {
  a = root(a);
  b = root(b);
  parent_[static_cast<std::size_t>(std::max(a, b))] =
      std::min(a, b);  // the first run in reading order is the root
}

void Labeller::joinRows() {
  parent_.resize(runs_.size());
  for (std::size_t i = 0; i < parent_.size(); ++i) parent_[i] = static_cast<int>(i);
  for (std::size_t row = 1; row + 1 < row_begin_.size(); ++row) {
    int above = row_begin_[row - 1];
    const int above_end = row_begin_[row];
    for (int here = row_begin_[row]; here < row_begin_[row + 1]; ++here) {
      const Run& run = runs_[static_cast<std::size_t>(here)];
      while (above < above_end && runs_[static_cast<std::size_t>(above)].end < run.begin) ++above;
      for (int k = above; k < above_end && runs_[static_cast<std::size_t>(k)].begin <= run.end; ++k)
        unite(k, here);
    }
  }
}

void Labeller::collect(int min_area_px) {
  pool_.give(blobs_);
  blob_of_root_.assign(runs_.size(), -1);
  // Areas are computed first, so that specks take no blob from the pool.
  std::vector<int>& area = blob_of_root_;
  for (std::size_t i = 0; i < runs_.size(); ++i) area[i] = 0;
  for (std::size_t i = 0; i < runs_.size(); ++i)
    area[static_cast<std::size_t>(root(static_cast<int>(i)))] += runs_[i].end - runs_[i].begin;
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    const auto lead = static_cast<std::size_t>(root(static_cast<int>(i)));
    if (lead == i) {
      if (area[i] < min_area_px) {
        area[i] = -1;
        continue;
      }
      Blob blob = pool_.take();
      blob.label = static_cast<int>(blobs_.size()) + 1;
      blob.area_px = area[i];
      area[i] = static_cast<int>(blobs_.size());
      blobs_.push_back(std::move(blob));
    }
    if (area[lead] >= 0) blobs_[static_cast<std::size_t>(area[lead])].runs.push_back(runs_[i]);
  }
  for (auto& blob : blobs_) {
    int left = blob.runs.front().begin, right = 0;
    for (const Run& run : blob.runs) {
      left = std::min(left, run.begin);
      right = std::max(right, run.end);
    }
    const int top = blob.runs.front().row;
    blob.rect = cv::Rect(left, top, right - left, blob.runs.back().row - top + 1);
  }
}

}  // namespace omnifleet::ground
