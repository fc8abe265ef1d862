// The mapping thread with a lidar that its scans tell.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mutex>
#include <stdexcept>

#include "core/segmentation/model_error.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/dds/writer.hpp"
#include "server/mapping/mapping_thread.hpp"
#include "server/publishers/status_publisher.hpp"
#include "tests/eventually.hpp"
#include "tests/idl/dds_fixture.hpp"
#include "tests/server/room_scans.hpp"

namespace stillmap::server {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Clock = std::chrono::steady_clock;

/// Keeps the mount that it was told last.
class MountKeeper final : public Segmenter {
 public:
  explicit MountKeeper(Eigen::Isometry3d& T_base_lidar) : T_base_lidar_(T_base_lidar) {}
  [[nodiscard]] std::string name() const override { return "mount keeper"; }
  [[nodiscard]] PointLabels segment(const Scan& scan) override {
    return PassthroughSegmenter().segment(scan);
  }
  void set_mount(const Eigen::Isometry3d& T_base_lidar) override { T_base_lidar_ = T_base_lidar; }

 private:
  Eigen::Isometry3d& T_base_lidar_;
};

class ToldSensor : public testing::Test {
 protected:
  ToldSensor() { config_.input.delivery = DeliveryMode::every; }

  void start() {
    MappingOutputs helpers;
    helpers.static_transforms = robot_ ? &robot_->transforms : nullptr;
    helpers.open_segmenter = [this](const SensorModel& sensor,
                                    const Eigen::Isometry3d& T_base_lidar) {
      opened_.push_back(sensor.name);
      T_base_lidar_opened_ = T_base_lidar;
      if (fails_) throw ModelError("street", "has no images of so many rows");
      return std::make_unique<MountKeeper>(T_base_lidar_told_);
    };
    mapping_.emplace(config_, std::make_unique<PassthroughSegmenter>(), std::nullopt, nullptr,
                     queue_, statistics_, latest_map_, helpers);
  }
  /// On /tf_static, of a lidar for which the network was opened as of an upright one.
  void tell_mount(double pitch_rad) {
    config_.frames.base = "base_link";
    config_.mount.source = MountConfig::Source::tf_static;
    config_.mount.wait_s = 60.0;
    config_.mapper.sensor = vlp_16();
    robot_.emplace(statistics_);
    T_base_lidar_published_ = Eigen::Translation3d(0.5, 0.0, 1.2) *
                              Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY());
    const Eigen::Isometry3d T_base_other(Eigen::Translation3d(0.0, 0.0, 1.0));
    ASSERT_TRUE(
        robot_->writer.write(wire::to_tf(0, {{"base_link", "lidar", T_base_lidar_published_},
                                             {"base_link", "other", T_base_other}})));
  }
  /// Sends so many scans and waits until they are worked off.
  void drive(int scans, const std::shared_ptr<const SensorModel>& sensor) {
    for (int k = 0; k < scans; ++k)
      queue_.push_dropping_oldest({scan(), "lidar", Clock::now(), sensor});
    ASSERT_TRUE(test::eventually([this] {
      const dds::ServerStatus now = status();
      return now.counter("scans_mapped") + now.dropped() >= static_cast<std::uint64_t>(next_);
    }));
    mapping_->publish_now();
  }
  [[nodiscard]] Scan scan() {
    Scan scan = test::room_scan(next_++);
    if (!are_labelled_) scan.labels.clear();
    return scan;
  }
  [[nodiscard]] dds::ServerStatus status() const { return report_.status(); }
  /// How far the last pose is from the true one.
  [[nodiscard]] double error_m() const {
    const Eigen::Isometry3d T_true =
        test::room_pose(0).T_map_lidar.inverse() * test::room_pose(next_ - 1).T_map_lidar;
    return (latest_map_.newest_pose().T_map_lidar.translation() - T_true.translation()).norm();
  }

  /// Tells on /tf_static where the lidar sits.
  struct Robot {
    explicit Robot(Statistics& statistics) : transforms(participant, topics, statistics) {}

    dds::Participant participant{dds::loopback(true)};
    // A participant does not hear itself.
    dds::Participant other{dds::loopback(true)};
    dds::Topics topics = dds::Topics::in("stillmap");
    dds::Writer<tf2_msgs::msg::TFMessage> writer{other, topics.tf_static.dds_name,
                                                 topics.tf_static.writer};
    StaticTransforms transforms;
  };

  ServerConfig config_;
  std::vector<std::string> opened_;
  bool fails_ = false;
  bool are_labelled_ = true;
  Eigen::Isometry3d T_base_lidar_published_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_base_lidar_opened_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_base_lidar_told_ = Eigen::Isometry3d::Identity();
  std::shared_ptr<const SensorModel> told_ = std::make_shared<const SensorModel>(vlp_16());
  ScanQueue queue_{30};
  Statistics statistics_;
  LatestMap latest_map_;
  std::optional<Robot> robot_;
  ServerReport report_{{.label_source = "stream", .points_topic = {}, .host_diagnostics = {}},
                       latest_map_,
                       statistics_,
                       [] { return std::vector<dds::Diagnostic>{}; },
                       [] { return std::string(); }};
  std::optional<MappingThread> mapping_;
  int next_ = 0;
};

