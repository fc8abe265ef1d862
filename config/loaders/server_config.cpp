#include "config/loaders/server_config.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>
#include <stdexcept>

#include "config/loaders/listening_address.hpp"
#include "config/loaders/mapper_section.hpp"
#include "config/loaders/named_file.hpp"
#include "config/loaders/sensor_file.hpp"
#include "config/loaders/topic_name.hpp"
#include "config/loaders/traversability_section.hpp"
#include "config/loaders/yaml_section.hpp"
#include "core/frames/rigid_motion.hpp"
#include "core/geodesy/datum.hpp"
#include "core/lidar/angle_units.hpp"
#include "core/lidar/sweep_merger.hpp"
#include "core/segmentation/model_description.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr Range periods_s{0.01, 86400};

constexpr const char* told_by_scans = "auto";

void read_sensor(const std::string& name, YamlSection& file, const fs::path& folder,
                 SensorModel& sensor) {
  try {
    sensor = load_sensor(name, folder);
  } catch (const ConfigError& error) {
    for (const std::string& fault : error.faults()) file.fault("sensor", fault);
  }
}

// A bare name stays one; a path starts at the file's folder.
void read_model_name(YamlSection& section, fs::path& model) {
  std::string name = model.string();
  section.text("model", name);
  if (name.empty()) section.fault("model", "is empty; give a model's name or folder");
  if (name == model) return;
  model = name;
  if (model.has_parent_path()) section.path("model", model);
}

