#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/mapping/scan_receiver.hpp"

namespace stillmap::server {
namespace {

using ::testing::ElementsAre;

/// Two lidars in one place, of which the rear one measures from 2.5 m to 30 m.
ServerConfig front_and_rear() {
  ServerConfig config;
  config.lidars = {{.name = "front", .sensor = vlp_16(), .topic = "front/points", .frame = ""},
                   {.name = "rear", .sensor = vlp_16(), .topic = "rear/points", .frame = ""}};
  config.lidars[1].sensor.min_range_m = 2.5;
  config.lidars[1].sensor.max_range_m = 30.0;
  config.mapper.sensor = merged_sensor(
      std::vector<PlacedSensor>{{config.lidars[0].sensor}, {config.lidars[1].sensor}});
  config.mapper.prepare.min_range_m = config.mapper.sensor.min_range_m;
  config.mapper.prepare.max_range_m = config.mapper.sensor.max_range_m;
  return config;
}

Scan points_ahead(const std::vector<float>& xs) {
  Scan scan;
  scan.stamp_ns = 1'000'000'000;
  for (const float x : xs) scan.points_lidar.emplace_back(x, 0.0F, 0.0F);
  return scan;
}

/// What is left of points of both lidars that are 1, 10 and 50 m ahead, the front one's first.
std::vector<float> left_of_sweep(const ServerConfig& config) {
  ScanQueue queue(3);
  Statistics statistics;
  SweepInput sweeps(config, queue, statistics);
  sweeps.add(0, points_ahead({1.0F, 10.0F, 50.0F}), {});
  sweeps.add(1, points_ahead({1.0F, 10.0F, 50.0F}), {});
  std::vector<float> xs;
  if (const auto queued = queue.try_pop())
    for (const Eigen::Vector3f& point : queued->scan.points_lidar) xs.push_back(point.x());
  return xs;
}

TEST(SweepInput, CutsEachLidarToItsOwnRanges) {
  EXPECT_THAT(left_of_sweep(front_and_rear()), ElementsAre(1.0F, 10.0F, 50.0F, 10.0F));
}

TEST(SweepInput, CutsAllToTheRangesOfTheConfiguration) {
  ServerConfig config = front_and_rear();
  config.automatic_sensor.sets_min_range = false;
  config.mapper.prepare.min_range_m = 0.9;
  EXPECT_THAT(left_of_sweep(config), ElementsAre(1.0F, 10.0F, 50.0F, 1.0F, 10.0F));
}

/// Labels of a sweep for which the front lidar alone sends some.
std::vector<SemanticClass> labels_of_sweep(LabelProvider source, Statistics& statistics) {
  ServerConfig config = front_and_rear();
  config.labels.source = source;
  ScanQueue queue(3);
  SweepInput sweeps(config, queue, statistics);
  Scan front = points_ahead({10.0F});
  front.labels = {SemanticClass::car};
  sweeps.add(0, std::move(front), {});
  sweeps.add(1, points_ahead({10.0F}), {});
  const auto queued = queue.try_pop();
  return queued ? queued->scan.labels : std::vector{SemanticClass::pole};
}

TEST(SweepInput, LeavesSweepsThatAreLabelledInPartToTheNetworkWhereThereIsOne) {
  Statistics statistics;
  EXPECT_THAT(labels_of_sweep(LabelProvider::automatic, statistics), testing::IsEmpty());
  EXPECT_THAT(labels_of_sweep(LabelProvider::stream, statistics),
              ElementsAre(SemanticClass::car, SemanticClass::unlabeled));
  dds::ServerStatus status;
  statistics.report_to(status);
  EXPECT_EQ(status.counter("sweeps_partly_labelled"), 2U);
}

}  // namespace
}  // namespace stillmap::server
