#include "clients/commands/live/replay_run.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/dataset/dataset_error.hpp"

namespace stillmap::cli {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds publish_step{500};
constexpr std::chrono::milliseconds status_period{100};

/// When a scan of a recording is due.
class ReplayClock {
 public:
  ReplayClock(std::int64_t first_stamp_ns, double rate)
      : first_stamp_ns_(first_stamp_ns), rate_(rate), began_(Clock::now()) {}

  /// Waits for the scan's time; true when told to stop instead.
  [[nodiscard]] bool wait_or_stop(std::int64_t stamp_ns, StopSignal& stop) const {
    if (rate_ <= 0.0) return stop.requested();
    const double due_ns = std::max(0.0, static_cast<double>(stamp_ns - first_stamp_ns_) / rate_);
    const auto due = began_ + std::chrono::nanoseconds(static_cast<std::int64_t>(due_ns));
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(due - Clock::now());
    return stop.wait_for(std::max(left, std::chrono::milliseconds(0)));
  }

 private:
  std::int64_t first_stamp_ns_;
  double rate_;
  Clock::time_point began_;
};

std::optional<DatasetFrame> read(const ScanDataset& dataset, std::size_t index,
                                 const ReplayOptions& options, ReplayResult& result,
                                 const ScanSkipped& scan_skipped) {
  try {
    DatasetFrame frame = dataset.read(index);
    if (!options.with_labels) {
      frame.raw_labels.clear();
      frame.scan.labels.clear();
    }
    // As the driver of this sensor sends it: the server scales it back.
    for (float& value : frame.scan.intensity) value /= dataset.suggested_sensor().intensity_scale;
    return frame;
  } catch (const DatasetError& error) {
    if (options.range.strict) throw;
    result.skipped.push_back({index, "unreadable", error.what()});
    scan_skipped(result.skipped.back());
    return std::nullopt;
  }
}

// In short steps, so that the wait for the server can be interrupted. False when told to stop.
bool publish(ScanPublisher& publisher, const DatasetFrame& frame, const ReplayOptions& options,
             StopSignal& stop) {
  const auto began = Clock::now();
  while (!publisher.publish(frame.scan, frame.raw_labels, publish_step)) {
    if (stop.requested()) return false;
    if (Clock::now() - began > options.idle_timeout) {
      throw ServiceTimeout(
          "the server has taken no scan for " +
          std::to_string(options.idle_timeout.count() / 1000) +
          " s: did it stop? 'stillmap status' tells; a lossless replay needs a server with input "
          "delivery: every");
    }
  }
  return true;
}

}  // namespace

ReplayResult replay_dataset(const ScanDataset& dataset, const ReplayOptions& options,
                            ScanPublisher& publisher, StopSignal& stop, const ScanDone& scan_done,
                            const ScanSkipped& scan_skipped) {
  const std::size_t end = options.range.end(dataset);
  const auto began = Clock::now();
  const ReplayClock clock(dataset.stamp_ns(options.range.first), options.rate);
  ReplayResult result;
  for (std::size_t index = options.range.first; index < end && !result.stopped; ++index) {
    const auto frame = read(dataset, index, options, result, scan_skipped);
    if (frame) {
      result.stopped = clock.wait_or_stop(dataset.stamp_ns(index), stop) ||
                       !publish(publisher, *frame, options, stop);
      if (!result.stopped) result.published_stamps_ns.push_back(frame->scan.stamp_ns);
    }
    (void)scan_done(index + 1 - options.range.first);
  }
  result.acknowledged = publisher.wait_for_all_acknowledged(options.idle_timeout);
  result.seconds = std::chrono::duration<double>(Clock::now() - began).count();
  return result;
}

ServerCounts counts_since(const dds::ServerStatus& before, const dds::ServerStatus& now) {
  return {.mapped = now.counter("scans_mapped") - before.counter("scans_mapped"),
          .dropped = now.dropped() - before.dropped()};
}

dds::ServerStatus wait_until_mapped(Client& client, const dds::ServerStatus& before,
                                    std::uint64_t scans, std::chrono::milliseconds idle_timeout,
                                    StopSignal& stop) {
  dds::ServerStatus status = client.status();
  auto changed = Clock::now();
  std::uint64_t done_before = 0;
  while (true) {
    const ServerCounts counts = counts_since(before, status);
    const std::uint64_t done = counts.mapped + counts.dropped;
    if (done != std::exchange(done_before, done)) changed = Clock::now();
    if (done >= scans || Clock::now() - changed > idle_timeout) return status;
    if (stop.wait_for(status_period)) return status;
    status = client.status();
  }
}

}  // namespace stillmap::cli
