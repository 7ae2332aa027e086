#pragma once

// OMNIFLEET_WIDE before a function's definition compiles it twice, for every processor and for those with
// AVX2; which one runs is settled when the program is loaded. No fused multiply-add: both give the same bits.
// For loops over many pixels that the compiler vectorises; what they call must be inlined (always_inline).
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define OMNIFLEET_WIDE __attribute__((target_clones("default", "avx2")))
#else
#define OMNIFLEET_WIDE
#endif

// For the small functions that such loops call: they must become part of each version.
#if defined(__GNUC__)
#define OMNIFLEET_INLINE inline __attribute__((always_inline))
#else
#define OMNIFLEET_INLINE inline
#endif
