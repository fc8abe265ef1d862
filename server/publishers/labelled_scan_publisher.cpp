#include "server/publishers/labelled_scan_publisher.hpp"

#include <utility>

#include "idl/conversions/to_cloud.hpp"

namespace stillmap::server {

LabelledScanPublisher::LabelledScanPublisher(dds::Participant& participant,
                                             const dds::Topics& topics)
    : writer_(participant, topics.scan.dds_name, topics.scan.writer),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

void LabelledScanPublisher::publish(std::shared_ptr<const LabelledScan> labelled,
                                    const std::string& lidar_frame) {
  // Nobody listens: not worth a message of megabytes.
  if (writer_.readers().count() == 0) return;
  const std::scoped_lock lock(mutex_);
  newest_ = Job{std::move(labelled), lidar_frame};
  changed_.notify_one();
}

void LabelledScanPublisher::work(const std::stop_token& stop) {
  while (true) {
    Job job;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [this] { return newest_.has_value(); })) return;
      job = *std::exchange(newest_, std::nullopt);
    }
    // Best effort, newest only: there is always room.
    static_cast<void>(writer_.write(wire::to_cloud(*job.labelled, job.lidar_frame)));
  }
}

}  // namespace stillmap::server
