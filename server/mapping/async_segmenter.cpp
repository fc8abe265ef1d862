#include "server/mapping/async_segmenter.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <iterator>
#include <utility>

#include "server/mapping/milliseconds.hpp"

namespace stillmap::server {
namespace {

constexpr std::uint32_t max_misses = 3;
constexpr std::uint32_t scans_until_retry = 4;
/// A scan that is due is put off by at most so many others while scans wait to be mapped.
constexpr std::uint32_t max_postponed_scans = 10;

}  // namespace

std::chrono::milliseconds segmentation_budget(const ServerConfig& config) {
  const bool every_scan_counts = config.input.delivery == DeliveryMode::every;
  const LabelProvider source = config.labels.source;
  const bool takes_no_time = source == LabelProvider::stream || source == LabelProvider::none;
  return std::chrono::milliseconds(every_scan_counts || takes_no_time ? 0U
                                                                      : config.labels.budget_ms);
}

AsyncSegmenter::AsyncSegmenter(std::unique_ptr<Segmenter> source, std::chrono::milliseconds budget,
                               const ScanQueue& queue, Statistics& statistics)
    : source_(std::move(source)),
      name_(source_->name()),
      full_columns_(source_->image_columns()),
      budget_(budget),
      queue_(queue),
      statistics_(statistics),
      rate_controller_(source_->relative_costs()),
      parallelism_controller_(source_->concurrent_scans()),
      submitted_(source_->concurrent_scans()) {
  report_rate();
  if (!may_skip_scans()) return;
  for (std::size_t i = 0; i < source_->concurrent_scans(); ++i) {
    workers_.emplace_back(
        "segmenter", submitted_,
        [this](const Submitted& submitted) {
          ScanLabels labels = segment(submitted.scan);
          const std::scoped_lock lock(mutex_);
          finished_.push_back(std::move(labels));
          in_work_.erase(submitted.number);
          finished_changed_.notify_all();
        },
        WorkerOptions{.finishes_queue = true});
  }
}

SegmentationPipeline::Output AsyncSegmenter::submit(const Scan& scan) {
  Output output;
  if (!may_skip_scans()) {
    output.finished.push_back(segment(scan));
    return output;
  }
  if (source_->has_labels(scan)) {
    output.finished.push_back({scan.stamp_ns, source_->segment(scan)});
    statistics_.segmentation_succeeded();
  }
  std::unique_lock lock(mutex_);
  if (output.finished.empty() && is_due()) {
    const std::uint64_t number = ++submissions_;
    in_work_.insert(number);
    scans_since_segmented_ = 0;
    submitted_.push_dropping_oldest({number, scan});
    if (should_wait()) {
      const bool in_time =
          finished_changed_.wait_for(lock, budget_, [&] { return !in_work_.contains(number); });
      misses_ = in_time ? 0 : misses_ + 1;
    }
    output.pending = in_work_.contains(number);
  }
  std::ranges::move(finished_, std::back_inserter(output.finished));
  finished_.clear();
  std::ranges::sort(output.finished, {}, &ScanLabels::stamp_ns);
  return output;
}

bool AsyncSegmenter::is_due() {
  ++scans_since_segmented_;
  if (in_work_.size() >= parallelism_controller_.scans_at_a_time()) return false;
  if (scans_since_segmented_ < rate_controller_.every()) return false;
  return queue_.waiting() == 0 ||
         scans_since_segmented_ >= rate_controller_.every() + max_postponed_scans;
}

// A source that was late several times is too slow to wait for. But one that runs beside the
// odometry takes longer than one that is waited for, so waiting is tried again every few scans.
bool AsyncSegmenter::should_wait() {
  // While the mapping thread waits, it submits no other scan to work on beside this one.
  if (parallelism_controller_.scans_at_a_time() > 1) return false;
  return misses_ < max_misses || ++scans_without_wait_ % scans_until_retry == 0;
}

ScanLabels AsyncSegmenter::segment(const Scan& scan) {
  std::unique_lock lock(mutex_);
  const Parallelism parallelism = parallelism_controller_.parallelism();
  lock.unlock();
  const auto began = Clock::now();
  try {
    ScanLabels labels{scan.stamp_ns, source_->segment(scan)};
    statistics_.segmentation_succeeded();
    record_duration(parallelism, milliseconds(Clock::now() - began));
    return labels;
  } catch (const std::exception& error) {
    statistics_.segmentation_failed(error.what());
    const std::scoped_lock failed(mutex_);
    throttled_log_.warn("label_failure", std::string("segmentation failed: ") + error.what());
    return {scan.stamp_ns, {}};
  }
}

void AsyncSegmenter::record_duration(Parallelism parallelism, double network_ms) {
  statistics_.add_latency("network", network_ms);
  const std::scoped_lock lock(mutex_);
  latency_ms_.add(network_ms);
  const std::pair before(parallelism_controller_.parallelism(),
                         rate_controller_.resolution_level());
  parallelism_controller_.add_measurement(parallelism, network_ms / relative_cost(),
                                          rate_controller_.room_ms());
  source_->set_parallelism(parallelism_controller_.parallelism());
  // Resolution and rate are fitted to a parallelism that stays.
  if (parallelism_controller_.is_settled()) adapt_rate(network_ms);
  const std::pair now(parallelism_controller_.parallelism(), rate_controller_.resolution_level());
  if (now != before) latency_ms_ = RecentMedian(latency_window);
  report_rate();
}

double AsyncSegmenter::relative_cost() const {
  const std::vector<double> costs = source_->relative_costs();
  return costs[rate_controller_.resolution_level()] / costs.back();
}

void AsyncSegmenter::adapt_rate(double network_ms) {
  const std::pair before(rate_controller_.resolution_level(), rate_controller_.every());
  // The sensor's period, not that of the submitted scans: an overloaded server drops scans. Where
  // every scan is segmented, none comes too fast.
  rate_controller_.add_measurement(
      network_ms / static_cast<double>(parallelism_controller_.scans_at_a_time()),
      statistics_.other_stages_ms(), may_skip_scans() ? statistics_.receive_period_ms() : 0.0);
  const std::pair now(rate_controller_.resolution_level(), rate_controller_.every());
  source_->set_resolution_level(now.first);
  if (now != before) log_rate_change(now > before);
}

double AsyncSegmenter::latency_ms() const {
  if (latency_ms_.size() > 0) return latency_ms_.value();
  return rate_controller_.network_ms() *
         static_cast<double>(parallelism_controller_.scans_at_a_time());
}

void AsyncSegmenter::report_rate() {
  statistics_.set_segmentation_status(
      {.interval = rate_controller_.every(),
       .inference_ms = latency_ms(),
       .image_columns = static_cast<std::uint32_t>(source_->image_columns()),
       .full_columns = static_cast<std::uint32_t>(full_columns_),
       .fresh_share = 0.0,
       .propagated_share = 0.0,
       .unlabelled_share = 0.0});
}

void AsyncSegmenter::log_rate_change(bool is_slower) const {
  const int columns = source_->image_columns();
  spdlog::log(is_slower ? spdlog::level::warn : spdlog::level::info,
              "{} is segmented now{}: that takes {:.0f} ms, all else {:.0f} ms, and scans come "
              "every {:.0f} ms",
              dds::every_nth_scan(rate_controller_.every()),
              columns > 0 ? " in " + std::to_string(columns) + " columns" : "", latency_ms_.value(),
              statistics_.other_stages_ms(), rate_controller_.period_ms());
}

}  // namespace stillmap::server
