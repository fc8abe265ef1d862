#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "idl/conversions/status.hpp"
#include "idl/conversions/tile.hpp"

namespace stillmap::wire {
namespace {

Tile some_tile() {
  Tile tile;
  tile.info = {.id = {-3, 7},
               .revision = 12,
               .content_hash = 0xFEDCBA9876543210,
               .bounds_map = {Eigen::Vector3f(-60, 140, -1), Eigen::Vector3f(-41, 159, 5)},
               .voxel_count = 2};
  std::vector<Voxel> voxels;
  for (std::uint16_t i = 0; i < 2; ++i) {
    Voxel voxel;
    voxel.index = {i, static_cast<std::uint16_t>(i + 1), static_cast<std::int16_t>(-i)};
    voxel.point_count = 5U + i;
    voxel.mean_map = {-59.9F + 0.2F * static_cast<float>(i), 140.3F + 0.2F * static_cast<float>(i),
                      0.15F - 0.2F * static_cast<float>(i)};
    for (int vote = 0; vote < 3; ++vote) voxel.evidence.add(SemanticClass::building, 1.0F);
    voxel.evidence.add(SemanticClass::fence, 1.0F);
    voxels.push_back(voxel);
  }
  tile.voxels = PackedVoxels(tile.info.id, {0.2, 20.0}, voxels);
  return tile;
}

constexpr dds::MapIdentity identity{
    .version = 42, .map_id = 99, .tile_size_m = 20.0, .voxel_size_m = 0.2};

TEST(TileConversion, KeepsEverythingButTheLosersOfTheVote) {
  const Tile tile = some_tile();
  const auto message = to_wire(tile, identity);
  EXPECT_EQ(from_wire(message.identity()).version, 42U);
  EXPECT_EQ(from_wire(message.identity()).map_id, 99U);
  const auto back = from_wire(message);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->info.id, tile.info.id);
  EXPECT_EQ(back->info.revision, tile.info.revision);
  EXPECT_EQ(back->info.content_hash, tile.info.content_hash);
  EXPECT_EQ(back->info.bounds_map.min(), tile.info.bounds_map.min());
  EXPECT_EQ(back->info.bounds_map.max(), tile.info.bounds_map.max());
  ASSERT_EQ(back->voxels.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(back->voxels[i].index, tile.voxels[i].index);
    EXPECT_EQ(back->voxels[i].mean_map, tile.voxels[i].mean_map);
    EXPECT_EQ(back->voxels[i].point_count, tile.voxels[i].point_count);
    EXPECT_EQ(back->voxels[i].evidence.winner(), SemanticClass::building);
    EXPECT_EQ(back->voxels[i].evidence.votes()[0].weight, 0.75F);
  }
}

TEST(TileConversion, RefusesWhatItDoesNotUnderstand) {
  const auto message = to_wire(some_tile(), identity);
  auto other_version = message;
  other_version.format_version(99);
  EXPECT_FALSE(from_wire(other_version));
  auto short_array = message;
  short_array.voxels().confidence().pop_back();
  EXPECT_FALSE(from_wire(short_array));
  auto short_index = message;
  short_index.index_z().pop_back();
  EXPECT_FALSE(from_wire(short_index));
  auto no_class = message;
  no_class.voxels().label()[0] = 20;
  EXPECT_FALSE(from_wire(no_class));
  auto no_place = message;
  no_place.voxels().z()[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(from_wire(no_place));
  auto no_column = message;
  no_column.index_x()[1] = 60'000;
  EXPECT_FALSE(from_wire(no_column));
  auto no_size = message;
  no_size.identity().voxel_size_m(0.0);
  EXPECT_FALSE(from_wire(no_size));
}

dds::ServerStatus some_status() {
  return {.stamp_ns = 5'000'000'001,
          .software_version = "1.2.3",
          .uptime_s = 4.5,
          .delivery = DeliveryMode::every,
          .label_source = "stream",
          .health = OdometryHealth::degenerate,
          .reason = "why",
          .received_hz = 10.0,
          .mapped_hz = 9.0,
          .map_version = 3,
          .map_id = 4,
          .tile_count = 5,
          .voxel_count = 6,
          .segmentation = {.interval = 3,
                           .inference_ms = 210.0,
                           .image_columns = 1024,
                           .full_columns = 1536,
                           .fresh_share = 0.25,
                           .propagated_share = 0.5,
                           .unlabelled_share = 0.125},
          .counters = {{"scans_received", "", 8}, {"scans_dropped", "empty", 2}},
          .service_faults = {{"slow_client", "stillmap/get_tiles", 3}},
          .latencies = {{"odometry", 1.0, 2.0, 3.0, 4}},
          .host = "robot",
          .sensor = "vlp_16",
          .points_topic = "lidar/points",
          .scan_frame = "velodyne",
          .scan_delay_s = 0.25,
          .diagnostics = {{dds::Severity::advice, "what", "evidence", "way out"},
                          {dds::Severity::problem, "worse", "", ""}}};
}

TEST(StatusConversion, KeepsWhatTheServerIsAndDoes) {
  const dds::ServerStatus status = some_status();
  const auto back = from_wire(to_wire(status));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->stamp_ns, status.stamp_ns);
  EXPECT_EQ(back->software_version, "1.2.3");
  EXPECT_EQ(back->delivery, DeliveryMode::every);
  EXPECT_EQ(back->label_source, "stream");
  EXPECT_EQ(back->health, OdometryHealth::degenerate);
  EXPECT_EQ(back->reason, "why");
  EXPECT_EQ(back->host, "robot");
  EXPECT_EQ(back->sensor, "vlp_16");
  EXPECT_EQ(back->points_topic, "lidar/points");
  EXPECT_EQ(back->scan_frame, "velodyne");
  EXPECT_EQ(back->scan_delay_s, 0.25);
  EXPECT_EQ(back->segmentation.interval, 3U);
  EXPECT_EQ(back->segmentation.inference_ms, 210.0);
  EXPECT_EQ(back->segmentation.image_columns, 1024U);
  EXPECT_EQ(back->segmentation.full_columns, 1536U);
  EXPECT_EQ(back->segmentation.fresh_share, 0.25);
  EXPECT_EQ(back->segmentation.propagated_share, 0.5);
  EXPECT_EQ(back->segmentation.unlabelled_share, 0.125);
  EXPECT_EQ(back->mapped_hz, 9.0);
  EXPECT_EQ(back->voxel_count, 6U);
}

TEST(StatusConversion, KeepsDiagnosticsCountersAndLatencies) {
  const auto back = from_wire(to_wire(some_status()));
  ASSERT_TRUE(back);
  ASSERT_EQ(back->diagnostics.size(), 2U);
  EXPECT_EQ(back->diagnostics[0].severity, dds::Severity::advice);
  EXPECT_EQ(back->diagnostics[0].what, "what");
  EXPECT_EQ(back->diagnostics[0].evidence, "evidence");
  EXPECT_EQ(back->diagnostics[0].hint, "way out");
  EXPECT_EQ(back->diagnostics[1].severity, dds::Severity::problem);
  EXPECT_EQ(back->counter("scans_received"), 8U);
  EXPECT_EQ(back->dropped("empty"), 2U);
  EXPECT_EQ(back->dropped("queue_full"), 0U);
  EXPECT_EQ(back->counter("slow_client", "stillmap/get_tiles"), 3U);
  EXPECT_EQ(back->counter("never_happened"), 0U);
  EXPECT_EQ(back->dropped(), 2U);
  ASSERT_EQ(back->latencies.size(), 1U);
  EXPECT_EQ(back->latencies[0].stage, "odometry");
  EXPECT_EQ(back->latencies[0].p99_ms, 2.0);
}

TEST(StatusConversion, RefusesNumbersThatStandForNothing) {
  auto message = to_wire(dds::ServerStatus{});
  message.health(17);
  EXPECT_FALSE(from_wire(message));
  message = to_wire(dds::ServerStatus{});
  message.delivery(2);
  EXPECT_FALSE(from_wire(message));
}

}  // namespace
}  // namespace stillmap::wire
