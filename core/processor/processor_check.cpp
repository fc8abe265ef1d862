// Compiled for any x86-64, whatever the rest is compiled for: says why the program cannot run
// before an instruction that the processor lacks would end it without a word.
#include <unistd.h>

#include <cstring>

namespace {

void say(const char* text) {
  // Nothing is to be done where even stderr is gone.
  if (write(STDERR_FILENO, text, std::strlen(text)) < 0) _exit(1);
}

bool is_new_enough() {
  __builtin_cpu_init();
#ifdef __clang__
  // It has no names for the levels of x86-64 there; these came with the third.
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2") &&
         __builtin_cpu_supports("fma");
#else
  return __builtin_cpu_supports(STILLMAP_ARCH);
#endif
}

void check_processor() {
  if (is_new_enough()) return;
  say("this program was built for " STILLMAP_ARCH
      " processors (AVX2; x86 since 2013), and this one is older; build it from source with "
      "cmake -DSTILLMAP_ARCH=\n");
  _exit(1);
}

// Called before shared libraries are initialised: they already use our copies of the templates that
// both instantiate.
[[gnu::section(".preinit_array"), gnu::used]] void (*const run_first)() = check_processor;

}  // namespace
