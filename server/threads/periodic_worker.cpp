#include "server/threads/periodic_worker.hpp"

#include <condition_variable>
#include <mutex>
#include <utility>

#include "server/threads/thread_failure.hpp"
#include "server/threads/thread_name.hpp"

namespace stillmap::server {
namespace {

class SteadyClock final : public MonotonicClock {
 public:
  [[nodiscard]] TimePoint now() const override { return std::chrono::steady_clock::now(); }
  void sleep_until(TimePoint time, const std::stop_token& stop) override {
    std::mutex mutex;
    std::condition_variable_any never_notified;
    std::unique_lock lock(mutex);
    never_notified.wait_until(lock, stop, time, [] { return false; });
  }
};

PeriodicWorker::Round with_pauses(std::chrono::duration<double> period, PeriodicWorker::Work work,
                                  const MonotonicClock& clock) {
  const auto pause = std::chrono::duration_cast<std::chrono::steady_clock::duration>(period);
  return [pause, work = std::move(work), &clock](const std::stop_token& stop) {
    work(stop);
    return clock.now() + pause;
  };
}

}  // namespace

MonotonicClock& MonotonicClock::steady() {
  static SteadyClock clock;
  return clock;
}

PeriodicWorker::PeriodicWorker(std::string name, std::chrono::duration<double> period, Work work,
                               MonotonicClock& clock)
    : PeriodicWorker(std::move(name), with_pauses(period, std::move(work), clock), clock) {}

PeriodicWorker::PeriodicWorker(std::string name, Round round, MonotonicClock& clock)
    : thread_(
          [name = std::move(name), round = std::move(round), &clock](const std::stop_token& stop) {
            name_this_thread(name);
            run_or_report([&] {
              while (!stop.stop_requested()) clock.sleep_until(round(stop), stop);
            });
          }) {}

}  // namespace stillmap::server
