#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "tests/ros/cyclone_peer/commands.hpp"
#include "tests/ros/cyclone_peer/endpoints.hpp"
#include "tests/ros/cyclone_peer/report.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::peer {
namespace {

using namespace std::chrono_literals;
using Cloud = sensor_msgs_msg_dds__PointCloud2_;
using Path = nav_msgs_msg_dds__Path_;
using Grid = nav_msgs_msg_dds__OccupancyGrid_;
using Octomap = octomap_msgs_msg_dds__Octomap_;
using Status = stillmap_msgs_msg_dds__Status_;
using TileInfo = stillmap_msgs_msg_dds__TileInfo_;
using MapTile = stillmap_msgs_msg_dds__MapTile_;

constexpr auto discovery_timeout = 60s * test::slowdown;
constexpr Qos latched{.transient_local = true, .depth = 1};

void print(const std::string& topic, const Cloud& cloud) {
  std::string fields;
  for (const auto& field : elements(cloud.fields)) {
    if (!fields.empty()) fields += ',';
    fields += field.name;
  }
  Line(topic)
      .add("frame_id", cloud.header.frame_id)
      .add("points", cloud.width * cloud.height)
      .add("fields", fields)
      .add("point_step", cloud.point_step)
      .add("is_dense", cloud.is_dense);
}

void print(const std::string& topic, const Path& path) {
  Line(topic).add("frame_id", path.header.frame_id).add("poses", path.poses._length);
}

void print(const std::string& topic, const Grid& grid) {
  const auto cells = elements(grid.data);
  const auto count = [&](auto is_it) {
    return std::ranges::count_if(
        cells, [&](std::uint8_t cell) { return is_it(static_cast<std::int8_t>(cell)); });
  };
  Line(topic)
      .add("frame_id", grid.header.frame_id)
      .add("cells", std::to_string(grid.info.width) + "x" + std::to_string(grid.info.height))
      .add("resolution_m", grid.info.resolution)
      .add("unknown", count([](int cell) { return cell == -1; }))
      .add("free", count([](int cell) { return cell >= 0 && cell < 99; }))
      .add("occupied", count([](int cell) { return cell >= 99; }))
      .add("wrong", count([](int cell) { return cell < -1 || cell > 100; }));
}

void print(const std::string& topic, const Octomap& octomap) {
  Line(topic)
      .add("frame_id", octomap.header.frame_id)
      .add("id", octomap.id)
      .add("binary", octomap.binary)
      .add("resolution_m", octomap.resolution)
      .add("bytes", octomap.data._length);
}

void print(const std::string& topic, const Status& status) {
  Line(topic)
      .add("version", status.software_version)
      .add("health", static_cast<int>(status.health))
      .add("tiles", status.tile_count)
      .add("voxels", status.voxel_count)
      .add("counters", status.counters._length)
      .add("latencies", status.latencies._length);
}

/// Takes a latched topic until its first sample, and prints that.
template <typename T>
bool print_latched(const Participant& participant, const std::string& topic) {
  Reader<T> reader(participant, topic, latched);
  bool has_come = false;
  const auto take = [&] {
    reader.take([&](const T& sample) {
      if (!std::exchange(has_come, true)) print(topic, sample);
    });
    return has_come;
  };
  if (wait_until(take, discovery_timeout)) return true;
  Line(topic).add("samples", 0);
  return false;
}

using TileKey = std::pair<std::int32_t, std::int32_t>;

/// Takes a keyed topic until nothing new has come for a while; voxels by tile.
template <typename T>
std::map<TileKey, std::uint64_t> take_tiles(
    const Participant& participant, const std::string& topic,
    const std::function<std::uint64_t(const T&)>& voxels_of) {
  Reader<T> reader(participant, topic, latched);
  std::map<TileKey, std::uint64_t> voxels;
  auto last_news = std::chrono::steady_clock::now();
  const auto take = [&] {
    reader.take([&](const T& sample) {
      voxels[{sample.tile_x, sample.tile_y}] = voxels_of(sample);
      last_news = std::chrono::steady_clock::now();
    });
    return !voxels.empty() && std::chrono::steady_clock::now() - last_news > 1s * test::slowdown;
  };
  static_cast<void>(wait_until(take, discovery_timeout));
  const auto sum = [](std::uint64_t total, const auto& tile) { return total + tile.second; };
  Line(topic)
      .add("keys", voxels.size())
      .add("voxels", std::accumulate(voxels.begin(), voxels.end(), std::uint64_t{0}, sum));
  return voxels;
}

}  // namespace

int join_late(const ServerAddress& address) {
  const Participant participant(address.domain_id);
  const std::string prefix = "rt/" + address.server + "/";
  bool has_all = print_latched<Path>(participant, prefix + "path");
  has_all &= print_latched<Cloud>(participant, prefix + "static_cloud");
  has_all &= print_latched<Grid>(participant, prefix + "traversability");
  has_all &= print_latched<Octomap>(participant, prefix + "octomap");
  has_all &= print_latched<Status>(participant, prefix + "status");
  const auto index = take_tiles<TileInfo>(
      participant, prefix + "tile_index",
      [](const TileInfo& tile) -> std::uint64_t { return tile.state.voxel_count; });
  const auto tiles = take_tiles<MapTile>(
      participant, prefix + "tiles",
      [](const MapTile& tile) -> std::uint64_t { return tile.voxels.x._length; });
  Line("tiles").add("are_those_of_index", tiles == index);
  return has_all && !tiles.empty() ? 0 : 1;
}

}  // namespace stillmap::peer
