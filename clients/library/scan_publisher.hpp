#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "core/frames/frame_tree.hpp"
#include "core/geodesy/gnss_fix.hpp"
#include "core/inertial/imu_sample.hpp"
#include "core/lidar/scan.hpp"
#include "idl/dds/dds_options.hpp"

namespace stillmap {

class Client;

struct ScanPublisherOptions {
  dds::DdsOptions dds;
  /// ROS 2 name of the topic, without "rt/".
  std::string points_topic = "points";
  /// ROS 2 name of the IMU's topic; empty: no samples are published.
  std::string imu_topic{};
  /// The same of a GNSS receiver's fixes.
  std::string gnss_topic{};
  /// header.frame_id of the clouds.
  std::string lidar_frame = "lidar";
  /// Published on /tf_static, as a robot does: where the lidar sits.
  std::optional<FrameTransform> mount = std::nullopt;
  /// header.frame_id of the IMU's samples.
  std::string imu_frame = "imu";
  /// Keep every scan until the server took it (needs a server with `delivery: every`); otherwise a
  /// newer scan may overtake an untaken one.
  bool lossless = false;
  /// Scans that may be under way in lossless mode before publish() waits.
  int max_scans_in_flight = 4;
};

/// Publishes scans as sensor_msgs/PointCloud2, as a lidar driver does, samples of the IMU beside it
/// as sensor_msgs/Imu, and fixes of a receiver as sensor_msgs/NavSatFix. One thread uses it.
class ScanPublisher {
 public:
  /// Joins the domain. Throws DdsError when the domain or an interface cannot be used.
  explicit ScanPublisher(const ScanPublisherOptions& options = {});

  /// The same; where the client is one over TCP, it shares the client's connection (`options.dds`
  /// is not used then), and the client must outlive it.
  ScanPublisher(Client& client, const ScanPublisherOptions& options);

  ~ScanPublisher();
  ScanPublisher(ScanPublisher&&) noexcept;
  ScanPublisher& operator=(ScanPublisher&&) noexcept;

  /// True once a subscriber matched; false after `timeout`. Over TCP, with a connection of its own
  /// and before the first scan, it joins the domain anew without a subscriber after 4, 12, 28 s,
  /// and then throws as the constructor does.
  [[nodiscard]] bool wait_for_subscriber(std::chrono::milliseconds timeout);

  /// True once a subscriber of the IMU's samples matched; false after `timeout`, or where the
  /// options name no topic for them.
  [[nodiscard]] bool wait_for_imu_subscriber(std::chrono::milliseconds timeout);

  /// Subscribers matched now.
  [[nodiscard]] int subscribers() const;

  /// Writes one scan; fields x y z intensity, and time, ring, label where the scan has them.
  /// `raw_labels` (original SemanticKITTI ids, as in a .label file) goes out as field `label`
  /// instead of the scan's reduced classes; empty or as long as the scan.
  /// Lossless: waits until there is room. Returns false when the server took nothing for `timeout`:
  /// nothing was written, and the caller may ask again.
  [[nodiscard]] bool publish(const Scan& scan, std::span<const std::uint32_t> raw_labels = {},
                             std::chrono::milliseconds timeout = std::chrono::seconds(10));

  /// Writes samples of the IMU; the options must name its topic. Lossless: waits as for a scan, and
  /// returns how many were written before the timeout.
  [[nodiscard]] std::size_t publish(std::span<const ImuSample> samples,
                                    std::chrono::milliseconds timeout = std::chrono::seconds(10));

  /// The same with fixes of a receiver.
  [[nodiscard]] std::size_t publish(std::span<const GnssFix> fixes,
                                    std::chrono::milliseconds timeout = std::chrono::seconds(10));

  /// True once every subscriber acknowledged every scan written; false after `timeout`.
  [[nodiscard]] bool wait_for_all_acknowledged(std::chrono::milliseconds timeout);

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

}  // namespace stillmap
