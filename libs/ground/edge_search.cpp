#include "ground/edge_search.h"

#include <cmath>

#include "ground/appearance_class.h"
#include "ground/edge_refiner.h"

namespace omnifleet::ground {

namespace {

using lanes::Floats;
using lanes::Ints;

constexpr float kLumaShare =
    0.4f;  // minimum share of luma in the contrast for using brightness alone, as chroma is blurred
constexpr float kBeyond_px =
    0.5f;  // distance beyond the search range where the object's brightness is sampled
constexpr float kSameLight = 0.04f;  // share of the brightness; below it the reference is used
constexpr float kDeepLight =
    0.12f;  // share of the brightness; above it the floor beside the outline is in shadow
constexpr float kHueShare =
    0.3f;  // share of hue in the contrast from which hue alone locates the edge in shadow
constexpr float kSameHue = 0.06f;   // hue tolerance of floor in shadow, share of the brightness
constexpr float kHueNoise = 0.02f;  // added to kSameHue, share of the reference's brightness
constexpr float kNext_px = 1.5f;    // distance outside the outline where mixed pixels end
constexpr float kWithin_px = 0.5f;  // distance inside an edge where the object's hue must have begun
constexpr float kFloorsHue = 0.4f;  // minimum share of the object's hue there
constexpr float
    kLeastHue =
        0.03f,  // minimum hue contrast if kHueSigmas of the noise are less, share of the floor's brightness
    kSureHue = 0.1f;  // hue contrast that suffices at any noise, share of the floor's brightness
constexpr float kHueSigmas = 6.0f;  // smaller differences of a single sample may be noise
constexpr float kLight = 0.6f;      // share of the floor's brightness; brighter objects may have a faint hue
constexpr float kStep_px = 0.5f;    // distance between samples along the normal
constexpr int kAround = 8;          // samples around an edge; the outer two on each side lie beyond the blur
constexpr float kMaxShift = 0.3f;   // maximum change of the threshold, share of the contrast

struct Colours {
  Floats blue, green, red;
};

OMNIFLEET_INLINE Colours operator-(const Colours& a, const Colours& b) {
  return {a.blue - b.blue, a.green - b.green, a.red - b.red};
}
OMNIFLEET_INLINE Colours operator*(const Floats& a, const Colours& c) {
  return {a * c.blue, a * c.green, a * c.red};
}
OMNIFLEET_INLINE Floats dot(const Colours& a, const Colours& b) {
  return a.blue * b.blue + a.green * b.green + a.red * b.red;
}
OMNIFLEET_INLINE Floats length(const Colours& c) {
  return lanes::squareRoot(dot(c, c));
}
OMNIFLEET_INLINE Colours choose(const Ints& which, const Colours& a, const Colours& b) {
  return {which ? a.blue : b.blue, which ? a.green : b.green, which ? a.red : b.red};
}

/// Component of a colour that is orthogonal to the reference: its difference in hue.
OMNIFLEET_INLINE Colours hueOf(const Colours& c, const Colours& reference) {
  const Floats rr = lanes::larger(lanes::all(1.0f), dot(reference, reference));
  return c - dot(c, reference) / rr * reference;
}

/// BT.601 luma, which JPEG stores at full resolution.
OMNIFLEET_INLINE Colours luma() {
  return {lanes::all(0.114f), lanes::all(0.587f), lanes::all(0.299f)};
}

/// Positions between pixels, with the four pixels around each.
struct Places {
  std::int32_t offset[lanes::kLanes];  ///< byte offset of the top left pixel
  Ints inside;                         ///< all four pixels lie in the image
  Floats right, down;                  ///< distance from the top left pixel

