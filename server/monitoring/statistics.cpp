#include "server/monitoring/statistics.hpp"

#include <algorithm>
#include <chrono>

#include "server/monitoring/metrics.hpp"
#include "server/monitoring/shown_name.hpp"

namespace stillmap::server {
namespace {

std::uint64_t whole(double value) { return static_cast<std::uint64_t>(value); }

/// The counter of this name, which becomes a member of the family when it first occurs.
prometheus::Counter& member(std::vector<std::pair<std::string, prometheus::Counter*>>& known,
                            Metrics::Counters& family, const char* label, const std::string& name) {
  using Entry = std::pair<std::string, prometheus::Counter*>;
  const auto found = std::ranges::find(known, name, &Entry::first);
  if (found != known.end()) return *found->second;
  return *known.emplace_back(name, &family.Add({{label, name}})).second;
}

}  // namespace

Statistics::Statistics() : metrics_(std::make_unique<Metrics>()) {}

Statistics::~Statistics() = default;

void Statistics::scan_received() {
  const std::scoped_lock lock(mutex_);
  metrics_->scans_received.Increment();
  received_rate_.add(RateWindow::Clock::now());
}

void Statistics::record_scan_header(const std::string& frame, double delay_s) {
  const std::scoped_lock lock(mutex_);
  scan_frame_ = shown_name(frame);
  scan_delay_s_ = delay_s;
}

void Statistics::scan_mapped(LabelProvenance label_provenance) {
  const std::scoped_lock lock(mutex_);
  metrics_->scans_mapped.Increment();
  label_provenances_.add(label_provenance);
  mapped_rate_.add(RateWindow::Clock::now());
  last_drop_.clear();
}

void Statistics::set_segmentation_status(const dds::SegmentationStatus& segmentation) {
  const std::scoped_lock lock(mutex_);
  segmentation_ = segmentation;
}

void Statistics::segmentation_failed(const std::string& detail) {
  const std::scoped_lock lock(mutex_);
  metrics_->label_failures.Increment();
  last_segmentation_failure_ = detail;
}

void Statistics::segmentation_succeeded() {
  const std::scoped_lock lock(mutex_);
  last_segmentation_failure_.clear();
}

void Statistics::scans_dropped(const std::string& reason, std::size_t count,
                               const std::string& detail) {
  const std::scoped_lock lock(mutex_);
  member(dropped_, metrics_->scans_dropped, "reason", reason).Increment(static_cast<double>(count));
  last_drop_ = detail;
}

void Statistics::bad_cloud(const std::string& fault) {
  const std::scoped_lock lock(mutex_);
  member(bad_clouds_, metrics_->bad_clouds, "fault", fault).Increment();
}

void Statistics::sweep_without(const std::string& lidar) {
  const std::scoped_lock lock(mutex_);
  member(sweeps_without_, metrics_->sweeps_without, "lidar", lidar).Increment();
}

void Statistics::scans_lost(std::uint64_t count) {
  metrics_->scans_lost.Increment(static_cast<double>(count));
}

void Statistics::count(const std::string& event, std::uint64_t times) {
  const std::scoped_lock lock(mutex_);
  member(events_, metrics_->events, "event", event).Increment(static_cast<double>(times));
}

void Statistics::add_latency(const std::string& stage, double milliseconds) {
  const std::scoped_lock lock(mutex_);
  auto known = std::ranges::find(stages_, stage, &Stage::name);
  if (known == stages_.end()) {
    auto& all = Metrics::add_durations(metrics_->stage_durations, {{"stage", stage}});
    known = stages_.insert(known, Stage{stage, {}, &all});
  }
  known->recent.add(milliseconds);
  known->all->Observe(milliseconds / 1000.0);
}

void Statistics::record_other_stages(double milliseconds) {
  const std::scoped_lock lock(mutex_);
  other_stages_ms_.add(milliseconds);
}

void Statistics::map_saved(double seconds) {
  const std::scoped_lock lock(mutex_);
  last_save_failure_.clear();
  metrics_->checkpoints_failing.Set(0.0);
  metrics_->checkpoint_durations.Observe(seconds);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  metrics_->last_checkpoint.Set(std::chrono::duration<double>(now).count());
}

void Statistics::map_save_failed(const std::string& why) {
  const std::scoped_lock lock(mutex_);
  last_save_failure_ = why;
  metrics_->checkpoint_failures.Increment();
  metrics_->checkpoints_failing.Increment();
}

void Statistics::set_map_displaced(const std::string& text) {
  const std::scoped_lock lock(mutex_);
  map_displaced_ = text;
}

void Statistics::set_maps_left(const std::string& text) {
  const std::scoped_lock lock(mutex_);
  maps_left_ = text;
}

void Statistics::set_input_fault(const std::string& input, const std::string& why) {
  const std::scoped_lock lock(mutex_);
  input_faults_[input] = why;
}

std::string Statistics::input_faults() const {
  const std::scoped_lock lock(mutex_);
  std::string all;
  for (const auto& [input, why] : input_faults_)
    if (!why.empty()) all += (all.empty() ? "" : "; ") + why;
  return all;
}

void Statistics::set_sensor(const std::string& name) {
  const std::scoped_lock lock(mutex_);
  sensor_ = name;
}

std::string Statistics::sensor() const {
  const std::scoped_lock lock(mutex_);
  return sensor_;
}

void Statistics::set_place_search(const std::string& text) {
  const std::scoped_lock lock(mutex_);
  place_search_ = text;
}

std::string Statistics::place_search() const {
  const std::scoped_lock lock(mutex_);
  return place_search_;
}

void Statistics::set_map_memory(const MemoryUse& memory, std::size_t unreadable_tiles) {
  metrics_->map_memory_bytes.Set(static_cast<double>(memory.bytes));
  metrics_->map_tiles_evicted.Set(static_cast<double>(memory.non_resident_tiles));
  metrics_->map_tiles_unreadable.Set(static_cast<double>(unreadable_tiles));
}

std::vector<dds::NamedCounter> Statistics::counters() const {
  const Metrics& metrics = *metrics_;
  std::vector<dds::NamedCounter> all{
      {.name = "scans_received", .value = whole(metrics.scans_received.Value())},
      {.name = "scans_mapped", .value = whole(metrics.scans_mapped.Value())}};
  const auto add = [&](const std::string& name, double value) {
    all.push_back({.name = name, .value = whole(value)});
  };
  if (const double lost = metrics.scans_lost.Value(); lost > 0.0) add("scans_lost", lost);
  if (const double bytes = metrics.map_memory_bytes.Value(); bytes > 0.0) {
    add("map_memory_kib", bytes / 1024.0);
    add("map_tiles_evicted", metrics.map_tiles_evicted.Value());
  }
  if (const double tiles = metrics.map_tiles_unreadable.Value(); tiles > 0.0) {
    add("map_tiles_unreadable", tiles);
  }
  if (const double failures = metrics.checkpoint_failures.Value(); failures > 0.0) {
    add("checkpoint_failures", failures);
    add(dds::checkpoints_failing_counter, metrics.checkpoints_failing.Value());
  }
  if (const double failures = metrics.label_failures.Value(); failures > 0.0) {
    add("label_failures", failures);
  }
  const auto add_each = [&](const char* name, const Counters& counters) {
    for (const auto& [detail, counter] : counters) {
      all.push_back({.name = name, .detail = detail, .value = whole(counter->Value())});
    }
  };
  add_each(dds::scans_dropped_counter, dropped_);
  add_each(dds::bad_clouds_counter, bad_clouds_);
  add_each("sweeps_without", sweeps_without_);
  for (const auto& [event, counter] : events_) add(event, counter->Value());
  return all;
}

void Statistics::report_to(dds::ServerStatus& status) const {
  const std::scoped_lock lock(mutex_);
  const auto now = RateWindow::Clock::now();
  status.received_hz = received_rate_.rate_hz(now);
  status.mapped_hz = mapped_rate_.rate_hz(now);
  status.scan_frame = scan_frame_;
  status.scan_delay_s = scan_delay_s_;
  status.counters = counters();
  status.segmentation = segmentation_;
  status.segmentation.fresh_share = label_provenances_.share(LabelProvenance::fresh);
  status.segmentation.propagated_share = label_provenances_.share(LabelProvenance::propagated);
  status.segmentation.unlabelled_share = label_provenances_.share(LabelProvenance::none);
  status.latencies.clear();
  for (const Stage& stage : stages_) status.latencies.push_back(stage.recent.summary(stage.name));
}

std::uint64_t Statistics::received() const { return whole(metrics_->scans_received.Value()); }

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

std::string Statistics::last_save_failure() const {
  const std::scoped_lock lock(mutex_);
  return last_save_failure_;
}

std::string Statistics::map_displaced() const {
  const std::scoped_lock lock(mutex_);
  return map_displaced_;
}

std::string Statistics::maps_left() const {
  const std::scoped_lock lock(mutex_);
  return maps_left_;
}

std::string Statistics::last_segmentation_failure() const {
  const std::scoped_lock lock(mutex_);
  return last_segmentation_failure_;
}

}  // namespace stillmap::server
