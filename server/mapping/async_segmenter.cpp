#include "server/mapping/async_segmenter.hpp"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

namespace stillmap {
namespace {

constexpr std::uint32_t misses_until_too_slow = 3;
constexpr std::uint32_t unwaited_until_next_try = 4;
/// A scan that is due is put off by at most so many others while the mapper lags behind.
constexpr std::uint32_t most_put_off = 10;

double milliseconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

}  // namespace

std::chrono::milliseconds label_budget(const ServerConfig& config) {
  const bool every_scan_counts = config.input.delivery == Delivery::every;
  const LabelOrigin source = config.labels.source;
  const bool takes_no_time = source == LabelOrigin::stream || source == LabelOrigin::none;
  return std::chrono::milliseconds(every_scan_counts || takes_no_time ? 0U
                                                                      : config.labels.budget_ms);
}

PacedLabels::PacedLabels(std::unique_ptr<LabelSource> source, std::chrono::milliseconds budget,
                         const ScanQueue& queue, Statistics& statistics)
    : source_(std::move(source)),
      name_(source_->name()),
      full_columns_(source_->image_columns()),
      budget_(budget),
      queue_(queue),
      statistics_(statistics),
      cadence_(source_->costs()) {
  show_pace();
  if (!may_skip_scans()) return;
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

PacedLabels::~PacedLabels() = default;

LabelFeed::Answer PacedLabels::offer(const Scan& scan) {
  Answer answer;
  if (!may_skip_scans()) {
    answer.finished.push_back(segment(scan));
    return answer;
  }
  std::unique_lock lock(mutex_);
  if (is_due()) {
    job_ = scan;
    busy_ = true;
    offers_since_taken_ = 0;
    changed_.notify_all();
    if (is_worth_the_wait()) {
      const bool in_time = changed_.wait_for(lock, budget_, [this] { return !busy_; });
      misses_ = in_time ? 0 : misses_ + 1;
    }
    answer.pending = busy_;
  }
  answer.finished = std::exchange(finished_, {});
  return answer;
}

bool PacedLabels::is_due() {
  ++offers_since_taken_;
  if (busy_ || offers_since_taken_ < cadence_.every()) return false;
  return queue_.waiting() == 0 || offers_since_taken_ >= cadence_.every() + most_put_off;
}

// A source that was late several times is too slow. But one that runs beside the odometry takes
// longer than one that is waited for, so it gets another chance now and then.
bool PacedLabels::is_worth_the_wait() {
  return misses_ < misses_until_too_slow || ++unwaited_ % unwaited_until_next_try == 0;
}

void PacedLabels::work(const std::stop_token& stop) {
  while (true) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [this] { return job_.has_value(); })) return;
    const Scan scan = *std::exchange(job_, std::nullopt);
    lock.unlock();
    ScanLabels labels = segment(scan);
    lock.lock();
    finished_.push_back(std::move(labels));
    busy_ = false;
    changed_.notify_all();
  }
}

ScanLabels PacedLabels::segment(const Scan& scan) {
  const auto began = Clock::now();
  try {
    ScanLabels labels{scan.stamp_ns, source_->label(scan)};
    statistics_.labels_worked();
    segmented(milliseconds(Clock::now() - began));
    return labels;
  } catch (const std::exception& error) {
    statistics_.labels_failed(error.what());
    warnings_.warn("label_failure", std::string("segmentation failed: ") + error.what());
    return {scan.stamp_ns, {}};
  }
}

void PacedLabels::segmented(double network_ms) {
  statistics_.add_latency("network", network_ms);
  const std::scoped_lock lock(mutex_);
  const std::pair before(cadence_.coarseness(), cadence_.every());
  // Of the sensor, not of the scans that are offered: an overloaded server drops scans. Where every
  // scan gets its labels, none comes too fast.
  cadence_.scan_segmented(network_ms, statistics_.besides_labels_ms(),
                          may_skip_scans() ? statistics_.receive_period_ms() : 0.0);
  const std::pair now(cadence_.coarseness(), cadence_.every());
  source_->set_coarseness(now.first);
  show_pace();
  if (now != before) tell_of_pace(now > before);
}

void PacedLabels::show_pace() {
  statistics_.segmenting({.every = cadence_.every(),
                          .network_ms = cadence_.network_ms(),
                          .image_columns = static_cast<std::uint32_t>(source_->image_columns()),
                          .full_columns = static_cast<std::uint32_t>(full_columns_),
                          .fresh_share = 0.0,
                          .carried_share = 0.0,
                          .unlabelled_share = 0.0});
}

void PacedLabels::tell_of_pace(bool is_slower) const {
  const int columns = source_->image_columns();
  spdlog::log(is_slower ? spdlog::level::warn : spdlog::level::info,
              "{} is segmented now{}: that takes {:.0f} ms, all else {:.0f} ms, and scans come "
              "every {:.0f} ms",
              every_nth_scan(cadence_.every()),
              columns > 0 ? " in " + std::to_string(columns) + " columns" : "",
              cadence_.network_ms(), statistics_.besides_labels_ms(), cadence_.period_ms());
}

}  // namespace stillmap