  OMNIFLEET_INLINE Places(const cv::Mat& image, int channels, const Floats& u, const Floats& v) {
    inside = (u >= 0.0f) & (v >= 0.0f) & (u < static_cast<float>(image.cols - 1)) &
             (v < static_cast<float>(image.rows - 1));
    const Floats within_u = inside ? u : Floats{}, within_v = inside ? v : Floats{};
    const Ints x = lanes::truncated(within_u), y = lanes::truncated(within_v);
    right = within_u - lanes::floats(x);
    down = within_v - lanes::floats(y);
    lanes::store(y * static_cast<std::int32_t>(image.step[0]) + x * channels, offset);
  }
  /// Bilinear interpolation; NaN outside the image. Arguments: top left, top right, bottom left, bottom
  /// right.
  OMNIFLEET_INLINE Floats mix(const Ints& a, const Ints& b, const Ints& c, const Ints& d) const {
    const Floats above = lanes::floats(a) + right * lanes::floats(b - a);
    const Floats below = lanes::floats(c) + right * lanes::floats(d - c);
    return inside ? above + down * (below - above) : lanes::all(NAN);
  }
};

/// Loads `kBytes` bytes at each of eight positions as numbers. Inserts them one by one into a vector
/// register. Reading a vector back from memory after scalar stores would stall.
template <int kBytes>
OMNIFLEET_INLINE Ints gather(const std::uint8_t* base, const std::int32_t (&offset)[lanes::kLanes]) {
  const auto at = [&](int k) {
    std::int32_t bytes = 0;
    std::memcpy(&bytes, base + offset[k], kBytes);
    return bytes;
  };
  return Ints{at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7)};
}

OMNIFLEET_INLINE Floats greysAt(const cv::Mat& grey, const Floats& u, const Floats& v) {
  const Places at(grey, 1, u, v);
  const Ints top = gather<2>(grey.data, at.offset), bottom = gather<2>(grey.data + grey.step[0], at.offset);
  return at.mix(top & 255, top >> 8, bottom & 255, bottom >> 8);
}

OMNIFLEET_INLINE Colours coloursAt(const cv::Mat& image, const Floats& u, const Floats& v) {
  if (image.channels() != 3) {
    const Floats grey = greysAt(image, u, v);
    return {grey, grey, grey};
  }
  const Places at(image, 3, u, v);
  // Six bytes of each row in two numbers: B G R B′ and R B′ G′ R′ (′: right neighbour).
  const std::uint8_t* below = image.data + image.step[0];
  const Ints top = gather<4>(image.data, at.offset), top_end = gather<4>(image.data + 2, at.offset),
             bottom = gather<4>(below, at.offset), bottom_end = gather<4>(below + 2, at.offset);
  return {at.mix(top & 255, (top_end >> 8) & 255, bottom & 255, (bottom_end >> 8) & 255),
          at.mix((top >> 8) & 255, (top_end >> 16) & 255, (bottom >> 8) & 255, (bottom_end >> 16) & 255),
          at.mix((top >> 16) & 255, (top_end >> 24) & 255, (bottom >> 16) & 255, (bottom_end >> 24) & 255)};
}

struct Normals {
  Floats x, y;        ///< starting points
  Floats in_x, in_y;  ///< unit vectors into the region
  OMNIFLEET_INLINE Floats u(const Floats& s) const { return x + s * in_x; }
  OMNIFLEET_INLINE Floats v(const Floats& s) const { return y + s * in_y; }
  OMNIFLEET_INLINE Floats greysAt(const cv::Mat& grey, const Floats& s) const {
    return ground::greysAt(grey, u(s), v(s));
  }
  OMNIFLEET_INLINE Colours coloursAt(const cv::Mat& image, const Floats& s) const {
    return ground::coloursAt(image, u(s), v(s));
  }
};

/// Brightness relative to the reference if the colour has the reference's hue, else 1. Colours darker than a
/// shadow also give 1, as they may be anything.
OMNIFLEET_INLINE Floats lightOf(const Colours& seen, const Colours& reference) {
  const Floats rr = lanes::larger(lanes::all(1.0f), dot(reference, reference));
  const Floats gain = dot(seen, reference) / rr, across2 = dot(seen, seen) / rr - gain * gain;
  const Floats off = kSameHue * gain + kHueNoise;
  const Ints is_floor = (gain > kDeepestShadow) & (across2 < off * off);  // false for NaN
  return is_floor ? gain : lanes::all(1.0f);
}

struct Beside {
  Colours colour;
  Ints in_shadow;  ///< clearly in shadow
};

/// Colour beside the outline. On floor it is the measured colour if that is the reference in other light,
/// because the shadow of an object lies beside it. This shadow may be narrower than the search range.
/// Otherwise it is the reference, which has less noise. Beside another object it is the measured colour.
OMNIFLEET_INLINE Beside sampleBeside(const cv::Mat& image, const Normals& n, float out_px,
                                     const Colours& reference, const Ints& no_floor) {
  const auto outside = [&](float px) __attribute__((always_inline)) {
    return n.coloursAt(image, lanes::all(-px));
  };
  const Colours there = outside(out_px), beyond = outside(out_px + 1.0f), next = outside(kNext_px);
  const Colours seen = {0.5f * (there.blue + beyond.blue), 0.5f * (there.green + beyond.green),
                        0.5f * (there.red + beyond.red)};
  const Floats light = lightOf(seen, reference);
  const Ints is_wide = light < 1.0f - kDeepLight;
  const Ints is_narrow = ~is_wide & (lightOf(next, reference) < 1.0f - kDeepLight);
  const Colours floor = choose(light < 1.0f - kSameLight, seen, reference);
  return {choose(no_floor, there, choose(is_narrow, next, floor)), ~no_floor & (is_wide | is_narrow)};
}

/// True if an edge in brightness is the edge of a narrow shadow: just inside of it the floor's hue continues.
/// @param inside colour of the object, beyond the edge
OMNIFLEET_INLINE Ints isShadowEdge(const cv::Mat& image, const Normals& n, const Floats& edge,
                                   const Colours& inside, const Colours& reference, float least,
                                   float noise) {
  const Colours hue = hueOf(inside, reference);
  const Floats hue2 = dot(hue, hue);
  const Floats share = dot(hueOf(n.coloursAt(image, edge + kWithin_px), reference), hue) / hue2;
  const Floats brightness = length(reference), sure = kSureHue * brightness;
  const Ints is_light = dot(inside, reference) > kLight * dot(reference, reference);
  const Floats faint =
      lanes::larger(kLeastHue * brightness, lanes::smaller(lanes::all(kHueSigmas * noise), sure));
  const Floats min_hue = lanes::larger(lanes::all(least), is_light ? faint : sure);
  const Ints is_distinct = hue2 >= min_hue * min_hue;
  return is_distinct & (share < kFloorsHue);
}

/// Samples along the normals until a given share of the way between floor and object is reached.
struct Walk {
  Ints open;  ///< not reached yet
  Floats level = lanes::all(0.5f);
  Ints found{};
  Floats before{};  ///< share at the previous sample
  Floats shift{};   ///< position of the edge along the normal