void read_labels(YamlSection section, LabelsConfig& labels) {
  section.choice<LabelProvider>("source", labels.source,
                                {{"auto", LabelProvider::automatic},
                                 {"stream", LabelProvider::stream},
                                 {"model", LabelProvider::model},
                                 {"none", LabelProvider::none}});
  read_model_name(section, labels.model);
  section.integer("image_columns", labels.image_columns, {0, max_image_columns});
  if (labels.image_columns > 0 && labels.image_columns < min_image_columns) {
    section.fault("image_columns", "is " + std::to_string(labels.image_columns) +
                                       ", but must be 0 (as the model says) or " +
                                       std::to_string(min_image_columns) + ".." +
                                       std::to_string(max_image_columns));
  }
  using Engine = EngineOptions::Engine;
  section.choice<Engine>(
      "engine", labels.engine.engine,
      {{"auto", Engine::automatic}, {"onednn", Engine::onednn}, {"opencv", Engine::opencv}});
  using PrecisionMode = EngineOptions::PrecisionMode;
  section.choice<PrecisionMode>("precision", labels.engine.precision,
                                {{"auto", PrecisionMode::automatic},
                                 {"fp32", PrecisionMode::fp32},
                                 {"int8", PrecisionMode::int8}});
  section.integer("threads", labels.engine.threads, {0, 1024});
  section.integer("budget_ms", labels.budget_ms, {0, 60'000});
  section.choice<bool>("stance", labels.finds_stance, {{"auto", true}, {"mount", false}});
  section.boolean("mirrored", labels.mirrored);
}

void check_frame(YamlSection& section, const std::string& field, const std::string& frame) {
  if (!frame.starts_with('/')) return;
  section.fault(
      field, "'" + frame + "' begins with '/', and tf2 looks up no such frame; leave the '/' away");
}

void read_frames(YamlSection section, FramesConfig& frames) {
  section.text("map", frames.map);
  section.text("odom", frames.odom);
  using OdomSource = FramesConfig::OdomSource;
  section.choice<OdomSource>("odom_source", frames.odom_source,
                             {{"own", OdomSource::own}, {"prior", OdomSource::prior}});
  section.text("base", frames.base);
  section.text("lidar", frames.lidar);
  check_frame(section, "map", frames.map);
  check_frame(section, "odom", frames.odom);
  check_frame(section, "base", frames.base);
  check_frame(section, "lidar", frames.lidar);
  if (frames.map.empty()) section.fault("map", "is empty; a frame needs a name");
  if (!frames.odom.empty() && frames.base.empty()) {
    section.fault("odom", "needs the robot's frame beneath it: set frames.base, as base_link");
  }
  if (frames.odom.empty() && frames.odom_source == OdomSource::prior) {
    section.fault("odom_source", "needs the frame that the odometry is in: set frames.odom");
  }
  const std::vector<std::string> names{frames.map, frames.odom, frames.base, frames.lidar};
  for (auto name = names.begin(); name != names.end(); ++name) {
    if (name->empty() || std::find(names.begin(), name, *name) == name) continue;
    section.fault("map", "'" + *name + "' is the name of two frames");
  }
}

/// Three numbers in a list, which stay as they are where the file leaves them out.
Eigen::Vector3d read_triple(YamlSection& section, const std::string& name,
                            const Eigen::Vector3d& unchanged, Range allowed) {
  std::vector<double> values(unchanged.begin(), unchanged.end());
  section.number_list(name, values, allowed);
  if (values.size() == 3) return Eigen::Map<const Eigen::Vector3d>(values.data());
  section.fault(name, "has " + std::to_string(values.size()) + " numbers; wanted are three");
  return unchanged;
}

Eigen::Isometry3d read_extrinsic(YamlSection& section) {
  const Eigen::Vector3d none(0.0, 0.0, 0.0);
  const Eigen::Vector3d xyz_m = read_triple(section, "xyz_m", none, {-100, 100});
  const Eigen::Vector3d rpy_deg = read_triple(section, "rpy_deg", none, {-360, 360});
  return from_xyz_rpy(xyz_m, rpy_deg * rad_per_deg);
}

void read_gnss(YamlSection section, GnssReceiverConfig& gnss) {
  std::vector<double> antenna_m;
  section.number_list("antenna_m", antenna_m, {-100, 100});
  if (antenna_m.size() == 3) {
    gnss.antenna_base = Eigen::Map<const Eigen::Vector3d>(antenna_m.data());
  } else if (!antenna_m.empty()) {
    section.fault("antenna_m", "has " + std::to_string(antenna_m.size()) +
                                   " numbers; wanted are three, or none");
  }
  section.number("max_sigma_m", gnss.max_sigma_m, {0.01, 1000});
  double time_offset_s = std::numeric_limits<double>::quiet_NaN();
  section.number_or("auto", "time_offset_s", time_offset_s, {-100, 100});
  if (!std::isnan(time_offset_s)) gnss.time_offset_s = time_offset_s;
}

void read_mount(YamlSection section, const FramesConfig& frames, MountConfig& mount) {
  using Source = MountConfig::Source;
  section.choice<Source>(
      "source", mount.source,
      {{"configuration", Source::configuration}, {"tf_static", Source::tf_static}});
  mount.T_base_lidar = read_extrinsic(section);
  section.number("wait_s", mount.wait_s, {0, 3600});
  section.choice<bool>("if_missing", mount.identity_if_missing,
                       {{"drop", false}, {"identity", true}});
  const bool is_mounted = !mount.T_base_lidar.isApprox(Eigen::Isometry3d::Identity());
  if (mount.source == Source::tf_static && is_mounted) {
    section.fault("xyz_m", "and rpy_deg are not used with source: tf_static; leave them out");
  }
  if (frames.base.empty() && (is_mounted || mount.source == Source::tf_static)) {
    section.fault("source", "needs the robot's frame: set frames.base, as base_link");
  }
}

void read_network(YamlSection& section, const fs::path& folder, DdsNetworkConfig& network) {
  section.text("profile", network.profile);
  if (is_file_name(network.profile)) network.profile = (folder / network.profile).string();
  section.choice<std::optional<bool>>(
      "shared_memory", network.shared_memory,
      {{"profile", std::nullopt}, {"true", true}, {"false", false}});
  section.text_list("interfaces", network.interfaces);
  section.text_list("peers", network.peers);
  section.text("discovery_server", network.discovery_server);
  section.integer("socket_buffer_bytes", network.socket_buffer_bytes, {0, 1U << 30U});
  // No datagram of Fast DDS fits into less, and it says nothing.
  constexpr std::uint32_t min_socket_buffer_bytes = 65536;
  if (network.socket_buffer_bytes > 0 && network.socket_buffer_bytes < min_socket_buffer_bytes)
    section.fault("socket_buffer_bytes", "is " + std::to_string(network.socket_buffer_bytes) +
                                             "; must be 65536 or more, or 0 for the profile's");
  try {
    static_cast<void>(dds_options(network, DdsRole::server));
  } catch (const ConfigError& error) {
    for (const std::string& fault : error.faults()) section.faults(fault);
  }
}

void read_dds(YamlSection section, const fs::path& folder, DdsConfig& dds) {
  section.integer("domain_id", dds.domain_id, {0, dds::max_domain_id});
  read_network(section, folder, dds.network);
  section.text("participant_name", dds.participant_name);
  if (dds.participant_name.empty())
    section.fault("participant_name", "is empty; ROS 2 and peers find the server by it");
  section.path("security", dds.security);
  if (section.has("ros_gid_bytes")) {
    section.fault(
        "ros_gid_bytes",
        "is no setting any more: the server finds out which ROS 2 its peers are; remove it");
  }
}

void check_topic(YamlSection& section, const std::string& field, std::string& name) {
  if (const std::string fault = to_topic_name(name); !fault.empty()) section.fault(field, fault);
}

void read_topic(YamlSection& section, const std::string& field, std::string& name) {
  section.text(field, name);
  check_topic(section, field, name);
}

/// Of one that may be off, which is empty.
void read_topic_or_empty(YamlSection& section, const std::string& field, std::string& name) {
  section.text(field, name);
  if (!name.empty()) check_topic(section, field, name);
}

/// Whether the file names the topic of the one lidar.
bool read_topics(YamlSection section, TopicsConfig& topics) {
  read_topic(section, "points", topics.points);
  read_topic(section, "namespace", topics.name_space);
  read_topic_or_empty(section, "odometry_prior", topics.odometry_prior);
  read_topic_or_empty(section, "imu", topics.imu);
  read_topic_or_empty(section, "gnss", topics.gnss);
  read_topic_or_empty(section, "initial_pose", topics.initial_pose);
  return section.has("points");
}

/// Three coordinates of fewer than three fields make no points.
void check_coordinates(YamlSection& section, const PointFieldNames& fields) {
  std::set<std::string> names;
  for (const auto* list : {&fields.x, &fields.y, &fields.z})
    if (!list->empty()) names.insert(coordinate_field(list->front()).name);
  if (names.size() < 3) section.fault("y", "x, y and z need a field each, no two of them the same");
}

void read_fields(YamlSection section, PointFieldNames& fields) {
  section.text_list("x", fields.x);
  section.text_list("y", fields.y);
  section.text_list("z", fields.z);
  check_coordinates(section, fields);
  section.text_list("intensity", fields.intensity);
  section.text_list("ring", fields.ring);
  section.text_list("time", fields.time);
  section.text_list("label", fields.label);
}

void read_input(YamlSection section, InputConfig& input) {
  section.choice<DeliveryMode>("delivery", input.delivery,
                               {{"latest", DeliveryMode::latest}, {"every", DeliveryMode::every}});
  section.integer("queue_length", input.queue_length, {1, 1000});
  section.number("sweep_wait_s", input.sweep_wait_s, {0, 60});
  read_fields(section.section("fields"), input.fields);
  section.choice<LabelKind>(
      "label_kind", input.label_kind,
      {{"semantic_kitti", LabelKind::semantic_kitti}, {"classes", LabelKind::classes}});
  double clouds_per_turn = TurnJoiner::automatic;
  section.number_or("auto", "clouds_per_turn", clouds_per_turn, {1, TurnJoiner::most});
  input.clouds_per_turn = static_cast<std::uint32_t>(clouds_per_turn);
  if (clouds_per_turn != std::floor(clouds_per_turn))
    section.fault("clouds_per_turn", "is no whole number");
}

void read_publish(YamlSection section, PublishConfig& publish) {
  section.number("path_period_s", publish.path_period_s, periods_s);
  section.integer("path_poses", publish.path_poses, {2, 1000000});
  section.number("cloud_period_s", publish.cloud_period_s, periods_s);
  section.number("cloud_window_m", publish.cloud_window_m, {1, 1000});
  section.number("tiles_period_s", publish.tiles_period_s, periods_s);
  section.number("tile_window_m", publish.tile_window_m, {1, 2000});
  section.number("status_period_s", publish.status_period_s, periods_s);
  section.boolean("scan", publish.scan);
}

void read_map(YamlSection section, MapFileConfig& map) {
  section.path("file", map.file);
  section.number("save_period_s", map.save_period_s, {0.1, 86400});
  section.integer("memory_limit_mib", map.memory_limit_mib, {0, 1 << 20});
  section.integer("standing_mib_per_hour", map.standing_mib_per_hour, {0, 1 << 20});
  section.boolean("load_at_start", map.load_at_start);
  section.integer("withdrawable_sessions", map.withdrawable_sessions, {0, 1000});
  section.boolean("close_loops", map.close_loops);
  section.integer("saved_maps", map.saved_maps, {0, 100000});
  section.integer("saved_maps_mib", map.saved_maps_mib, {0, 1 << 30});
  section.text("datum", map.datum);
  if (map.datum.empty()) return;
  try {
    static_cast<void>(datum_from_text(map.datum));
  } catch (const std::invalid_argument& fault) {
    section.fault("datum", fault.what());
  }
}

void read_occupancy(YamlSection section, OccupancyServiceConfig& occupancy) {
  OccupancyConfig& map = occupancy.map;
  section.boolean("enabled", occupancy.enabled);
  section.number("resolution_m", map.resolution_m, {0.02, 10});
  section.number("max_range_m", map.max_range_m, {1, 300});
  section.number("clearing_range_m", map.clearing_range_m, {0, 300});
  section.integer("clearing_interval", map.clearing_interval, {1, 1000});
  section.number("clearing_margin_m", map.clearing_margin_m, {0, 100});
  section.number("clearing_margin_share", map.clearing_margin_share, {0, 0.9});
  section.number("hit_probability", map.hit_probability, {0.501, 0.99});
  section.number("miss_probability", map.miss_probability, {0.01, 0.499});
  section.integer("queue_length", occupancy.queue_length, {1, 1000});
  section.number("publish_period_s", occupancy.publish_period_s, periods_s);
}

LidarConfig read_lidar(YamlSection& section, const fs::path& folder,
                       const PointFieldNames& fields) {
  LidarConfig lidar;
  section.require({"name", "sensor", "topic"});
  section.text("name", lidar.name);
  std::string sensor;
  section.text("sensor", sensor);
  if (sensor == told_by_scans) {
    section.fault("sensor",
                  "'auto' is for one lidar: where several are merged, name each one's, built in or "
                  "a sensor file");
  } else {
    read_sensor(sensor, section, folder, lidar.sensor);
  }
  section.text("topic", lidar.topic);
  section.text("frame", lidar.frame);
  check_frame(section, "frame", lidar.frame);
  lidar.fields = fields;
  read_fields(section.section("fields"), lidar.fields);
  lidar.T_base_lidar = read_extrinsic(section);
  // In counters, whose names are metrics' labels.
  const bool is_word = std::ranges::all_of(
      lidar.name, [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; });
  if (lidar.name.empty() || !is_word) {
    section.fault("name", "'" + lidar.name + "'; names have letters, digits and '_'");
  }
  check_topic(section, "topic", lidar.topic);
  return lidar;
}

/// Whether clouds of both would be taken for the same lidar's.
bool are_mixed_up(const LidarConfig& a, const LidarConfig& b) {
  return a.topic == b.topic && (a.frame.empty() || b.frame.empty() || a.frame == b.frame);
}

/// What one lidar has elsewhere, several have in their list.
void check_single_lidar_fields(YamlSection& file) {
  for (const char* name : {"sensor", "mount"}) {
    if (!file.has(name)) continue;
    file.fault(name, "is of one lidar, and 'sensors' lists several: leave one of the two out");
  }
}

void read_lidars(YamlSection& file, const fs::path& folder, ServerConfig& config) {
  std::vector<LidarConfig>& lidars = config.lidars;
  file.sections("sensors", [&](YamlSection section) {
    LidarConfig lidar = read_lidar(section, folder, config.input.fields);
    for (const LidarConfig& other : lidars) {
      if (lidar.name == other.name) section.fault("name", "two are called '" + lidar.name + "'");
      if (are_mixed_up(lidar, other)) {
        section.fault("topic", "is also that of '" + other.name +
                                   "'; their frames (header.frame_id) must tell them apart");
      }
    }
    lidars.push_back(std::move(lidar));
  });
  if (lidars.empty()) return;
  check_single_lidar_fields(file);
  if (config.frames.base.empty() || config.frames.lidar.empty()) {
    file.fault("sensors",
               "need names for the robot's frame and for that of the merged scans: set "
               "frames.base (base_link) and frames.lidar");
  }
  std::vector<Eigen::Isometry3d> T_base_lidars;
  for (const LidarConfig& lidar : lidars) T_base_lidars.push_back(lidar.T_base_lidar);
  config.mount.T_base_lidar = merged_frame(T_base_lidars);
  const Eigen::Isometry3d T_merged_base = config.mount.T_base_lidar.inverse();
  std::vector<PlacedSensor> sensors;
  for (const LidarConfig& lidar : lidars) {
    sensors.push_back({lidar.sensor, T_merged_base * lidar.T_base_lidar});
  }
  config.mapper.sensor = merged_sensor(sensors);
  config.automatic_sensor.is_on = false;
}

void read_log(YamlSection section, LogConfig& log) {
  section.choice<LogLevel>("level", log.level,
                           {{"debug", LogLevel::debug},
                            {"info", LogLevel::info},
                            {"warning", LogLevel::warning},
                            {"error", LogLevel::error}});
}

void read_metrics(YamlSection section, MetricsConfig& metrics) {
  section.text("address", metrics.address);
  if (metrics.address.empty()) return;
  const std::string fault = listening_address_fault(metrics.address);
  if (!fault.empty()) section.fault("address", fault);
}

void read_server(YamlSection file, const fs::path& folder, ServerConfig& config) {
  std::string sensor = told_by_scans;
  file.text("sensor", sensor);
  config.automatic_sensor.is_on = sensor == told_by_scans;
  if (!config.automatic_sensor.is_on) read_sensor(sensor, file, folder, config.mapper.sensor);
  read_mapper(file, config.mapper);
  read_labels(file.section("labels"), config.labels);
  read_frames(file.section("frames"), config.frames);
  read_mount(file.section("mount"), config.frames, config.mount);
  read_dds(file.section("dds"), folder, config.dds);
  const bool names_points = read_topics(file.section("topics"), config.topics);
  read_gnss(file.section("gnss"), config.gnss);
  if (config.frames.odom_source == FramesConfig::OdomSource::prior &&
      config.topics.odometry_prior.empty()) {
    file.fault("frames", "odom_source: prior needs topics.odometry_prior");
  }
  read_input(file.section("input"), config.input);
  read_lidars(file, folder, config);
  if (names_points && !config.lidars.empty()) {
    file.fault("topics",
               "points is of one lidar, and each of 'sensors' has its topic: leave it out");
  }
  read_publish(file.section("publish"), config.publish);
  read_map(file.section("map"), config.map);
  if (!config.topics.gnss.empty() && !config.map.close_loops)
    file.fault("topics", "gnss corrects the map: it needs map.close_loops");
  read_occupancy(file.section("occupancy"), config.occupancy);
  read_traversability(file.section("traversability"), folder, config.mapper.static_map.tile_size_m,
                      config.traversability);
  read_log(file.section("log"), config.log);
  read_metrics(file.section("metrics"), config.metrics);
}

}  // namespace

ServerConfig load_server_config(const fs::path& file) {
  ConfigReport report;
  return load_server_config(file, report);
}

ServerConfig load_server_config(const fs::path& file, ConfigReport& report) {
  YamlFile yaml = open_yaml(file);
  ServerConfig config;
  read_server(YamlSection(yaml), file.parent_path(), config);
  yaml.require_no_faults();
  const SensorModel sensor = config.mapper.sensor;
  AutomaticSensor& automatic = config.automatic_sensor;
  automatic.sets_min_range = is_left_open(yaml.report, "prepare.min_range_m");
  automatic.sets_max_range = is_left_open(yaml.report, "prepare.max_range_m");
  // A lidar that its scans tell is not known yet.
  const bool both_are_known =
      !automatic.is_on || (!automatic.sets_min_range && !automatic.sets_max_range);
  const auto fault = range_fault(sensor, automatic, config.mapper.prepare);
  if (fault && both_are_known) {
    yaml.fault(yaml.root["prepare"][fault->field], "prepare." + fault->field, fault->text);
    yaml.require_no_faults();
  }
  report = std::move(yaml.report);
  // The range that the file says is kept for the lidar that will be told.
  if (!fault) use_sensor(sensor, automatic, config.mapper);
  return config;
}

std::optional<RangeFault> range_fault(const SensorModel& sensor, const AutomaticSensor& automatic,
                                      const PrepareConfig& prepare) {
  if (automatic.sets_min_range && automatic.sets_max_range) return std::nullopt;
  if (!automatic.sets_min_range && !automatic.sets_max_range) {
    if (prepare.min_range_m < prepare.max_range_m) return std::nullopt;
    return RangeFault{"max_range_m", "must be above min_range_m"};
  }
  const bool is_min = automatic.sets_max_range;
  const bool fits =
      is_min ? prepare.min_range_m < sensor.max_range_m : prepare.max_range_m > sensor.min_range_m;
  if (fits) return std::nullopt;
  std::ostringstream text;
  text << "is " << (is_min ? prepare.min_range_m : prepare.max_range_m) << " m, and the lidar '"
       << sensor.name << "' measures from " << sensor.min_range_m << " m to " << sensor.max_range_m
       << " m: no point would be left; " << (is_min ? "lower" : "raise") << " it, or set prepare."
       << (is_min ? "max_range_m" : "min_range_m") << ", too";
  return RangeFault{is_min ? "min_range_m" : "max_range_m", text.str()};
}

void use_sensor(const SensorModel& sensor, const AutomaticSensor& automatic, MapperConfig& mapper) {
  mapper.sensor = sensor;
  const bool fits = !range_fault(sensor, automatic, mapper.prepare);
  if (automatic.sets_min_range || !fits) mapper.prepare.min_range_m = sensor.min_range_m;
  if (automatic.sets_max_range || !fits) mapper.prepare.max_range_m = sensor.max_range_m;
}

}  // namespace stillmap
