#include "clients/library/scan_publisher.hpp"

#include <cassert>
#include <optional>

#include "clients/library/connection.hpp"
#include "clients/library/tcp_rejoin_backoff.hpp"
#include "idl/conversions/gnss.hpp"
#include "idl/conversions/imu.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/conversions/to_cloud.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap {

struct ScanPublisher::Connection {
  explicit Connection(const ScanPublisherOptions& publisher_options)
      : options(publisher_options),
        own(std::make_unique<dds::Participant>(options.dds)),
        topic(topic_of(options)),
        writer(*own, topic.dds_name, topic.writer) {
    publish_mount(*own);
    open_imu(*own);
    open_gnss(*own);
  }

  Connection(dds::Participant& shared, const ScanPublisherOptions& publisher_options)
      : options(publisher_options),
        topic(topic_of(options)),
        writer(shared, topic.dds_name, topic.writer) {
    publish_mount(shared);
    open_imu(shared);
    open_gnss(shared);
  }

  void publish_mount(dds::Participant& participant) {
    if (!options.mount) return;
    const auto tf_static = dds::Topics::in("stillmap").tf_static;
    mount_writer.emplace(participant, tf_static.dds_name, tf_static.writer);
    // A keep-last writer always has room, and keeps it for subscribers that come later.
    static_cast<void>(mount_writer->write(wire::to_tf(0, {*options.mount})));
  }

  static dds::TopicSpec<sensor_msgs::msg::PointCloud2> topic_of(
      const ScanPublisherOptions& options) {
    return dds::points_topic(options.points_topic,
                             options.lossless ? DeliveryMode::every : DeliveryMode::latest,
                             options.max_scans_in_flight);
  }

  void open_imu(dds::Participant& participant) {
    if (options.imu_topic.empty()) return;
    const auto imu = dds::imu_topic(options.imu_topic,
                                    options.lossless ? DeliveryMode::every : DeliveryMode::latest);
    imu_writer.emplace(participant, imu.dds_name, imu.writer);
  }

  void open_gnss(dds::Participant& participant) {
    if (options.gnss_topic.empty()) return;
    const auto gnss = dds::gnss_topic(
        options.gnss_topic, options.lossless ? DeliveryMode::every : DeliveryMode::latest);
    gnss_writer.emplace(participant, gnss.dds_name, gnss.writer);
  }

  ScanPublisherOptions options;
  bool has_written = false;
  std::unique_ptr<dds::Participant> own;
  dds::TopicSpec<sensor_msgs::msg::PointCloud2> topic;
  dds::Writer<sensor_msgs::msg::PointCloud2> writer;
  std::optional<dds::Writer<tf2_msgs::msg::TFMessage>> mount_writer;
  std::optional<dds::Writer<sensor_msgs::msg::Imu>> imu_writer;
  std::optional<dds::Writer<sensor_msgs::msg::NavSatFix>> gnss_writer;
};

ScanPublisher::ScanPublisher(const ScanPublisherOptions& options)
    : connection_(std::make_unique<Connection>(options)) {}

ScanPublisher::ScanPublisher(Client& client, const ScanPublisherOptions& options) {
  Client::Connection& shared = *client.connection_;
  const bool shares = shared.options.dds.transport == dds::NetworkTransport::tcp;
  connection_ = shares ? std::make_unique<Connection>(shared.participant, options)
                       : std::make_unique<Connection>(options);
}

ScanPublisher::~ScanPublisher() = default;
ScanPublisher::ScanPublisher(ScanPublisher&&) noexcept = default;
ScanPublisher& ScanPublisher::operator=(ScanPublisher&&) noexcept = default;

bool ScanPublisher::wait_for_subscriber(std::chrono::milliseconds timeout) {
  TcpRejoinBackoff backoff(connection_->options.dds, timeout);
  while (!connection_->writer.readers().wait_for_any(backoff.next_wait())) {
    if (backoff.timed_out()) return false;
    // A client's connection has been found to work, and what was written must not be lost.
    const bool may_rejoin = connection_->own && !connection_->has_written;
    if (backoff.rejoin_due() && may_rejoin) {
      connection_ = std::make_unique<Connection>(connection_->options);
    }
  }
  return true;
}

bool ScanPublisher::wait_for_imu_subscriber(std::chrono::milliseconds timeout) {
  return connection_->imu_writer && connection_->imu_writer->readers().wait_for_any(timeout);
}

int ScanPublisher::subscribers() const { return connection_->writer.readers().count(); }

bool ScanPublisher::publish(const Scan& scan, std::span<const std::uint32_t> raw_labels,
                            std::chrono::milliseconds timeout) {
  const auto cloud = wire::to_cloud(scan, raw_labels, connection_->options.lidar_frame);
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  connection_->has_written = true;
  // A write waits only a moment for room, so that the caller's timeout is kept.
  while (!connection_->writer.write(cloud)) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
  }
  return true;
}

std::size_t ScanPublisher::publish(std::span<const ImuSample> samples,
                                   std::chrono::milliseconds timeout) {
  assert(connection_->imu_writer);
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  connection_->has_written = true;
  std::size_t written = 0;
  while (written < samples.size()) {
    const auto message = wire::to_imu(samples[written], connection_->options.imu_frame);
    if (connection_->imu_writer->write(message)) {
      ++written;
    } else if (std::chrono::steady_clock::now() >= deadline) {
      break;
    }
  }
  return written;
}

std::size_t ScanPublisher::publish(std::span<const GnssFix> fixes,
                                   std::chrono::milliseconds timeout) {
  assert(connection_->gnss_writer);
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  connection_->has_written = true;
  std::size_t written = 0;
  while (written < fixes.size()) {
    if (connection_->gnss_writer->write(wire::to_nav_sat_fix(fixes[written], "gnss"))) {
      ++written;
    } else if (std::chrono::steady_clock::now() >= deadline) {
      break;
    }
  }
  return written;
}

bool ScanPublisher::wait_for_all_acknowledged(std::chrono::milliseconds timeout) {
  return connection_->writer.wait_for_acknowledgements(timeout);
}

}  // namespace stillmap