  /// @param share share of the way at position s
  OMNIFLEET_INLINE void addSample(const Floats& share, const Floats& s, bool first) {
    const Ints reached = open & (share >= level);
    open &= ~reached;
    if (!first) {
      const Floats way = lanes::larger(share - before, lanes::all(1e-6f));
      shift = reached ? s - (share - level) / way * kStep_px : shift;
      found |= reached;
    }
    before = share;
  }
};

/// Share of the way between floor and object in brightness, at position s along the normals.
struct LumaShare {
  const cv::Mat& grey;
  const Normals& normals;
  Floats zero, total;
  OMNIFLEET_INLINE Floats at(const Floats& s) const { return (normals.greysAt(grey, s) - zero) / total; }
};

/// Share of the way between floor and object in a mixture of the channels.
struct ColourShare {
  const cv::Mat& image;
  const Normals& normals;
  Colours weight;
  Floats zero, total;
  OMNIFLEET_INLINE Floats at(const Floats& s) const {
    return (dot(normals.coloursAt(image, s), weight) - zero) / total;
  }
};

/// Locates edges again between the colours right beside them on both sides: a shadow or a tile on the floor,
/// one face of the object. It samples both sides symmetrically, so that blur does not shift the edge.
template <typename Share>
OMNIFLEET_INLINE void refineEdges(const Share& of, const Ints& which, Walk& walk) {
  if (!lanes::any(which & walk.found)) return;
  Floats share[kAround], s[kAround];
  for (int k = 0; k < kAround; ++k) {
    s[k] = walk.shift + kStep_px * (static_cast<float>(k) - 0.5f * (kAround - 1));
    share[k] = of.at(s[k]);
  }
  Walk again{which & walk.found};
  again.level = 0.25f * (share[0] + share[1] + share[kAround - 2] + share[kAround - 1]);
  again.open &= lanes::magnitude(again.level - 0.5f) < kMaxShift;  // false for NaN
  for (int k = 1; k < kAround && lanes::any(again.open); ++k) again.addSample(share[k], s[k], k == 1);
  walk.shift = again.found ? again.shift : walk.shift;
}

OMNIFLEET_INLINE void find(const ContourFrame& frame, const ContourOptions& options, EightEdges& edges) {
  const auto along_x = lanes::load<Floats>(edges.along_x), along_y = lanes::load<Floats>(edges.along_y);
  const Floats along = lanes::squareRoot(along_x * along_x + along_y * along_y);
  const Normals n{lanes::load<Floats>(edges.x_px), lanes::load<Floats>(edges.y_px), -along_y / along,
                  along_x / along};
  const Colours reference = {lanes::load<Floats>(edges.floor[0]), lanes::load<Floats>(edges.floor[1]),
                             lanes::load<Floats>(edges.floor[2])};
  const auto search = static_cast<float>(options.search_px), least = static_cast<float>(options.min_contrast);
  const Ints is_object = lanes::load<Ints>(edges.beside) != 0;
  const Beside beside = sampleBeside(frame.image, n, search + kBeyond_px, reference, is_object);
  const Colours& outside = beside.colour;
  const Colours inside = n.coloursAt(frame.image, lanes::all(search + kBeyond_px)), near = inside - outside;
  // A shadow gets darker towards the object. Its brightness has no step at the outline, but its hue has.
  const Floats whole = length(near), in_luma = dot(near, luma());
  Ints by_hue = beside.in_shadow &
                (length(hueOf(near, reference)) >= lanes::larger(kHueShare * whole, lanes::all(least)));
  Ints by_luma = ~by_hue & (lanes::magnitude(in_luma) >= kLumaShare * whole);
  const Ints usable = along >= 1e-3f;

  Walk walk{usable & by_luma & (lanes::magnitude(in_luma) >= least)};
  if (lanes::any(walk.open)) {
    const LumaShare share{frame.grey, n, dot(outside, luma()), in_luma};
    for (float s = -search; s <= search + 0.01f && lanes::any(walk.open); s += kStep_px)
      walk.addSample(share.at(lanes::all(s)), lanes::all(s), s == -search);
    refineEdges(share, by_luma, walk);
    const Ints is_shadow_edge =
        walk.found & ~is_object &
        isShadowEdge(frame.image, n, walk.shift, inside, reference, least, frame.hue_noise);
    by_hue |= is_shadow_edge;
    by_luma &= ~is_shadow_edge;
    walk.found &= ~is_shadow_edge;
  }
  const Ints left = usable & ~by_luma;
  if (lanes::any(left)) {  // chroma is blurred over twice as many pixels
    const float far = 2.0f * search;
    const Colours all = n.coloursAt(frame.image, lanes::all(far)) - outside,
                  contrast = choose(by_hue, hueOf(all, reference), all);
    const Floats strength = length(contrast);
    const Colours weight = (1.0f / strength) * contrast;
    const ColourShare share{frame.image, n, weight, dot(outside, weight), dot(contrast, weight)};
    walk.open = left & (strength > 0.0f) & (lanes::magnitude(share.total) >= least);
    walk.before = Floats{};
    for (float s = -far; s <= far + 0.01f && lanes::any(walk.open); s += kStep_px)
      walk.addSample(share.at(lanes::all(s)), lanes::all(s), s == -far);
    refineEdges(share, left & ~by_hue, walk);
  }
  lanes::store(walk.found ? n.x + walk.shift * n.in_x : n.x, edges.x_px);
  lanes::store(walk.found ? n.y + walk.shift * n.in_y : n.y, edges.y_px);
  lanes::store(walk.found, edges.found);
}

}  // namespace

OMNIFLEET_WIDE void findEdges(const ContourFrame& frame, const ContourOptions& options, EightEdges& edges) {
  find(frame, options, edges);
}

}  // namespace omnifleet::ground
