#include "tests/support/allocation_guard.hpp"

#include <cerrno>
#include <cstddef>

#if defined(__has_feature)
#define ROSID_HAS_FEATURE(x) __has_feature(x)
#else
#define ROSID_HAS_FEATURE(x) 0
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || ROSID_HAS_FEATURE(address_sanitizer) || \
    ROSID_HAS_FEATURE(thread_sanitizer)
#define ROSID_SANITIZED 1
#else
#define ROSID_SANITIZED 0
#endif

namespace {
// Plain integers: initialised without code, so they may be touched from the first malloc of a thread on.
thread_local std::uint64_t t_allocations = 0;
thread_local int t_guards = 0;

void count_allocation() {
  if (t_guards > 0) { ++t_allocations; }
}
}  // namespace

#if ROSID_SANITIZED

// Declared here because gcc ships the function but not its header.
// NOLINTNEXTLINE(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp,readability-identifier-naming)
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*malloc_hook)(const volatile void*, std::size_t),
                                                         void (*free_hook)(const volatile void*));

namespace {
// The sanitizers own malloc; they call these for every allocation.
const int kHooksInstalled = __sanitizer_install_malloc_and_free_hooks(
    [](const volatile void* /*p*/, std::size_t /*size*/) { count_allocation(); }, [](const volatile void* /*p*/) {});
}  // namespace

#else

// The C library's own entry points; ours stand in front of them for the whole program, shared libraries included.
// NOLINTBEGIN(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp,readability-identifier-naming)
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* p, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* p);

void* malloc(std::size_t size) {
  count_allocation();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  count_allocation();
  return __libc_calloc(count, size);
}
void* realloc(void* p, std::size_t size) {
  count_allocation();
  return __libc_realloc(p, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  count_allocation();
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  count_allocation();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  count_allocation();
  void* p = __libc_memalign(alignment, size);
  if (p == nullptr) { return ENOMEM; }
  *out = p;
  return 0;
}
void free(void* p) {
  __libc_free(p);
}
}
// NOLINTEND(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp,readability-identifier-naming)

#endif

namespace rosid::test {

AllocationGuard::AllocationGuard() : at_start_(t_allocations) {
#if ROSID_SANITIZED
  static_cast<void>(kHooksInstalled);
#endif
  ++t_guards;
}

AllocationGuard::~AllocationGuard() {
  --t_guards;
}

std::uint64_t AllocationGuard::allocations() const {
  return t_allocations - at_start_;
}

}  // namespace rosid::test
