#include "clients/commands/mapping/scans_ahead.hpp"

#include <exception>
#include <utility>

namespace stillmap::cli {

/// The mapper's view: it prepares the scan that was read last as it was prepared ahead.
class ScansAhead::LabelsOfLastRead final : public Segmenter {
 public:
  explicit LabelsOfLastRead(ScansAhead& scans) : scans_(scans) {}

  [[nodiscard]] std::string name() const override { return scans_.segmenter_->name(); }
  [[nodiscard]] std::string details() const override { return scans_.segmenter_->details(); }
  [[nodiscard]] int image_columns() const override { return scans_.segmenter_->image_columns(); }
  [[nodiscard]] PointLabels segment(const Scan& scan) override {
    if (!scans_.labels_of_last_read_.valid()) return scans_.segmenter_->segment(scan);
    return scans_.labels_of_last_read_.get();
  }

 private:
  ScansAhead& scans_;
};

ScansAhead::ScansAhead(const ScanDataset& dataset, const MapperConfig& config,
                       std::unique_ptr<Segmenter> segmenter)
    : dataset_(dataset),
      prepare_(config.prepare),
      elevation_offset_(config.sensor.elevation_offset),
      segmenter_(std::move(segmenter)) {}

ScansAhead::~ScansAhead() = default;

std::unique_ptr<Segmenter> ScansAhead::segmenter() {
  return std::make_unique<LabelsOfLastRead>(*this);
}

void ScansAhead::start(std::size_t first, std::size_t end) {
  next_read_ = next_scheduled_ = first;
  end_ = end;
  const std::size_t concurrent = segmenter_->concurrent_scans();
  if (concurrent < 2) return;
  segmenter_->set_parallelism(Parallelism::across_scans);
  for (std::size_t i = 0; i < concurrent; ++i)
    threads_.emplace_back([this](const std::stop_token& stop) { work(stop); });
}

DatasetFrame ScansAhead::read() {
  labels_of_last_read_ = {};
  if (threads_.empty()) return dataset_.read(next_read_++);
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !ahead_.empty(); });
  Scheduled next = std::move(ahead_.front());
  ahead_.pop_front();
  ++next_read_;
  lock.unlock();
  changed_.notify_all();
  DatasetFrame read = next.frame.get();
  labels_of_last_read_ = std::move(next.labels);
  return read;
}

void ScansAhead::work(const std::stop_token& stop) {
  // One scan more than there are threads: the mapper takes one while each thread has another.
  const std::size_t max_ahead = segmenter_->concurrent_scans() + 1;
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [&] {
    return next_scheduled_ == end_ || next_scheduled_ < next_read_ + max_ahead;
  })) {
    if (next_scheduled_ == end_) return;
    const std::size_t index = next_scheduled_++;
    std::promise<DatasetFrame> frame;
    std::promise<PointLabels> labels;
    ahead_.push_back({frame.get_future(), labels.get_future()});
    lock.unlock();
    changed_.notify_all();
    make(index, frame, labels);
    lock.lock();
  }
}

void ScansAhead::make(std::size_t index, std::promise<DatasetFrame>& frame,
                      std::promise<PointLabels>& labels) {
  Scan prepared;
  try {
    DatasetFrame made = read_scan(index);
    prepared = drop_unusable_points(made.scan, prepare_);
    turn_up(prepared, elevation_offset_);
    frame.set_value(std::move(made));
  } catch (...) {
    return frame.set_exception(std::current_exception());
  }
  try {
    labels.set_value(segmenter_->segment(prepared));
  } catch (...) {
    labels.set_exception(std::current_exception());
  }
}

DatasetFrame ScansAhead::read_scan(std::size_t index) {
  const std::scoped_lock lock(reading_);
  return dataset_.read(index);
}

}  // namespace stillmap::cli