TEST_F(ToldSensor, HasLabelsOpenedForItOnce) {
  start();
  EXPECT_EQ(status().sensor, "not known yet");
  drive(6, told_);
  EXPECT_EQ(status().sensor, "VLP-16");
  EXPECT_THAT(opened_, ElementsAre("VLP-16"));
  EXPECT_EQ(status().counter("scans_mapped"), 6U);
  EXPECT_LT(error_m(), 0.1);
  EXPECT_EQ(mapping_->checkpoint(CheckpointScope::everything).map.metadata.at("sensor"), "VLP-16");
}

TEST_F(ToldSensor, AsConfiguredChangesNothing) {
  config_.mapper.sensor = vlp_16();
  start();
  drive(4, told_);
  EXPECT_THAT(opened_, IsEmpty());
  EXPECT_EQ(status().sensor, "VLP-16");
}

TEST_F(ToldSensor, HasItsMountToldToWhatLabelsItsScans) {
  config_.frames.base = "base_link";
  config_.mount.T_base_lidar =
      Eigen::Translation3d(0.5, 0.0, 1.2) * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY());
  start();
  drive(2, told_);
  EXPECT_TRUE(T_base_lidar_opened_.isApprox(config_.mount.T_base_lidar));
  EXPECT_TRUE(T_base_lidar_told_.isApprox(config_.mount.T_base_lidar));
}

TEST_F(ToldSensor, HasLabelsOpenedForItWhereItsRobotTellsThatItSits) {
  tell_mount(0.3);
  start();
  drive(2, told_);
  EXPECT_THAT(opened_, ElementsAre("VLP-16"));
  EXPECT_TRUE(T_base_lidar_opened_.isApprox(T_base_lidar_published_, 1e-6));
}

TEST_F(ToldSensor, NamedHasLabelsOpenedOnceForHowItsRobotTellsThatItLeans) {
  config_.automatic_sensor.is_on = false;
  tell_mount(0.3);
  start();
  drive(4, nullptr);
  EXPECT_THAT(opened_, ElementsAre("VLP-16"));
  EXPECT_TRUE(T_base_lidar_opened_.isApprox(T_base_lidar_published_, 1e-6));
  EXPECT_EQ(status().counter("scans_mapped"), 4U);
}

TEST_F(ToldSensor, NamedAndUprightKeepsItsLabels) {
  config_.automatic_sensor.is_on = false;
  tell_mount(0.0);
  start();
  drive(2, nullptr);
  EXPECT_THAT(opened_, IsEmpty());
}

TEST_F(ToldSensor, LateGoesOnInTheMapWhereItIs) {
  start();
  drive(12, nullptr);
  const auto before = latest_map_.view();
  ASSERT_FALSE(before->tiles.empty());
  drive(12, told_);
  const auto after = latest_map_.view();
  EXPECT_EQ(after->map_id, before->map_id);
  EXPECT_GE(after->tiles.voxel_count(), before->tiles.voxel_count());
  EXPECT_LT(error_m(), 0.1);
  EXPECT_EQ(latest_map_.trajectory().size(), 24U);
  EXPECT_EQ(status().health, OdometryHealth::good);
}

TEST_F(ToldSensor, OfAnotherFrameDoesNotTakeTheMapOver) {
  config_.frames.lidar.clear();
  tell_mount(0.0);
  start();
  drive(3, told_);
  queue_.push_dropping_oldest(
      {scan(), "other", Clock::now(), std::make_shared<const SensorModel>(hdl_32e())});
  drive(2, told_);
  EXPECT_EQ(status().counter("scans_mapped"), 5U);
  EXPECT_EQ(status().dropped(), 1U);
  EXPECT_EQ(status().sensor, "VLP-16");
  EXPECT_THAT(opened_, IsEmpty());
}

TEST_F(ToldSensor, WithoutLabelsForItIsMappedWithoutAndSaysWhy) {
  fails_ = true;
  config_.labels.source = LabelProvider::model;
  start();
  drive(6, told_);
  EXPECT_EQ(status().counter("scans_mapped"), 6U);
  EXPECT_EQ(status().counter("label_failures"), 6U);
  EXPECT_THAT(status().reason, HasSubstr("VLP-16"));
  EXPECT_THAT(status().reason, HasSubstr("no images of so many rows"));
  EXPECT_LT(error_m(), 0.1);
}

TEST_F(ToldSensor, WithoutANetworkForItTakesTheLabelsOfItsScans) {
  fails_ = true;
  config_.labels.source = LabelProvider::automatic;
  start();
  drive(4, told_);
  EXPECT_EQ(status().counter("label_failures"), 0U);
  EXPECT_EQ(status().label_source, "stream, else none");
  are_labelled_ = false;
  drive(2, told_);
  EXPECT_EQ(status().counter("scans_mapped"), 6U);
  EXPECT_EQ(status().counter("label_failures"), 2U);
  EXPECT_THAT(status().reason, HasSubstr("no images of so many rows"));
}

TEST_F(ToldSensor, LiveDoesNotBeginBeforeScansThatWaitedForItsNetwork) {
  config_.input.delivery = DeliveryMode::latest;
  for (int k = 0; k < 3; ++k)
    queue_.push_dropping_oldest({test::room_scan(next_++), "lidar", Clock::now(), told_});
  start();
  drive(1, told_);
  EXPECT_EQ(status().counter("scans_mapped"), 3U);
  EXPECT_EQ(latest_map_.trajectory().front().stamp_ns, test::room_pose(1).stamp_ns);
}

}  // namespace
}  // namespace stillmap::server
