#pragma once

// OMNIFLEET_WIDE before a function's definition compiles it three times: for every processor, for AVX2 and
// for AVX-512. The loader selects the version. All versions give equal bits, because a library with such
// functions is compiled without fused multiply-add (-ffp-contract=off). Use it for loops over many pixels
// that the compiler vectorises. Functions called in such a loop must be inlined (always_inline).
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define OMNIFLEET_WIDE __attribute__((target_clones("default", "avx2", "arch=x86-64-v4")))
#else
#define OMNIFLEET_WIDE
#endif

// For the small functions that such loops call. They must become part of each version.
#if defined(__GNUC__)
#define OMNIFLEET_INLINE inline __attribute__((always_inline))
#else
#define OMNIFLEET_INLINE inline
#endif

namespace omnifleet {

/// Calls each(x) for all x of [begin, end), kChunk at a time, so that the compiler vectorises the calls.
/// There is no remainder of single calls: the last chunk overlaps the one before. So each(x) must not depend
/// on what another call writes, and must give the same result when repeated. Short ranges are
/// processed one by one.
template <int kChunk, typename Each>
OMNIFLEET_INLINE void inChunks(int begin, int end, Each each) {
  const auto chunkAt = [&each](int first) __attribute__((always_inline)) {
#pragma GCC ivdep
    for (int k = 0; k < kChunk; ++k) each(first + k);
  };
  if (end - begin < kChunk) {
    if constexpr (kChunk > 8)
      inChunks<kChunk / 2>(begin, end, each);
    else
      for (int x = begin; x < end; ++x) each(x);
    return;
  }
  for (int x = begin; x < end - kChunk; x += kChunk) chunkAt(x);
  chunkAt(end - kChunk);
}

}  // namespace omnifleet
