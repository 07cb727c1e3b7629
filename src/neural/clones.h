#pragma once

// Compiles a function once for each kind of vector instructions; the machine's best is taken at run
// time. Not under sanitizers that start later than the choice is made.
#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define TUNNEL_PILOT_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define TUNNEL_PILOT_CLONES
#endif

// What such a function calls must end up within it to be compiled likewise.
#define TUNNEL_PILOT_INLINE __attribute__((always_inline)) inline
