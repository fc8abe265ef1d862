#include "clients/scan_publisher.hpp"

#include "idl/conversions/scan_to_cloud.hpp"
#include "idl/dds/writer.hpp"
#include "idl/topics.hpp"

namespace stillmap {

struct ScanPublisher::Connection {
  explicit Connection(const ScanPublisherOptions& publisher_options)
      : options(publisher_options),
        participant(options.dds),
        topic(points_topic(options.points_topic,
                           options.lossless ? DeliveryMode::every : DeliveryMode::latest,
                           options.scans_under_way)),
        writer(participant, topic.dds_name, topic.writer) {}

  ScanPublisherOptions options;
  Participant participant;
  TopicSpec<sensor_msgs::msg::PointCloud2> topic;
  Writer<sensor_msgs::msg::PointCloud2> writer;
};

ScanPublisher::ScanPublisher(const ScanPublisherOptions& options)
    : connection_(std::make_unique<Connection>(options)) {}
ScanPublisher::~ScanPublisher() = default;
ScanPublisher::ScanPublisher(ScanPublisher&&) noexcept = default;
ScanPublisher& ScanPublisher::operator=(ScanPublisher&&) noexcept = default;

bool ScanPublisher::wait_for_subscriber(std::chrono::milliseconds timeout) {
  const ScanPublisherOptions options = connection_->options;
  if (options.dds.transport == NetworkTransport::tcp) {
    // With Fast DDS 2.9, one of twenty processes never finds the other over TCP; a new one does.
    constexpr std::chrono::milliseconds first_try{4000};
    for (auto patience = first_try; 2 * patience <= timeout; timeout -= patience, patience *= 2) {
      if (connection_->writer.readers().wait_for_any(patience)) return true;
      connection_.reset();
      connection_ = std::make_unique<Connection>(options);
    }
  }
  return connection_->writer.readers().wait_for_any(timeout);
}

int ScanPublisher::subscribers() const { return connection_->writer.readers().count(); }

bool ScanPublisher::publish(const Scan& scan, std::span<const std::uint32_t> raw_labels,
                            std::chrono::milliseconds timeout) {
  const auto cloud = wire::to_cloud(scan, raw_labels, connection_->options.lidar_frame);
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  // A write waits only a moment for room, so that the caller's timeout is kept.
  while (!connection_->writer.write(cloud)) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
  }
  return true;
}

bool ScanPublisher::wait_for_all_acknowledged(std::chrono::milliseconds timeout) {
  return connection_->writer.wait_for_acknowledgements(timeout);
}

}  // namespace stillmap
