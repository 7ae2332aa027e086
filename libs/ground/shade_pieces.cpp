#include "ground/shade_pieces.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::ground {

namespace {

constexpr int kLeastPiece_px = 100;    // smaller ones have too little outline to tell
constexpr float kLong = 8.0f;          // length of a board, of its breadth: no thing throws such a shadow
constexpr float kShaded = 0.25f;       // of a region that holds one
constexpr float kLarge = 0.1f;         // of the image's width
constexpr float kSharpShare = 0.1f;    // of its outline: as of what may be no shadow anywhere
constexpr float kLeastShare = 0.1f;    // of the longest piece's area: smaller ones are shade
constexpr float kSharpFoot = 0.5f;     // of the outline towards the camera's foot, where the view cuts it
constexpr float kCutShare = 0.25f;     // of the ends of its runs, from which the view does
constexpr float kLeastFace = 0.0023f;  // of the image's area: smaller ones are mostly shadows
constexpr float kSharpFace = 0.6f;     // of its outline
constexpr float kFaceFoot = 0.82f;     // at most, of the outline towards the camera's foot; shadows: 0.75–1
constexpr float kBeyondView_px = 4.0f;

float diagonal2(const cv::Rect& rect) {
  const auto width = static_cast<float>(rect.width), height = static_cast<float>(rect.height);
  return width * width + height * height;
}

bool isLong(const cv::Rect& rect, int area_px) {
  return diagonal2(rect) >= kLong * static_cast<float>(area_px);
}

/// Does it end with the view, seen from the camera's foot? There many lenses show the floor in less light.
bool endsWithView(const Blob& piece, const FloorFrame& frame) {
  const cv::Rect image({0, 0}, frame.view.size());
  int ends = 0;
  for (const Run& run : piece.runs) {
    for (const int x : {run.begin, run.end - 1}) {
      const cv::Point2f at(static_cast<float>(x), static_cast<float>(run.row)), out = at - frame.foot_px;
      const cv::Point beyond =
          at + out * (kBeyondView_px / std::max(1.0f, static_cast<float>(cv::norm(out))));
      ends += !image.contains(beyond) || frame.view(beyond) == 0 ? 1 : 0;
    }
  }
  return static_cast<float>(ends) >= kCutShare * 2.0f * static_cast<float>(piece.runs.size());
}

}  // namespace

bool ShadePieces::mayBeBoard(const Blob& region, int shaded_px) const {
  const auto shaded = static_cast<float>(shaded_px);
  return shaded >= kShaded * static_cast<float>(region.area_px) && isLong(region.rect, shaded_px) &&
         isLarge(region.rect);
}

bool ShadePieces::mayBeFace(int shaded_px) const {
  return static_cast<float>(shaded_px) >= kLeastFace * static_cast<float>(left_.image().area());
}

bool ShadePieces::isLarge(const cv::Rect& rect) const {
  const float large_px = kLarge * static_cast<float>(left_.image().width);
  return diagonal2(rect) >= large_px * large_px;
}

void ShadePieces::find(const Blob& region, const BitMask& things, const BitArea& area,
                       const FloorFrame& frame, const cv::Mat1b& looks) {
  for (const Run& run : region.runs) left_.setWithout(run.row, run.begin, run.end, things);
  boards_.clear();
  faces_.clear();
  int left_px = 0;
  for (const Blob& piece : labeller_.label(left_, area, kLeastPiece_px)) {
    left_px += piece.area_px;
    const float sharp = deep_.sharpShare(piece, frame, looks);
    if (sharp < kSharpShare) continue;
    const bool may_be_face = sharp >= kSharpFace && mayBeFace(piece.area_px);
    const bool ends_with_view = endsWithView(piece, frame);
    const float foot = may_be_face || ends_with_view ? deep_.footShare(piece, frame, looks) : 0.0f;
    if (may_be_face && !ends_with_view && foot < kFaceFoot) faces_.push_back(&piece);
    if (!ends_with_view || foot >= kSharpFoot) boards_.push_back(&piece);
  }
  if (mayBeBoard(region, left_px))
    dropNoBoards();
  else
    boards_.clear();
  for (const Run& run : region.runs) left_.clear(run.row, run.begin, run.end);
}

/// Only long ones that are large are boards, and what lies with these is of them.
void ShadePieces::dropNoBoards() {
  cv::Rect all;
  int area_px = 0, longest_px = 0;
  for (const Blob* piece : boards_) {
    all |= piece->rect;
    area_px += piece->area_px;
    const bool is_board = isLong(piece->rect, piece->area_px) && isLarge(piece->rect);
    if (is_board) longest_px = std::max(longest_px, piece->area_px);
  }
  if (longest_px == 0 || !isLong(all, area_px)) boards_.clear();
  const auto isSmall = [&](const Blob* piece) {
    return static_cast<float>(piece->area_px) < kLeastShare * static_cast<float>(longest_px);
  };
  boards_.erase(std::remove_if(boards_.begin(), boards_.end(), isSmall), boards_.end());
}

}  // namespace omnifleet::ground
