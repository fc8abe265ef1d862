#include <pthread.h>
#include <time.h>

// GCC 12's ThreadSanitizer does not know pthread_mutex_clocklock, by which the C++ library locks
// timed mutexes: it sees their unlocking alone, and what they guard looks like races. In front of
// the C library's, this one locks by a function that it knows. Fast DDS has such mutexes.
extern "C" __attribute__((visibility("default"))) int pthread_mutex_clocklock(
    pthread_mutex_t* mutex, clockid_t clock, const timespec* until) noexcept {
  constexpr long long second_ns = 1'000'000'000;
  timespec now{};
  timespec real{};
  clock_gettime(clock, &now);
  clock_gettime(CLOCK_REALTIME, &real);
  const long long until_ns = (until->tv_sec - now.tv_sec + real.tv_sec) * second_ns +
                             until->tv_nsec - now.tv_nsec + real.tv_nsec;
  const timespec real_until{.tv_sec = until_ns / second_ns, .tv_nsec = until_ns % second_ns};
  return pthread_mutex_timedlock(mutex, &real_until);
}
