#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/loaders/config_error.hpp"
#include "config/loaders/config_report.hpp"
#include "config/loaders/dds_profile.hpp"
#include "core/lidar/delivery_mode.hpp"
#include "core/lidar/label_kind.hpp"
#include "core/lidar/point_fields.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/lidar/turn_joiner.hpp"
#include "core/mapper.hpp"
#include "core/occupancy/occupancy_config.hpp"
#include "core/segmentation/open_network.hpp"
#include "core/traversability/robot_profile.hpp"

namespace stillmap {

/// Where the class of a point comes from.
enum class LabelProvider {
  /// The label field of the incoming cloud where it holds a known class, else the network.
  automatic,
  /// The label field of the incoming cloud where it is there, else none.
  stream,
  /// A network, `LabelsConfig::model`.
  model,
  /// Pure geometry.
  none,
};

struct LabelsConfig {
  LabelProvider source = LabelProvider::automatic;
  /// Name of a model that comes with Stillmap, or folder of one; see find_model().
  std::filesystem::path model = "street";
  /// Columns of the range image that the network gets; 0: as the model says.
  int image_columns = 0;
  /// What runs the network.
  EngineOptions engine;
  /// Longest wait of a scan for the network's labels; then it is mapped with labels
  /// propagated from the map and earlier scans. 0: no limit, as with input delivery `every`.
  std::uint32_t budget_ms = 90;
  /// Where the mount tells neither a lean nor a height, they are those that the ground shows, scan
  /// by scan. False: as the mount says, whatever the ground shows.
  bool finds_stance = true;
  /// Networks see each scan in a mirror, too, which takes twice the time.
  bool mirrored = false;
};

/// Names of the coordinate frames in everything that is published (REP 105).
struct FramesConfig {
  std::string map = "map";
  /// Between map and base: poses in it never jump. Empty: no such frame.
  std::string odom;
  enum class OdomSource {
    /// The server's own odometry, made smooth.
    own,
    /// The odometry prior, whose publisher also publishes odom -> base.
    prior,
  };
  OdomSource odom_source = OdomSource::own;
  /// The robot, whose poses are published. Empty: the lidar is the base.
  std::string base;
  /// Empty: the frame that the incoming clouds name.
  std::string lidar = "lidar";
};

/// Where the lidar sits on the robot, T_base_lidar.
struct MountConfig {
  enum class Source {
    /// `T_base_lidar` below.
    configuration,
    /// What the robot publishes on /tf_static.
    tf_static,
  };
  Source source = Source::configuration;
  Eigen::Isometry3d T_base_lidar = Eigen::Isometry3d::Identity();
  /// Longest wait for the transform on /tf_static.
  double wait_s = 10.0;
  /// After that: map as if the lidar were the base; else scans are dropped until it comes.
  bool identity_if_missing = false;
};

/// One lidar of several on a robot.
struct LidarConfig {
  /// In counters and messages.
  std::string name;
  SensorModel sensor;
  /// ROS 2 name, without the prefix that DDS sees.
  std::string topic;
  /// header.frame_id of its clouds, where several lidars share a topic; empty: any.
  std::string frame;
  /// Of its clouds; what its entry leaves out is as in InputConfig.
  PointFieldNames fields{};
  Eigen::Isometry3d T_base_lidar = Eigen::Isometry3d::Identity();
};

struct DdsConfig {
  /// 0..232, as DDS defines it; ROS_DOMAIN_ID of the ROS 2 peers.
  std::uint32_t domain_id = 0;
  /// Transports, discovery and pacing, for the kind of network; what is set on top of it.
  DdsNetworkConfig network;
  std::string participant_name = "stillmap_server";
  /// Folder of the server's identity in a secured domain; empty: no security.
  std::filesystem::path security;
};

/// ROS 2 topic names, without the prefixes that DDS sees.
struct TopicsConfig {
  std::string points = "points";
  /// Put before the name of everything that the server offers: stillmap/odometry.
  std::string name_space = "stillmap";
  /// A nav_msgs/Odometry whose motion predicts the next pose; empty: constant velocity.
  std::string odometry_prior = "odom_prior";
  /// A sensor_msgs/Imu fixed to the lidar; empty: none.
  std::string imu = "imu/data";
  /// A sensor_msgs/NavSatFix of a receiver on the robot; empty: none.
  std::string gnss;
  /// A geometry_msgs/PoseWithCovarianceStamped that says where the robot is; empty: none.
  std::string initial_pose = "initialpose";
};

/// The receiver of topics.gnss.
struct GnssReceiverConfig {
  /// Its antenna in the base frame, or by the lidar without one [m]; nothing: somewhere on the
  /// robot.
  std::optional<Eigen::Vector3d> antenna_base;
  /// Fixes that are said to be worse than this, east and north, are not used [m].
  double max_sigma_m = 20.0;
  /// So much later than the robot was there are its stamps [s]; nothing: that is found out.
  std::optional<double> time_offset_s;
};

struct InputConfig {
  DeliveryMode delivery = DeliveryMode::latest;
  /// Scans that may wait for the mapper.
  std::uint32_t queue_length = 3;
  /// Of several lidars: longest wait of a sweep for the scan of one.
  double sweep_wait_s = 0.1;
  PointFieldNames fields;
  LabelKind label_kind = LabelKind::semantic_kitti;
  /// So many clouds that follow each other are a turn of the lidar, and one scan;
  /// TurnJoiner::automatic: they tell.
  std::uint32_t clouds_per_turn = TurnJoiner::automatic;
};

struct PublishConfig {
  double path_period_s = 1.0;
  /// A longer path is published with every 2nd, 4th, ... pose.
  std::size_t path_poses = 5000;
  double cloud_period_s = 1.0;
  /// Edge of the square round the robot that static_cloud shows.
  double cloud_window_m = 60.0;
  double tiles_period_s = 0.5;
  /// Edge of the square round the robot whose tiles late joiners get from the topics.
  double tile_window_m = 300.0;
  double status_period_s = 1.0;
  /// Publish every labelled scan (stillmap/scan).
  bool scan = true;
};

struct MapFileConfig {
  /// Empty: the map is not saved.
  std::filesystem::path file;
  /// Between checkpoints; a server that is killed loses up to this and the time of a save.
  double save_period_s = 5.0;
  /// Of the static map, its copies for readers and for queries. What is far away is on disk. 0: all
  /// of the map stays in memory.
  std::uint32_t memory_limit_mib = 2048;
  /// Written an hour while the robot stands and its map hardly changes; 0: no limit.
  std::uint32_t standing_mib_per_hour = 3;
  /// Resume the map in `file` when it exists; else start empty.
  bool load_at_start = true;
  /// So many of the newest runs that went on in the file's map can be withdrawn from it; 0: none,
  /// and they are not listed.
  std::uint32_t withdrawable_sessions = 2;
  /// Correct map and path where the robot comes back to a place of a map that this run began.
  bool close_loops = true;
  /// How many maps, and how many MiB of them, clients may have saved or kept beside `file`.
  std::uint32_t saved_maps = 100;
  std::uint32_t saved_maps_mib = 51200;
  /// Where the map's origin lies, as datum_from_text() reads it; goes into the map file. Empty: not
  /// known.
  std::string datum;
};

/// The octree of occupied, free and unknown space beside the static map.
struct OccupancyServiceConfig {
  bool enabled = true;
  OccupancyConfig map;
  /// Scans that may wait for it; more are dropped.
  std::uint32_t queue_length = 16;
  /// Shortest time between two octrees on stillmap/octomap.
  double publish_period_s = 5.0;
};

/// Where robots can go, updated with the map.
struct TraversabilityConfig {
  /// Robots by name or file, as load_robot_profile takes them; empty: no traversability.
  std::vector<std::string> profiles = {"car", "delivery_robot"};
  /// Shortest time from update to update; nothing is done while the map stays as it is.
  double update_period_s = 1.0;
  /// The robot whose traversability is published as a grid; empty: none.
  std::string grid_profile = "car";
  /// Edge of the square round the robot that the grid shows; 0: the map within 500 m of it.
  double grid_window_m = 0.0;
};

enum class LogLevel { debug, info, warning, error };

/// What goes to stderr.
struct LogConfig {
  LogLevel level = LogLevel::info;
};

/// Figures for Prometheus over HTTP.
struct MetricsConfig {
  /// Where it listens, as address:port; port 0 takes a free one. Empty: nowhere.
  std::string address;
};

/// The robots that traversability is kept for. Throws ConfigError with every fault: robots that do
/// not exist (with those that do), or two of one name.
[[nodiscard]] std::vector<RobotProfile> load_robots(const TraversabilityConfig& config);

/// A lidar that the configuration does not name is told by its scans.
struct AutomaticSensor {
  bool is_on = true;
  /// Whether `prepare` leaves it to the lidar which points are too near or too far.
  bool sets_min_range = true;
  bool sets_max_range = true;
};

/// Everything that stillmap-server can be told. Works as it is, with any one lidar and no file.
struct ServerConfig {
  /// Until its scans have told the lidar, where that is not named, it is taken for a HDL-64E.
  MapperConfig mapper{.sensor = hdl_64e(), .prepare = {}, .odometry = {}, .static_map = {}};
  AutomaticSensor automatic_sensor;
  LabelsConfig labels;
  FramesConfig frames;
  MountConfig mount;
  /// Empty: one lidar, `mapper.sensor` on `topics.points`. Else `mapper.sensor`, `frames.lidar` and
  /// `mount` are those of the merged scans.
  std::vector<LidarConfig> lidars;
  DdsConfig dds;
  TopicsConfig topics;
  GnssReceiverConfig gnss;
  InputConfig input;
  PublishConfig publish;
  MapFileConfig map;
  OccupancyServiceConfig occupancy;
  TraversabilityConfig traversability;
  LogConfig log;
  MetricsConfig metrics;
};

/// A range of `prepare` that leaves no point of a lidar.
struct RangeFault {
  /// "min_range_m", and what is wrong with it.
  std::string field;
  std::string text;
};

/// The ranges that the file says, and the lidar's where it says none, may leave nothing between
/// them.
[[nodiscard]] std::optional<RangeFault> range_fault(const SensorModel& sensor,
                                                    const AutomaticSensor& automatic,
                                                    const PrepareConfig& prepare);

/// Has the mapper work for a lidar that its scans have told. Where range_fault() finds one, both
/// ranges are the lidar's.
void use_sensor(const SensorModel& sensor, const AutomaticSensor& automatic, MapperConfig& mapper);

/// Reads a server file (config/server/default.yaml shows every field). What the file leaves out
/// keeps its default; relative paths start at the file's folder. Throws ConfigError with every
/// fault at once; a name that is not known is a fault, and so is a range_fault().
[[nodiscard]] ServerConfig load_server_config(const std::filesystem::path& file);
/// The same, and tells which fields the file leaves out and which it changes.
[[nodiscard]] ServerConfig load_server_config(const std::filesystem::path& file,
                                              ConfigReport& report);

}  // namespace stillmap
