#include "ground/shadow_pieces.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::ground {

namespace {

constexpr int kLeastPiece_px = 100;  // smaller pieces have too little outline for a decision
constexpr float kLong = 8.0f;        // length ÷ breadth of a board; no object casts such a shadow
constexpr float kShadowed = 0.25f;   // minimum shadowed share of a region that holds a board
constexpr float kLarge = 0.1f;       // minimum diagonal of a board, as a share of the image width
constexpr float kSharpShare = 0.1f;  // minimum sharp share of a piece's outline; shadows have less
constexpr float kLeastShare = 0.1f;  // minimum share of the longest piece's area; smaller pieces are shadow
constexpr float kSharpFoot =
    0.5f;  // minimum sharp share of the outline towards the camera foot, for pieces that the view cuts
constexpr float kCutShare =
    0.25f;  // share of the ends of a piece's runs at the end of the view, from which the view cuts it
constexpr float kLeastFace = 0.0023f;  // minimum share of the image area; smaller pieces are mostly shadows
constexpr float kSharpFace = 0.6f;     // minimum sharp share of a face's outline
constexpr float kFaceFoot =
    0.82f;  // maximum sharp share of a face's outline towards the camera foot; shadows: 0.75–1
constexpr float kBeyondView_px = 4.0f;

float diagonal2(const cv::Rect& rect) {
  const auto width = static_cast<float>(rect.width), height = static_cast<float>(rect.height);
  return width * width + height * height;
}

bool isLong(const cv::Rect& rect, int area_px) {
  return diagonal2(rect) >= kLong * static_cast<float>(area_px);
}

/// Does the piece end where the view ends, seen from the camera foot? Many lenses show the floor darker there
/// (vignetting).
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

bool ShadowPieces::mayBeBoard(const Blob& region, int shadowed_px) const {
  const auto shadowed = static_cast<float>(shadowed_px);
  return shadowed >= kShadowed * static_cast<float>(region.area_px) && isLong(region.rect, shadowed_px) &&
         isLarge(region.rect);
}

bool ShadowPieces::mayBeFace(int shadowed_px) const {
  return static_cast<float>(shadowed_px) >= kLeastFace * static_cast<float>(left_.image().area());
}

bool ShadowPieces::isLarge(const cv::Rect& rect) const {
  const float large_px = kLarge * static_cast<float>(left_.image().width);
  return diagonal2(rect) >= large_px * large_px;
}

void ShadowPieces::find(const Blob& region, const BitMask& objects, const BitArea& area,
                        const FloorFrame& frame, const cv::Mat1b& appearances) {
  for (const Run& run : region.runs) left_.setWithout(run.row, run.begin, run.end, objects);
  boards_.clear();
  faces_.clear();
  int left_px = 0;
  for (const Blob& piece : labeller_.label(left_, area, kLeastPiece_px)) {
    left_px += piece.area_px;
    const float sharp = deep_.sharpShare(piece, frame, appearances);
    if (sharp < kSharpShare) continue;
    const bool may_be_face = sharp >= kSharpFace && mayBeFace(piece.area_px);
    const bool ends_with_view = endsWithView(piece, frame);
    const float foot = may_be_face || ends_with_view ? deep_.footShare(piece, frame, appearances) : 0.0f;
    if (may_be_face && !ends_with_view && foot < kFaceFoot) faces_.push_back(&piece);
    if (!ends_with_view || foot >= kSharpFoot) boards_.push_back(&piece);
  }
  if (mayBeBoard(region, left_px))
    dropOtherPieces();
  else
    boards_.clear();
  for (const Run& run : region.runs) left_.clear(run.row, run.begin, run.end);
}

/// Keeps boards only where a long and large one is among them. The pieces beside it belong to it, except for
/// small ones.
void ShadowPieces::dropOtherPieces() {
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
