#include "server/monitoring/statistics.hpp"

#include <algorithm>

namespace stillmap::server {
namespace {

constexpr std::chrono::seconds rate_window{5};
constexpr std::size_t label_provenance_window = 100;

}  // namespace

void RateWindow::add(Clock::time_point event) {
  events_.push_back(event);
  while (event - events_.front() > rate_window) events_.pop_front();
}

double RateWindow::rate_hz(Clock::time_point now) const {
  const auto is_recent = [&](Clock::time_point event) { return now - event <= rate_window; };
  const auto first = std::ranges::find_if(events_, is_recent);
  const auto count = static_cast<double>(events_.end() - first);
  if (count < 2) return count / std::chrono::duration<double>(rate_window).count();
  // Between the events, so that the rate is right from the second scan on.
  const double span_s = std::chrono::duration<double>(now - *first).count();
  return count / std::max(span_s, 1e-3);
}

void LabelProvenanceWindow::add(LabelProvenance label_provenance) {
  last_.push_back(label_provenance);
  if (last_.size() > label_provenance_window) last_.pop_front();
}

double LabelProvenanceWindow::share(LabelProvenance label_provenance) const {
  if (last_.empty()) return 0.0;
  return static_cast<double>(std::ranges::count(last_, label_provenance)) /
         static_cast<double>(last_.size());
}

void Statistics::scan_received() {
  const std::scoped_lock lock(mutex_);
  ++received_;
  received_rate_.add(RateWindow::Clock::now());
}

void Statistics::record_scan_header(const std::string& frame, double delay_s) {
  const std::scoped_lock lock(mutex_);
  scan_frame_ = frame;
  scan_delay_s_ = delay_s;
}

void Statistics::scan_mapped(LabelProvenance label_provenance) {
  const std::scoped_lock lock(mutex_);
  label_provenances_.add(label_provenance);
  ++mapped_;
  mapped_rate_.add(RateWindow::Clock::now());
  last_drop_.clear();
}

void Statistics::set_segmentation_status(const dds::SegmentationStatus& pace) {
  const std::scoped_lock lock(mutex_);
  segmentation_ = pace;
}

void Statistics::segmentation_failed(const std::string& detail) {
  const std::scoped_lock lock(mutex_);
  ++segmentation_failures_;
  last_segmentation_failure_ = detail;
}

void Statistics::segmentation_succeeded() {
  const std::scoped_lock lock(mutex_);
  last_segmentation_failure_.clear();
}

void Statistics::scans_dropped(const std::string& reason, std::size_t count,
                               const std::string& detail) {
  const std::scoped_lock lock(mutex_);
  const std::string name = "dropped_" + reason;
  const auto known = std::ranges::find(dropped_, name, &dds::NamedCounter::name);
  dds::NamedCounter& counter =
      known == dropped_.end() ? dropped_.emplace_back(dds::NamedCounter{.name = name}) : *known;
  counter.value += count;
  last_drop_ = detail;
}

void Statistics::count(const std::string& event) {
  const std::scoped_lock lock(mutex_);
  const auto known = std::ranges::find(events_, event, &dds::NamedCounter::name);
  (known == events_.end() ? events_.emplace_back(dds::NamedCounter{.name = event}) : *known)
      .value += 1;
}

void Statistics::add_latency(const std::string& stage, double milliseconds) {
  const std::scoped_lock lock(mutex_);
  const auto known = std::ranges::find(stages_, stage, &StageStatistics::stage);
  StageStatistics& times =
      known == stages_.end() ? stages_.emplace_back(StageStatistics{stage, {}, {}}) : *known;
  times.recent.add(milliseconds);
  times.all.add(milliseconds / 1000.0);
}

void Statistics::record_other_stages(double milliseconds) {
  const std::scoped_lock lock(mutex_);
  other_stages_ms_.add(milliseconds);
}

void Statistics::set_map_memory(const MemoryUse& memory, std::size_t unreadable_tiles) {
  const std::scoped_lock lock(mutex_);
  map_memory_ = memory;
  unreadable_tiles_ = unreadable_tiles;
}

void Statistics::report_to(dds::ServerStatus& status) const {
  const std::scoped_lock lock(mutex_);
  const auto now = RateWindow::Clock::now();
  status.received_hz = received_rate_.rate_hz(now);
  status.mapped_hz = mapped_rate_.rate_hz(now);
  status.scan_frame = scan_frame_;
  status.scan_delay_s = scan_delay_s_;
  status.counters = {{.name = "scans_received", .value = received_},
                     {.name = "scans_mapped", .value = mapped_}};
  if (map_memory_.bytes > 0) {
    status.counters.push_back({.name = "map_memory_kib", .value = map_memory_.bytes >> 10});
    status.counters.push_back({.name = "map_tiles_away", .value = map_memory_.non_resident_tiles});
  }
  if (unreadable_tiles_ > 0) {
    status.counters.push_back({.name = "map_tiles_unreadable", .value = unreadable_tiles_});
  }
  if (segmentation_failures_ > 0) {
    status.counters.push_back({.name = "label_failures", .value = segmentation_failures_});
  }
  status.counters.insert(status.counters.end(), dropped_.begin(), dropped_.end());
  status.counters.insert(status.counters.end(), events_.begin(), events_.end());
  status.segmentation = segmentation_;
  status.segmentation.fresh_share = label_provenances_.share(LabelProvenance::fresh);
  status.segmentation.propagated_share = label_provenances_.share(LabelProvenance::propagated);
  status.segmentation.unlabelled_share = label_provenances_.share(LabelProvenance::none);
  status.latencies.clear();
  for (const StageStatistics& times : stages_) {
    status.latencies.push_back(times.recent.summary(times.stage));
  }
}

std::vector<StageStatistics> Statistics::stage_statistics() const {
  const std::scoped_lock lock(mutex_);
  return stages_;
}

MemoryUse Statistics::map_memory() const {
  const std::scoped_lock lock(mutex_);
  return map_memory_;
}

std::uint64_t Statistics::received() const {
  const std::scoped_lock lock(mutex_);
  return received_;
}

double Statistics::receive_period_ms() const {
  const std::scoped_lock lock(mutex_);
  const double rate_hz = received_rate_.rate_hz(RateWindow::Clock::now());
  return rate_hz > 0.0 ? 1000.0 / rate_hz : 0.0;
}

double Statistics::other_stages_ms() const {
  const std::scoped_lock lock(mutex_);
  return other_stages_ms_.value();
}

std::string Statistics::last_drop() const {
  const std::scoped_lock lock(mutex_);
  return last_drop_;
}

std::string Statistics::last_segmentation_failure() const {
  const std::scoped_lock lock(mutex_);
  return last_segmentation_failure_;
}

}  // namespace stillmap::server
