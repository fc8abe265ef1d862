#include "clients/commands/model/speed_beside_load.hpp"

#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cassert>
#include <chrono>
#include <ctime>
#include <deque>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>

#include "core/lidar/ranked_value.hpp"

namespace stillmap::cli {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_of(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// Threads that do nothing as fast as they can.
class BusyLoops {
 public:
  explicit BusyLoops(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      threads_.emplace_back([](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
        }
      });
    }
  }

  /// Processor time until now [s].
  [[nodiscard]] double cpu_s() {
    double sum = 0.0;
    for (std::jthread& thread : threads_) {
      clockid_t clock{};
      if (pthread_getcpuclockid(thread.native_handle(), &clock) == 0) sum += seconds_of(clock);
    }
    return sum;
  }

 private:
  std::vector<std::jthread> threads_;
};

/// Time that the cores of this process had nothing to do [s]; 0 where the system does not say.
double idle_s() {
  cpu_set_t mine;
  CPU_ZERO(&mine);
  if (sched_getaffinity(0, sizeof mine, &mine) != 0) return 0.0;
  double ticks = 0.0;
  std::ifstream stat("/proc/stat");
  for (std::string line; std::getline(stat, line);) {
    std::istringstream fields(line);
    std::string cpu;
    double user = 0.0, nice = 0.0, system = 0.0, idle = 0.0, io_wait = 0.0;
    fields >> cpu >> user >> nice >> system >> idle >> io_wait;
    if (!cpu.starts_with("cpu") || cpu.size() == 3) continue;
    if (CPU_ISSET(std::stoul(cpu.substr(3)), &mine)) ticks += idle + io_wait;
  }
  return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

/// Segments again and again until the deadline; the times of the scans [ms].
std::vector<double> segment_until(Clock::time_point deadline, Segmenter& segmenter,
                                  const Scan& scan) {
  std::vector<double> times_ms;
  while (Clock::now() < deadline) {
    const auto began = Clock::now();
    static_cast<void>(segmenter.segment(scan));
    times_ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - began).count());
  }
  return times_ms;
}

std::vector<double> segment_in_threads(std::size_t threads, Clock::time_point deadline,
                                       Segmenter& segmenter, const Scan& scan) {
  std::deque<std::vector<double>> of_threads(threads);
  {
    std::vector<std::jthread> running;
    for (std::vector<double>& times_ms : of_threads)
      running.emplace_back([&] { times_ms = segment_until(deadline, segmenter, scan); });
  }
  std::vector<double> all_ms;
  for (const auto& times_ms : of_threads)
    all_ms.insert(all_ms.end(), times_ms.begin(), times_ms.end());
  return all_ms;
}

/// What is measured in turns until the rounds are over.
struct Setting {
  SpeedBesideLoad speed;
  std::vector<double> times_ms = {};

  void run(Segmenter& segmenter, const Scan& scan, double turn_s) {
    const bool across = speed.parallelism == Parallelism::across_scans;
    segmenter.set_parallelism(speed.parallelism);
    BusyLoops loops(speed.loops);
    const double loops_before_s = loops.cpu_s(), idle_before_s = idle_s();
    const double cpu_before_s = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
    const auto began = Clock::now();
    const auto deadline =
        began + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(turn_s));
    const std::vector<double> turn_ms =
        segment_in_threads(across ? segmenter.concurrent_scans() : 1, deadline, segmenter, scan);
    const double loops_s = loops.cpu_s() - loops_before_s;
    const double process_s = seconds_of(CLOCK_PROCESS_CPUTIME_ID) - cpu_before_s;
    speed.wall_s += std::chrono::duration<double>(Clock::now() - began).count();
    speed.cpu_s += process_s - loops_s;
    speed.available_s += process_s + idle_s() - idle_before_s;
    speed.scans += turn_ms.size();
    times_ms.insert(times_ms.end(), turn_ms.begin(), turn_ms.end());
  }
};

/// Scans for each second of what the threads' share of the cores is.
double scans_of_share(const SpeedBesideLoad& speed, std::size_t threads) {
  const auto sharing = static_cast<double>(threads + speed.loops);
  return static_cast<double>(speed.scans) * sharing /
         (speed.available_s * static_cast<double>(threads));
}

}  // namespace

std::vector<SpeedBesideLoad> measure_beside_load(Segmenter& segmenter, const Scan& scan,
                                                 const std::vector<std::size_t>& loops, int rounds,
                                                 double turn_s) {
  assert(!loops.empty() && loops.front() == 0);
  std::vector<Setting> settings;
  for (const std::size_t count : loops) {
    for (const auto parallelism : {Parallelism::within_scan, Parallelism::across_scans})
      settings.push_back({{.loops = count, .parallelism = parallelism}});
  }
  // Opens the networks, and warms the caches.
  for (Setting& setting : std::span(settings).first(2)) {
    Setting(setting).run(segmenter, scan, turn_s);
  }
  for (int round = 0; round < rounds; ++round) {
    for (Setting& setting : settings) setting.run(segmenter, scan, turn_s);
  }
  const std::size_t threads = segmenter.concurrent_scans();
  const double alone = std::max(scans_of_share(settings[0].speed, threads),
                                scans_of_share(settings[1].speed, threads));
  std::vector<SpeedBesideLoad> speeds;
  for (Setting& setting : settings) {
    setting.speed.scan_ms = median_of(setting.times_ms);
    setting.speed.of_fair_share = scans_of_share(setting.speed, threads) / alone;
    speeds.push_back(setting.speed);
  }
  return speeds;
}

}  // namespace stillmap::cli
