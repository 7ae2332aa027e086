#include "appearance/parallax_kernel.h"

#include <cmath>

#include "geometry/lanes.h"
#include "geometry/wide.h"

namespace omnifleet::appearance {

using lanes::Floats;
using lanes::kLanes;

OMNIFLEET_WIDE void moveColumns(const float* grey, int padded, int columns, const float* shift, float sign,
                                float* out) {
  const int mask = columns - 1;  // a power of two
  for (int c = 0; c < columns; ++c) {
    const float at = static_cast<float>(c) + sign * shift[c], whole = std::floor(at), f = at - whole;
    const int i = static_cast<int>(whole);
    // Lagrange's weights for the nodes −2 … 3.
    const float a = f + 2.0f, b = f + 1.0f, d = f - 1.0f, e = f - 2.0f, g = f - 3.0f;
    const float w[6] = {-b * f * d * e * g / 120.0f, a * f * d * e * g / 24.0f,  -a * b * d * e * g / 12.0f,
                        a * b * f * e * g / 12.0f,   -a * b * f * d * g / 24.0f, a * b * f * d * e / 120.0f};
    const float* from[6];
    for (int k = 0; k < 6; ++k) from[k] = grey + ((i + k - 2) & mask) * padded;
    float* to = out + c * padded;
    for (int r = 0; r < padded; r += kLanes) {
      Floats sum = w[0] * lanes::load<Floats>(from[0] + r);
      for (int k = 1; k < 6; ++k) sum += w[k] * lanes::load<Floats>(from[k] + r);
      lanes::store(sum, to + r);
    }
  }
}

OMNIFLEET_WIDE void meanAndDifference(const float* a, const float* b, int count, float* mean,
                                      float* difference) {
#pragma GCC ivdep
  for (int k = 0; k < count; ++k) {
    mean[k] = 0.5f * (a[k] + b[k]);
    difference[k] = b[k] - a[k];
  }
}

OMNIFLEET_WIDE void sumColumns(const float* mean, const float* difference, int padded, int columns,
                               float per_rad, const RowGradient& gradient, const float* parallax,
                               const float* sine, const float* cosine, ColumnSums* sums) {
  const float half = 0.5f * per_rad;
  for (int c = 0; c < columns; ++c) {
    const float *here = mean + c * padded, *before = mean + (c > 0 ? c - 1 : columns - 1) * padded,
                *after = mean + (c + 1 < columns ? c + 1 : 0) * padded;
    Floats gg{}, gt{}, tt{}, gr{}, tr{}, rr{};
    for (int r = 0; r < padded; r += kLanes) {
      const Floats g = half * (lanes::load<Floats>(after + r) - lanes::load<Floats>(before + r));
      const Floats vertical =
          cosine[c] * (lanes::load<Floats>(gradient.above.data() + r) * lanes::load<Floats>(here + r - 1) +
                       lanes::load<Floats>(gradient.here.data() + r) * lanes::load<Floats>(here + r) +
                       lanes::load<Floats>(gradient.below.data() + r) * lanes::load<Floats>(here + r + 1));
      const Floats t = sine[c] * g + vertical;
      const Floats residual = lanes::load<Floats>(difference + c * padded + r) - parallax[c] * vertical;
      gg += g * g;
      gt += g * t;
      tt += t * t;
      gr += g * residual;
      tr += t * residual;
      rr += residual * residual;
    }
    sums[c] = {lanes::sum(gg), lanes::sum(gt), lanes::sum(tt),
               lanes::sum(gr), lanes::sum(tr), lanes::sum(rr)};
  }
}

OMNIFLEET_WIDE void sumProducts(const float* basis, const float* weight, int columns, float* out) {
  Floats low[16]{}, high[16]{};
  for (int c = 0; c < columns; ++c) {
    const float* u = basis + 16 * c;
    const Floats first = weight[c] * lanes::load<Floats>(u), second = weight[c] * lanes::load<Floats>(u + 8);
    for (int i = 0; i < 16; ++i) {
      low[i] += u[i] * first;
      high[i] += u[i] * second;
    }
  }
  for (int i = 0; i < 16; ++i) {
    lanes::store(low[i], out + 16 * i);
    lanes::store(high[i], out + 16 * i + 8);
  }
}

}  // namespace omnifleet::appearance
