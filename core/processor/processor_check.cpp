// Compiled for baseline x86-64, unlike the rest: prints an error before the program reaches an
// instruction that the processor does not support.
#include <unistd.h>

#include <cstring>

namespace {

void print_error(const char* text) {
  if (write(STDERR_FILENO, text, std::strlen(text)) < 0) _exit(1);
}

bool is_new_enough() {
  __builtin_cpu_init();
#ifdef __clang__
  // clang does not accept the names of x86-64 levels here; these features came with x86-64-v3.
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2") &&
         __builtin_cpu_supports("fma");
#else
  return __builtin_cpu_supports(STILLMAP_ARCH);
#endif
}

void check_processor() {
  if (is_new_enough()) return;
  print_error(
      "this program was built for " STILLMAP_ARCH
      " processors (AVX2; x86 since 2013), and this one is older; build it from source with "
      "cmake -DSTILLMAP_ARCH=\n");
  _exit(1);
}

// Runs before shared libraries are initialised: their initialisers may already call our instances
// of templates that both instantiate.
[[gnu::section(".preinit_array"), gnu::used]] void (*const run_first)() = check_processor;

}  // namespace
