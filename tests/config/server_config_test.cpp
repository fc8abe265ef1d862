#include "config/loaders/server_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/config/config_files.hpp"

namespace stillmap {
namespace {

using test::refusal;
using test::shipped;
using test::write_file;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

ServerConfig load(const std::string& yaml) {
  return load_server_config(write_file("server.yaml", yaml));
}

std::string refusal_of(const std::string& yaml) {
  return refusal([&] { (void)load(yaml); });
}

TEST(ServerConfig, ShippedDefaultFileShowsEveryFieldWithItsDefault) {
  ConfigReport report;
  (void)load_server_config(shipped("server/default.yaml"), report);
  EXPECT_THAT(report.left_out, IsEmpty());
  EXPECT_THAT(report.changed, IsEmpty());
}

TEST(ServerConfig, ShippedReplayFileLosesNoScan) {
  const ServerConfig config = load_server_config(shipped("server/replay_lossless.yaml"));
  EXPECT_EQ(config.input.delivery, DeliveryMode::every);
}

TEST(ServerConfig, ReportsWhatAFileChanges) {
  ConfigReport report;
  (void)load_server_config(
      write_file("server.yaml", "publish: {scan: false, path_period_s: 1.0}\nsensor: vlp_16\n"),
      report);
  EXPECT_THAT(report.changed, UnorderedElementsAre("publish.scan", "sensor"));
}

TEST(ServerConfig, ReadsFieldsOfEveryKind) {
  const ServerConfig config = load(R"(
sensor: vlp_16
labels: {source: none, engine: onednn, precision: int8, threads: 3, image_columns: 512,
         stance: mount, mirrored: true}
dds: {domain_id: 42, shared_memory: false, interfaces: [127.0.0.1],
      profile: wifi, peers: [a, "b:1"], discovery_server: c, socket_buffer_bytes: 99999}
topics: {odometry_prior: ""}
input: {fields: {label: [label, class]}, label_kind: classes}
prepare: {ego_hull_lidar_m: [-1, -0.5, -1, 1, 0.5, 0]}
odometry: {weighting: geometric, registration: {max_iterations: 7}}
static_map: {min_points: 5}
)");
  EXPECT_EQ(config.mapper.sensor.rings, 16);
  EXPECT_EQ(config.labels.source, LabelProvider::none);
  EXPECT_EQ(config.labels.engine.engine, EngineOptions::Engine::onednn);
  EXPECT_EQ(config.labels.engine.precision, EngineOptions::PrecisionMode::int8);
  EXPECT_EQ(config.labels.engine.threads, 3);
  EXPECT_EQ(config.labels.image_columns, 512);
  EXPECT_FALSE(config.labels.finds_stance);
  EXPECT_TRUE(config.labels.mirrored);
  EXPECT_EQ(config.dds.domain_id, 42U);
  EXPECT_EQ(config.dds.network.shared_memory, std::optional<bool>(false));
  EXPECT_THAT(config.dds.network.interfaces, ::testing::ElementsAre("127.0.0.1"));
  EXPECT_EQ(config.dds.network.profile, "wifi");
  EXPECT_THAT(config.dds.network.peers, ::testing::ElementsAre("a", "b:1"));
  EXPECT_EQ(config.dds.network.discovery_server, "c");
  EXPECT_EQ(config.dds.network.socket_buffer_bytes, 99999U);
  EXPECT_EQ(config.topics.odometry_prior, "");
  EXPECT_THAT(config.input.fields.label, ::testing::ElementsAre("label", "class"));
  EXPECT_EQ(config.input.label_kind, LabelKind::classes);
  EXPECT_TRUE(config.mapper.prepare.ego_hull_lidar.contains(Eigen::Vector3d(0.9, 0.4, -0.9)));
  EXPECT_FALSE(config.mapper.prepare.ego_hull_lidar.contains(Eigen::Vector3d(0.9, 0.6, -0.9)));
  EXPECT_EQ(config.mapper.odometry.weighting, Weighting::geometric);
  EXPECT_EQ(config.mapper.odometry.registration.max_iterations, 7);
  EXPECT_EQ(config.mapper.static_map.min_points, 5U);
}

TEST(ServerConfig, ReadsTheAxesOfPoints) {
  const ServerConfig config = load("input: {fields: {x: [z], y: [-x], z: [y]}}");
  EXPECT_THAT(config.input.fields.y, ::testing::ElementsAre("-x"));
  EXPECT_THAT(refusal_of("input: {fields: {y: [-x]}}"), HasSubstr("no two of them the same"));
  EXPECT_THAT(refusal_of("input: {fields: {y: []}}"), HasSubstr("no two of them the same"));
}

TEST(ServerConfig, ReadsHowManyCloudsAreATurn) {
  const auto clouds_per_turn = [](const std::string& value) {
    return load("input: {clouds_per_turn: " + value + "}").input.clouds_per_turn;
  };
  EXPECT_EQ(clouds_per_turn("auto"), TurnJoiner::automatic);
  EXPECT_EQ(clouds_per_turn("1"), 1U);
  EXPECT_EQ(clouds_per_turn("4"), 4U);
  EXPECT_THAT(refusal_of("input: {clouds_per_turn: 2.5}"), HasSubstr("no whole number"));
  EXPECT_THAT(refusal_of("input: {clouds_per_turn: 0}"), HasSubstr("'auto', or a number"));
}

TEST(ServerConfig, ReadsWhereTheLidarSits) {
  const ServerConfig config = load(
      "frames: {base: base_link, odom: odom}\n"
      "mount: {xyz_m: [1, 2, 3], rpy_deg: [0, 90, 0]}\n");
  EXPECT_EQ(config.frames.base, "base_link");
  EXPECT_EQ(config.frames.odom, "odom");
  const Eigen::Isometry3d& T_base_lidar = config.mount.T_base_lidar;
  EXPECT_TRUE((T_base_lidar * Eigen::Vector3d(1.0, 0.0, 0.0))
                  .isApprox(Eigen::Vector3d(1.0, 2.0, 2.0), 1e-12));
  const ServerConfig published = load(
      "frames: {base: base_link, lidar: ''}\n"
      "mount: {source: tf_static, wait_s: 3, if_missing: identity}\n");
  EXPECT_EQ(published.mount.source, MountConfig::Source::tf_static);
  EXPECT_EQ(published.mount.wait_s, 3.0);
  EXPECT_TRUE(published.mount.identity_if_missing);
}

TEST(ServerConfig, RefusesFramesThatDoNotFitTogether) {
  EXPECT_THAT(refusal_of("mount: {xyz_m: [1, 0, 0]}"), HasSubstr("set frames.base"));
  EXPECT_THAT(refusal_of("mount: {source: tf_static}"), HasSubstr("set frames.base"));
  EXPECT_THAT(refusal_of("frames: {odom: odom}"), HasSubstr("set frames.base"));
  EXPECT_THAT(refusal_of("frames: {base: b, odom_source: prior}"), HasSubstr("set frames.odom"));
  EXPECT_THAT(refusal_of("frames: {base: b, odom: o, odom_source: prior}\n"
                         "topics: {odometry_prior: ''}"),
              HasSubstr("needs topics.odometry_prior"));
  EXPECT_THAT(refusal_of("frames: {base: map}"), HasSubstr("'map' is the name of two frames"));
  EXPECT_THAT(refusal_of("frames: {base: b}\nmount: {xyz_m: [1, 0]}"),
              HasSubstr("mount.xyz_m: has 2 numbers; wanted are three"));
  EXPECT_THAT(refusal_of("frames: {base: b}\nmount: {rpy_deg: [0, .nan, 0]}"),
              HasSubstr("mount.rpy_deg"));
  EXPECT_THAT(refusal_of("frames: {base: b}\nmount: {source: tf_static, xyz_m: [1, 0, 0]}"),
              HasSubstr("are not used with source: tf_static"));
}

TEST(ServerConfig, ReadsSeveralLidarsOfOneRobot) {
  const ServerConfig config = load(
      "frames: {base: base_link}\n"
      "sensors:\n"
      "  - {name: front, sensor: vlp_16, topic: front/points, xyz_m: [1, 0, 1]}\n"
      "  - {name: rear, sensor: hdl_32e, topic: rear/points, frame: r, xyz_m: [-1, 0, 2],\n"
      "     rpy_deg: [0, 0, 180]}\n");
  ASSERT_EQ(config.lidars.size(), 2U);
  EXPECT_EQ(config.lidars[0].sensor.rings, 16);
  EXPECT_EQ(config.lidars[1].name, "rear");
  EXPECT_EQ(config.lidars[1].topic, "rear/points");
  EXPECT_EQ(config.lidars[1].frame, "r");
  EXPECT_TRUE(
      config.mount.T_base_lidar.translation().isApprox(Eigen::Vector3d(0.0, 0.0, 1.5), 1e-12));
  EXPECT_EQ(config.mapper.sensor.rings, 48);
  EXPECT_EQ(config.mapper.sensor.pattern, ScanPattern::merged);
}

TEST(ServerConfig, OfSeveralLidarsEachMayHaveItsOwnFields) {
  const std::string first =
      "frames: {base: base_link}\ninput: {fields: {ring: [row]}}\n"
      "sensors:\n  - {name: front, sensor: vlp_16, topic: front/points}\n"
      "  - {name: rear, sensor: vlp_16, topic: rear/points, fields: ";
  const ServerConfig config = load(first + "{y: [-y], time: [dt]}}\n");
  ASSERT_EQ(config.lidars.size(), 2U);
  EXPECT_THAT(config.lidars[0].fields.y, ::testing::ElementsAre("y"));
  EXPECT_THAT(config.lidars[0].fields.ring, ::testing::ElementsAre("row"));
  EXPECT_THAT(config.lidars[1].fields.y, ::testing::ElementsAre("-y"));
  EXPECT_THAT(config.lidars[1].fields.time, ::testing::ElementsAre("dt"));
  EXPECT_THAT(config.lidars[1].fields.ring, ::testing::ElementsAre("row"));
  EXPECT_THAT(refusal_of(first + "{y: [-x]}}\n"),
              AllOf(HasSubstr("sensors[1].fields.y"), HasSubstr("no two of them the same")));
  EXPECT_THAT(refusal_of(first + "{rings: [row]}}\n"), HasSubstr("sensors[1].fields.rings"));
}

TEST(ServerConfig, RefusesLidarsThatCannotBeToldApart) {
  const std::string base = "frames: {base: base_link}\n";
  const std::string front = "{name: front, sensor: vlp_16, topic: points}";
  const auto with = [&](const std::string& second) {
    return refusal_of(base + "sensors: [" + front + ", " + second + "]\n");
  };
  EXPECT_THAT(with("{name: rear, sensor: vlp_16, topic: points}"),
              HasSubstr("sensors[1].topic: is also that of 'front'"));
  EXPECT_THAT(with("{name: front, sensor: vlp_16, topic: b}"), HasSubstr("two are called 'front'"));
  EXPECT_THAT(with("{name: a b, sensor: vlp_16, topic: b}"), HasSubstr("sensors[1].name"));
  EXPECT_THAT(with("{sensor: vlp16, topic: b}"),
              AllOf(HasSubstr("sensors[1].name: is missing"), HasSubstr("did you mean 'vlp_16'")));
  EXPECT_THAT(with("7"), HasSubstr("sensors[1]"));
  EXPECT_THAT(refusal_of("sensors: [" + front + "]\n"), HasSubstr("frames.base"));
  EXPECT_THAT(refusal_of(base + "sensor: vlp_16\nsensors: [" + front + "]\n"),
              HasSubstr("leave one of the two out"));
  EXPECT_THAT(refusal_of(base + "topics: {points: lidar}\nsensors: [" + front + "]\n"),
              HasSubstr("points is of one lidar"));
  EXPECT_THAT(refusal_of(base + "mount: {xyz_m: [1, 0, 0]}\nsensors: [" + front + "]\n"),
              HasSubstr("leave one of the two out"));
}

TEST(ServerConfig, TakesRelativePathsFromTheFilesFolder) {
  (void)write_file("my_sensor.yaml", "{name: mine, rings: 8, fov_up_deg: 10, fov_down_deg: -10}");
  const ServerConfig config =
      load("sensor: my_sensor.yaml\nmap: {file: out/a.stillmap}\nlabels: {model: /models/a}\n");
  EXPECT_EQ(config.mapper.sensor.rings, 8);
  EXPECT_EQ(config.map.file, test::test_folder() / "out/a.stillmap");
  EXPECT_EQ(config.labels.model, "/models/a");
}

TEST(ServerConfig, AMapFileWithoutANameIsNone) {
  EXPECT_EQ(load("map: {file: \"\"}\n").map.file, "");
  EXPECT_EQ(load("map:\n  file:\n").map.file, "");
}

TEST(ServerConfig, KeepsDefaultsOfASectionThatIsCommentedOut) {
  EXPECT_EQ(load("publish:\n  # scan: false\n").publish.scan, true);
}

TEST(ServerConfig, FindsEveryFaultAtOnceWithItsLine) {
  const std::string text =
      refusal_of("publish:\n  path_period_s: -1\n  scan: maybe\ndds:\n  domain_id: 500\nfoo: 1\n");
  EXPECT_THAT(text, AllOf(HasSubstr("server.yaml:2: publish.path_period_s: '-1'"),
                          HasSubstr("server.yaml:3: publish.scan: 'maybe'"),
                          HasSubstr("server.yaml:5: dds.domain_id: '500'"), HasSubstr("0 to 232"),
                          HasSubstr("server.yaml:6: foo")));
}

TEST(ServerConfig, RefusesWhatDdsCannotUse) {
  EXPECT_THAT(refusal_of("dds: {socket_buffer_bytes: 1000}"), HasSubstr("must be 65536 or more"));
  EXPECT_THAT(refusal_of("dds: {participant_name: \"\"}"),
              HasSubstr("dds.participant_name: is empty"));
}

TEST(ServerConfig, LeavesTheLidarToItsScansWhereItIsNotNamed) {
  EXPECT_TRUE(load("labels: {source: none}\n").automatic_sensor.is_on);
  EXPECT_TRUE(load("sensor: auto\n").automatic_sensor.is_on);
  EXPECT_FALSE(load("sensor: hdl_64e\n").automatic_sensor.is_on);
  EXPECT_THAT(refusal_of("frames: {base: base_link, lidar: lidar}\n"
                         "sensors:\n"
                         "  - {name: front, sensor: auto, topic: front}\n"
                         "  - {name: rear, sensor: vlp_16, topic: rear}\n"),
              HasSubstr("'auto' is for one lidar"));
}

TEST(ServerConfig, TakesRangesOfALidarThatWasToldUnlessTheFileSaysThem) {
  SensorModel told = vlp_16();
  told.min_range_m = 1.5;
  told.max_range_m = 77.0;
  ServerConfig any = load("sensor: auto\n");
  use_sensor(told, any.automatic_sensor, any.mapper);
  EXPECT_EQ(any.mapper.sensor.rings, 16);
  EXPECT_EQ(any.mapper.prepare.min_range_m, 1.5);
  EXPECT_EQ(any.mapper.prepare.max_range_m, 77.0);
  ServerConfig near = load("prepare: {max_range_m: 30}\n");
  use_sensor(told, near.automatic_sensor, near.mapper);
  EXPECT_EQ(near.mapper.prepare.min_range_m, 1.5);
  EXPECT_EQ(near.mapper.prepare.max_range_m, 30.0);
}

TEST(ServerConfig, SuggestsTheNameThatWasMeant) {
  EXPECT_THAT(refusal_of("publish: {path_period: 2}"), HasSubstr("did you mean 'path_period_s'"));
  EXPECT_THAT(refusal_of("odometri: {alpha: 0.1}"), HasSubstr("did you mean 'odometry'"));
  EXPECT_THAT(refusal_of("sensor: hdl64e"), HasSubstr("did you mean 'hdl_64e'"));
  EXPECT_THAT(refusal_of("labels: {image_columns: 15}"), HasSubstr("image_columns"));
  EXPECT_THAT(refusal_of("labels: {image_columns: 8193}"), HasSubstr("image_columns"));
  EXPECT_THAT(refusal_of("labels: {stance: upright}"), HasSubstr("known are: auto, mount"));
  EXPECT_THAT(refusal_of("input: {delivery: reliable}"), HasSubstr("known are: latest, every"));
}

TEST(ServerConfig, TellsTheNewNameOfARenamedField) {
  EXPECT_THAT(refusal_of("areas: {profiles: []}"),
              HasSubstr("server.yaml:1: areas: is now called 'traversability'"));
  EXPECT_THAT(refusal_of("static_map: {look_every: 3, passes: 4, passes_per_hit: 2}"),
              AllOf(HasSubstr("look_every: is now called 'static_map.clearing_interval'"),
                    HasSubstr("passes: is now called 'static_map.misses_to_clear'"),
                    HasSubstr("passes_per_hit: is now called 'static_map.misses_per_hit'")));
  EXPECT_THAT(refusal_of("occupancy: {clear_every: 3}"),
              HasSubstr("is now called 'occupancy.clearing_interval'"));
  EXPECT_THAT(refusal_of("odometry: {motion: {use_past_views: true, past_views: 4, "
                         "past_view_interval: 2}}"),
              AllOf(HasSubstr("is now called 'odometry.motion.use_range_image_history'"),
                    HasSubstr("is now called 'odometry.motion.range_image_history_size'"),
                    HasSubstr("is now called 'odometry.motion.range_image_history_interval'")));
}

TEST(ServerConfig, TellsNoNewNameThatItRefusesItself) {
  EXPECT_THAT(refusal_of("bulk_bytes_per_s: 500000"),
              AllOf(HasSubstr("bulk_bytes_per_s: there is no such field"),
                    Not(HasSubstr("is now called"))));
}

TEST(ServerConfig, RefusesValuesOfTheWrongKind) {
  for (const char* value : {".nan", "nan", "inf", "1 m", "[1]", "{a: 1}", "''", "1e999", "~"}) {
    EXPECT_THAT(refusal_of("publish: {path_period_s: " + std::string(value) + "}"),
                HasSubstr("publish.path_period_s"))
        << value;
  }
  EXPECT_THAT(refusal_of("input: {queue_length: 2.5}"), HasSubstr("a whole number"));
  EXPECT_THAT(refusal_of("input: {queue_length: 99999999999999999999}"), HasSubstr("whole"));
  EXPECT_THAT(refusal_of("publish: 7"), HasSubstr("a section with fields"));
  EXPECT_THAT(refusal_of("publish: [1, 2]"), HasSubstr("a section with fields"));
  EXPECT_THAT(refusal_of("dds: {interfaces: eth0}"), HasSubstr("a list"));
  EXPECT_THAT(refusal_of("dds: {interfaces: [[1]]}"), HasSubstr("a list"));
  EXPECT_THAT(refusal_of("labels: {model: [a]}"), HasSubstr("a text"));
}

TEST(ServerConfig, TakesTopicsAsRosToolsPrintThem) {
  const ServerConfig config =
      load("topics: {points: /velodyne_points, namespace: /stillmap, imu: /imu/data2}");
  EXPECT_EQ(config.topics.points, "velodyne_points");
  EXPECT_EQ(config.topics.name_space, "stillmap");
  EXPECT_EQ(config.topics.imu, "imu/data2");
}

TEST(ServerConfig, RefusesValuesThatDoNotFitTogether) {
  EXPECT_THAT(refusal_of("labels: {model: \"\"}"), HasSubstr("give a model's name"));
  EXPECT_THAT(refusal_of("prepare: {min_range_m: 200, max_range_m: 100}"),
              HasSubstr("above min_range_m"));
  EXPECT_THAT(refusal_of("prepare: {ego_hull_lidar_m: [1, 2]}"), HasSubstr("has 2 numbers"));
  EXPECT_THAT(refusal_of("prepare: {ego_hull_lidar_m: [1, 1, 1, 0, 0, 0]}"),
              HasSubstr("minimum above"));
  EXPECT_THAT(refusal_of("static_map: {tile_size_m: 20.1}"), HasSubstr("static_map"));
  EXPECT_THAT(refusal_of("dds: {ros_gid_bytes: 16}"), HasSubstr("its peers are; remove it"));
  EXPECT_THAT(refusal_of("dds: {interfaces: [eth0]}"), HasSubstr("not an IPv4 address"));
  EXPECT_THAT(refusal_of("dds: {profile: ether}"), HasSubstr("DDS profile 'ether'"));
  EXPECT_THAT(refusal_of("topics: {points: 'a b'}"), HasSubstr("topics.points"));
  EXPECT_THAT(refusal_of("topics: {points: " + std::string(201, 'a') + "}"),
              AllOf(HasSubstr("topics.points"), HasSubstr("201 characters")));
  EXPECT_EQ(refusal_of("topics: {points: " + std::string(200, 'a') + "}"), "");
  EXPECT_THAT(refusal_of(R"(map: {file: "a\0b"})"), HasSubstr("map.file: has a character \\0"));
  EXPECT_THAT(refusal_of(R"(dds: {peers: ["a\0b"]})"), HasSubstr("dds.peers"));
  EXPECT_THAT(refusal_of("topics: {points: 1abc}"), HasSubstr("begin with no digit"));
  EXPECT_THAT(refusal_of("topics: {gnss: robot/2/fix}"), HasSubstr("topics.gnss"));
  EXPECT_THAT(refusal_of("topics: {gnss: fix}\nmap: {close_loops: false}"),
              HasSubstr("needs map.close_loops"));
  EXPECT_THAT(refusal_of("gnss: {antenna_m: [1, 2]}"), HasSubstr("wanted are three"));
  EXPECT_THAT(refusal_of("gnss: {max_sigma_m: 0}"), HasSubstr("gnss.max_sigma_m"));
  EXPECT_THAT(refusal_of("frames: {map: ''}"), HasSubstr("frames.map"));
  EXPECT_THAT(refusal_of("map: {datum: '48'}"), HasSubstr("latitude,longitude"));
}

TEST(ServerConfig, PointsBeyondTheSensorsRangeAreDroppedUnlessTheFileSaysOtherwise) {
  static_cast<void>(write_file("near.yaml", R"(
name: near
rings: 16
fov_up_deg: 16
fov_down_deg: -16
min_range_m: 2
max_range_m: 35
)"));
  const ServerConfig near = load("sensor: near.yaml");
  EXPECT_EQ(near.mapper.prepare.min_range_m, 2.0);
  EXPECT_EQ(near.mapper.prepare.max_range_m, 35.0);
  const ServerConfig told = load("sensor: near.yaml\nprepare: {max_range_m: 20}");
  EXPECT_EQ(told.mapper.prepare.min_range_m, 2.0);
  EXPECT_EQ(told.mapper.prepare.max_range_m, 20.0);
  EXPECT_EQ(load("log: {level: info}").mapper.prepare.max_range_m, 120.0);
}

TEST(ServerConfig, FindsTheRobotsOfItsAreas) {
  const ServerConfig config = load("traversability: {profiles: [tracked], grid_profile: tracked}");
  ASSERT_EQ(load_robots(config.traversability).size(), 1U);
  EXPECT_EQ(load_robots(config.traversability)[0].name, "tracked");
  EXPECT_TRUE(load_robots(load("traversability: {profiles: []}").traversability).empty());
  EXPECT_THAT(refusal_of("traversability: {profiles: [car, submarine]}"),
              AllOf(HasSubstr("server.yaml:1: traversability.profiles"), HasSubstr("'submarine'"),
                    HasSubstr("car, delivery_robot, tracked")));
  EXPECT_THAT(refusal_of("traversability: {profiles: [car, car]}"),
              HasSubstr("two robots are called 'car'"));
  EXPECT_THAT(refusal_of("traversability: {profiles: [tracked]}"),
              AllOf(HasSubstr("traversability.grid_profile"), HasSubstr("'car' is not one of")));
  EXPECT_THAT(refusal_of("traversability: {profiles: [mine/my_robot.yaml]}"),
              HasSubstr((test::test_folder() / "mine/my_robot.yaml").string()));
}

TEST(ServerConfig, RefusesANameThatIsWrittenTwice) {
  EXPECT_THAT(refusal_of("publish: {scan: true}\npublish: {scan: false}\n"), HasSubstr("twice"));
}

TEST(ServerConfig, ShowsTheFaultsOfASensorFile) {
  (void)write_file("broken.yaml", "{name: x, rings: 0, fov_up_deg: 10, fov_down_deg: 20}");
  EXPECT_THAT(refusal_of("sensor: broken.yaml"),
              AllOf(HasSubstr("broken.yaml:1: rings"), HasSubstr("below fov_up")));
}

TEST(ServerConfig, RefusesARangeThatLeavesNoPointOfTheSensor) {
  EXPECT_THAT(refusal_of("sensor: vlp_16\nprepare:\n  min_range_m: 110\n"),
              AllOf(HasSubstr("server.yaml:3: prepare.min_range_m: is 110 m"),
                    HasSubstr("'VLP-16' measures from 0.5 m to 100 m"),
                    HasSubstr("lower it, or set prepare.max_range_m, too")));
  (void)write_file("far.yaml",
                   "{name: far, rings: 8, fov_up_deg: 10, fov_down_deg: -10, min_range_m: 5, "
                   "max_range_m: 300}");
  EXPECT_THAT(refusal_of("sensor: far.yaml\nprepare: {max_range_m: 4}"),
              AllOf(HasSubstr("prepare.max_range_m: is 4 m"), HasSubstr("from 5 m to 300 m"),
                    HasSubstr("raise it, or set prepare.min_range_m, too")));
  EXPECT_EQ(refusal_of("sensor: vlp_16\nprepare: {min_range_m: 110, max_range_m: 150}"), "");
}

TEST(ServerConfig, TakesTheSensorsRangesByTheirWord) {
  const std::string livox = "sensor: " + shipped("sensors/livox_avia.yaml").string() + "\n";
  const ServerConfig avia = load(livox + "prepare: {min_range_m: sensor, max_range_m: sensor}");
  EXPECT_EQ(avia.mapper.prepare.min_range_m, 1.0);
  EXPECT_EQ(avia.mapper.prepare.max_range_m, 200.0);
  const ServerConfig far = load(livox + "prepare: {min_range_m: 150}");
  EXPECT_EQ(far.mapper.prepare.min_range_m, 150.0);
  EXPECT_EQ(far.mapper.prepare.max_range_m, 200.0);
  EXPECT_EQ(load("prepare: {min_range_m: 150}").mapper.prepare.min_range_m, 150.0);
  EXPECT_THAT(refusal_of("prepare: {max_range_m: lidar}"),
              AllOf(HasSubstr("prepare.max_range_m: 'lidar' is not allowed"),
                    HasSubstr("'sensor', or a number from 0.1 to 10000")));
  EXPECT_THAT(refusal_of("prepare: {min_range_m: 5, max_range_m: 4}"),
              HasSubstr("prepare.max_range_m: must be above min_range_m"));
}

TEST(ServerConfig, ALidarThatWasToldKeepsItsRangesWhereTheFileLeavesNoPointOfIt) {
  ServerConfig config = load("prepare: {min_range_m: 110}\n");
  const SensorModel told = vlp_16();
  ASSERT_TRUE(range_fault(told, config.automatic_sensor, config.mapper.prepare));
  use_sensor(told, config.automatic_sensor, config.mapper);
  EXPECT_EQ(config.mapper.prepare.min_range_m, told.min_range_m);
  EXPECT_EQ(config.mapper.prepare.max_range_m, told.max_range_m);
}

TEST(ServerConfig, RefusesFramesThatBeginWithASlash) {
  for (const char* field : {"map", "odom", "base", "lidar"}) {
    const std::string frames = "frames: {base: b, " + std::string(field) + ": /robot}";
    EXPECT_THAT(
        refusal_of(std::string(field) == "base" ? "frames: {base: /robot}" : frames),
        AllOf(HasSubstr("frames." + std::string(field) + ": '/robot'"), HasSubstr("leave the '/'")))
        << field;
  }
  EXPECT_THAT(refusal_of("frames: {base: base_link}\n"
                         "sensors: [{name: a, sensor: vlp_16, topic: b, frame: /velodyne}]\n"),
              HasSubstr("sensors[0].frame: '/velodyne' begins with '/'"));
}

TEST(ServerConfig, RefusesRobotsThatAreLargerThanTiles) {
  EXPECT_THAT(refusal_of("static_map: {voxel_size_m: 0.2, tile_size_m: 0.8}\n"
                         "traversability: {profiles: [car, delivery_robot]}"),
              AllOf(HasSubstr("server.yaml:2: traversability.profiles"), HasSubstr("'car'"),
                    HasSubstr("0.95 m"), HasSubstr("static_map.tile_size_m = 0.8"),
                    Not(HasSubstr("'delivery"))));
}

}  // namespace
}  // namespace stillmap
