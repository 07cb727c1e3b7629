#pragma once

// Counts what a thread takes from the heap, by whatever way: to be included by one file of a test
// program of its own. A build under the address sanitizer has a heap of its own, there is nothing to
// count.
#include <cerrno>
#include <cstddef>
#include <cstdlib>

namespace tunnel_pilot {

inline long& allocations() {
  thread_local long count = 0;
  return count;
}

/// How many allocations `work` makes.
template <class Work>
long allocationsOf(const Work& work) {
  const long before = allocations();
  work();
  return allocations() - before;
}

/// Allocations of something that allocates once: the counter counts.
inline long allocationsOfOne() {
  return allocationsOf([] {
    int* volatile one = new int;  // volatile: or the compiler leaves both out
    delete one;
  });
}

}  // namespace tunnel_pilot

#ifdef __SANITIZE_ADDRESS__
#define SKIP_WHERE_ALLOCATIONS_ARE_NOT_COUNTED() GTEST_SKIP() << "the sanitizer has its own heap"
#else
#define SKIP_WHERE_ALLOCATIONS_ARE_NOT_COUNTED() static_cast<void>(0)
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) noexcept {
  ++tunnel_pilot::allocations();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  ++tunnel_pilot::allocations();
  return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) noexcept {
  ++tunnel_pilot::allocations();
  return __libc_realloc(memory, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  ++tunnel_pilot::allocations();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) noexcept {
  ++tunnel_pilot::allocations();
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? ENOMEM : 0;
}
}
#endif
