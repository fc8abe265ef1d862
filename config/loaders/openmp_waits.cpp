#include "config/loaders/openmp_waits.hpp"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <system_error>

namespace stillmap {

void shorten_openmp_waits(char** argv) {
  if (std::getenv("GOMP_SPINCOUNT") != nullptr || std::getenv("OMP_WAIT_POLICY") != nullptr) return;
  // By its own path, so that it keeps its name in lists of processes.
  std::error_code unknown;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", unknown);
  // Some 50 us: longer than most layers' threads differ, shorter than a scheduler's time slice.
  if (unknown || setenv("GOMP_SPINCOUNT", "1000", 0) != 0) return;
  execv(program.c_str(), argv);
}

}  // namespace stillmap
