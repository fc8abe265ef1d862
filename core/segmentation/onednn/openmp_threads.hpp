#pragma once

#include <omp.h>

namespace stillmap {

/// Sets the number of OpenMP threads for oneDNN calls from this thread during its lifetime. oneDNN
/// requires the same number when a primitive is created and when it runs.
///
/// The destructor releases OpenMP's threads, which otherwise spin for milliseconds and keep cores
/// from other work.
class OpenMpThreads {
 public:
  explicit OpenMpThreads(int threads) : before_(omp_get_max_threads()) {
    omp_set_num_threads(threads);
  }
  ~OpenMpThreads() {
    omp_set_num_threads(before_);
    omp_pause_resource(omp_pause_soft, omp_get_initial_device());
  }
  OpenMpThreads(const OpenMpThreads&) = delete;
  OpenMpThreads& operator=(const OpenMpThreads&) = delete;

 private:
  int before_;
};

}  // namespace stillmap
