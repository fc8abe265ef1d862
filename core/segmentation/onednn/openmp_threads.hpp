#pragma once

#include <omp.h>

namespace stillmap {

/// OpenMP, on which oneDNN runs, uses so many threads for calls from this thread while this lives.
/// oneDNN wants the same number when a primitive is made and when it is run.
///
/// At its end the threads are sent away: left to themselves they would spin for milliseconds, on
/// cores that others then wait for.
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
