// Preloaded into a server (LD_PRELOAD), makes one of its threads fail: once the file
// $STILLMAP_FAULT is there, the next tile whose content is hashed throws what nobody expects.

#include <dlfcn.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

extern "C" std::uint64_t XXH3_64bits(const void* bytes, std::size_t length) {
  static std::atomic<bool> has_failed = false;
  const char* const control = std::getenv("STILLMAP_FAULT");
  if (control != nullptr && access(control, F_OK) == 0 && !has_failed.exchange(true)) {
    throw "a fault of the test";
  }
  using Hash = std::uint64_t(const void*, std::size_t);
  static auto* const real = reinterpret_cast<Hash*>(dlsym(RTLD_NEXT, "XXH3_64bits"));
  return real(bytes, length);
}
