#include <optional>
#include <thread>
#include <utility>

#include "clients/library/connection.hpp"
#include "core/occupancy/octomap_data.hpp"
#include "idl/conversions/cloud_reader.hpp"
#include "idl/conversions/occupancy_grid.hpp"
#include "idl/conversions/octomap.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/conversions/status.hpp"
#include "idl/conversions/tile.hpp"
#include "sensor_msgs.h"

namespace stillmap {
namespace {

/// A reader and the thread that hands its samples to the callback.
template <typename T>
class ReceiverThread final : public Subscription::Receiver {
 public:
  ReceiverThread(dds::Participant& participant, const dds::TopicSpec<T>& topic,
                 std::function<void(const T&)> sample_arrived)
      : sample_arrived_(std::move(sample_arrived)),
        reader_(participant, topic.dds_name, topic.reader),
        thread_([this](const std::stop_token& stop) { receive(stop); }) {}

 private:
  void receive(const std::stop_token& stop) {
    T sample;
    while (!stop.stop_requested()) {
      if (reader_.take(sample, stop, std::chrono::seconds(1))) sample_arrived_(sample);
    }
  }

  std::function<void(const T&)> sample_arrived_;
  dds::Reader<T> reader_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

template <typename T>
Subscription subscribe(dds::Participant& participant, const dds::TopicSpec<T>& topic,
                       std::function<void(const T&)> sample_arrived) {
  return Subscription(
      std::make_unique<ReceiverThread<T>>(participant, topic, std::move(sample_arrived)));
}

}  // namespace

Subscription Client::subscribe_points(const std::string& ros_topic, dds::DeliveryMode delivery,
                                      const wire::CloudReadOptions& reading,
                                      std::function<void(const Scan&)> scan_arrived) {
  constexpr int queue_length = 10;
  return subscribe<sensor_msgs::msg::PointCloud2>(
      connection_->participant, dds::points_topic(ros_topic, delivery, queue_length),
      [reader = wire::CloudReader(reading),
       arrived = std::move(scan_arrived)](const sensor_msgs::msg::PointCloud2& message) mutable {
        const auto read = reader.read(message);
        if (read.from_cloud.scan) arrived(*read.from_cloud.scan);
      });
}

Subscription Client::subscribe_labelled_scans(std::function<void(const Scan&)> scan_arrived) {
  dds::TopicSpec<sensor_msgs::msg::PointCloud2> topic = connection_->topics.scan;
  topic.reader.depth = 10;
  return subscribe<sensor_msgs::msg::PointCloud2>(
      connection_->participant, topic,
      [arrived = std::move(scan_arrived)](const sensor_msgs::msg::PointCloud2& message) {
        const auto read = wire::to_scan(message, {.fields = {}, .labels_are_classes = true});
        if (read.scan) arrived(*read.scan);
      });
}

Subscription Client::subscribe_odometry(std::function<void(const OdometryUpdate&)> pose_arrived) {
  return subscribe<nav_msgs::msg::Odometry>(
      connection_->participant, connection_->topics.odometry,
      [arrived = std::move(pose_arrived)](const nav_msgs::msg::Odometry& message) {
        const auto odometry = wire::from_odometry(message);
        if (odometry) arrived({.pose = odometry->pose, .covariance = odometry->covariance});
      });
}

Subscription Client::subscribe_status(
    std::function<void(const dds::ServerStatus&)> status_arrived) {
  return subscribe<stillmap_msgs::msg::Status>(
      connection_->participant, connection_->topics.status,
      [arrived = std::move(status_arrived)](const stillmap_msgs::msg::Status& message) {
        const auto status = wire::from_wire(message);
        if (status) arrived(*status);
      });
}

Subscription Client::subscribe_octomap(std::function<void(const OctomapData&)> octomap_arrived) {
  return subscribe<octomap_msgs::msg::Octomap>(
      connection_->participant, connection_->topics.octomap,
      [arrived = std::move(octomap_arrived)](const octomap_msgs::msg::Octomap& message) {
        const auto data = wire::from_octomap(message);
        if (data && check_octomap(*data).fault.empty()) arrived(*data);
      });
}

Subscription Client::subscribe_path(std::function<void(const Trajectory&)> path_arrived) {
  return subscribe<nav_msgs::msg::Path>(
      connection_->participant, connection_->topics.path,
      [arrived = std::move(path_arrived)](const nav_msgs::msg::Path& message) {
        arrived(wire::from_path(message));
      });
}

Subscription Client::subscribe_planning_grid(
    std::function<void(const OccupancyGrid&)> grid_arrived) {
  return subscribe<nav_msgs::msg::OccupancyGrid>(
      connection_->participant, connection_->topics.traversability,
      [arrived = std::move(grid_arrived)](const nav_msgs::msg::OccupancyGrid& message) {
        const auto grid = wire::from_message(message);
        if (grid) arrived(*grid);
      });
}

Subscription Client::subscribe_tiles(
    std::function<void(const dds::MapIdentity&, const Tile&)> tile_arrived) {
  return subscribe<stillmap_msgs::msg::MapTile>(
      connection_->participant, connection_->topics.tiles,
      [arrived = std::move(tile_arrived)](const stillmap_msgs::msg::MapTile& message) {
        const auto tile = wire::from_wire(message);
        if (tile) arrived(wire::from_wire(message.identity()), *tile);
      });
}

Subscription Client::subscribe_tile_index(
    std::function<void(const dds::MapIdentity&, const TileInfo&)> info_arrived) {
  return subscribe<stillmap_msgs::msg::TileInfo>(
      connection_->participant, connection_->topics.tile_index,
      [arrived = std::move(info_arrived)](const stillmap_msgs::msg::TileInfo& message) {
        const auto info = wire::from_wire(message);
        if (info) arrived(wire::from_wire(message.identity()), *info);
      });
}

}  // namespace stillmap
