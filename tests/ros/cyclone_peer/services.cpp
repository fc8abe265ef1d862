#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "tests/ros/cyclone_peer/commands.hpp"
#include "tests/ros/cyclone_peer/report.hpp"
#include "tests/ros/cyclone_peer/rmw_client.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::peer {
namespace {

using namespace std::chrono_literals;

constexpr auto discovery_timeout = 60s * test::slowdown;
constexpr std::uint8_t format_version = 8;

// C structures of idlc's want pointers that they could write through.
std::string no_text;
std::string car = "car";

using Region = stillmap_msgs_msg_dds__Region_;

Region everywhere() {
  Region region{};
  constexpr double far_m = 10'000.0;
  region.min_x = region.min_y = region.min_z = -far_m;
  region.max_x = region.max_y = region.max_z = far_m;
  return region;
}

/// Asks each service once and prints a line of what came.
class Questions {
 public:
  explicit Questions(const ServerAddress& address)
      : address_(address), participant_(address.domain_id) {}

  /// `add` puts what the reply says on the line. No answer at all is a line that says so.
  template <typename Request, typename Reply>
  void call(const std::string& service, const Request& request,
            const std::function<void(Line&, const Reply&)>& add) {
    RmwClient<Request, Reply> client(participant_, address_.server + "/" + service);
    const bool is_answered = client.wait_for_server(discovery_timeout) &&
                             client.call(
                                 request,
                                 [&](const Reply& reply) {
                                   Line line(service);
                                   if constexpr (requires { reply.status.code; }) {
                                     line.add("code", static_cast<int>(reply.status.code));
                                   }
                                   add(line, reply);
                                 },
                                 discovery_timeout);
    if (is_answered) return;
    Line(service).add("answered", false);
    has_all_ = false;
  }

  [[nodiscard]] bool has_all() const { return has_all_; }

 private:
  ServerAddress address_;
  Participant participant_;
  bool has_all_ = true;
};

void ask_for_status(Questions& questions) {
  using Reply = stillmap_msgs_srv_dds__GetStatus_Response_;
  stillmap_msgs_srv_dds__GetStatus_Request_ request{};
  request.format_version = format_version;
  questions.call<decltype(request), Reply>("get_status", request,
                                           [](Line& line, const Reply& reply) {
                                             line.add("version", reply.server.software_version)
                                                 .add("tiles", reply.server.tile_count)
                                                 .add("voxels", reply.server.voxel_count);
                                           });
  request.format_version = format_version + 1;
  questions.call<decltype(request), Reply>(
      "get_status", request,
      [](Line& line, const Reply& reply) { line.add("refused", reply.status.reason); });
}

void ask_for_map(Questions& questions) {
  using Request = stillmap_msgs_srv_dds__GetStaticMap_Request_;
  using Reply = stillmap_msgs_srv_dds__GetStaticMap_Response_;
  Request request{};
  request.format_version = format_version;
  request.region = everywhere();
  request.max_bytes = 100'000'000;
  request.continuation = no_text.data();
  const auto print = [](Line& line, const Reply& reply) {
    line.add("voxels", reply.voxels.x._length)
        .add("total", reply.total_voxels)
        .add("continues", reply.continuation[0] != '\0');
  };
  questions.call<Request, Reply>("get_static_map", request, print);
  std::array<std::uint8_t, 2> buildings_and_fences = {13, 14};
  lend(request.classes, buildings_and_fences);
  questions.call<Request, Reply>("get_static_map", request, [](Line& line, const Reply& reply) {
    const auto labels = elements(reply.voxels.label);
    line.add("voxels", labels.size()).add("other_classes", std::ranges::count_if(labels, [](int c) {
                                            return c != 13 && c != 14;
                                          }));
  });
  request.region.min_x = request.region.max_x + 1.0;
  questions.call<Request, Reply>("get_static_map", request, [](Line& line, const Reply& reply) {
    line.add("refused", reply.status.reason);
  });
}

void ask_for_tiles(Questions& questions) {
  using VersionsReply = stillmap_msgs_srv_dds__GetTileVersions_Response_;
  using TilesReply = stillmap_msgs_srv_dds__GetTiles_Response_;
  const Region region = everywhere();
  std::vector<stillmap_msgs_msg_dds__TileId_> ids;
  const stillmap_msgs_srv_dds__GetTileVersions_Request_ versions{.rmw_client = 0,
                                                                 .rmw_sequence = 0,
                                                                 .format_version = format_version,
                                                                 .min_x = region.min_x,
                                                                 .min_y = region.min_y,
                                                                 .max_x = region.max_x,
                                                                 .max_y = region.max_y,
                                                                 .continuation = no_text.data()};
  questions.call<stillmap_msgs_srv_dds__GetTileVersions_Request_, VersionsReply>(
      "get_tile_versions", versions, [&](Line& line, const VersionsReply& reply) {
        for (const auto& tile : elements(reply.tiles)) ids.push_back({tile.tile_x, tile.tile_y});
        line.add("tiles", ids.size()).add("tile_size_m", reply.identity.tile_size_m);
      });
  stillmap_msgs_srv_dds__GetTiles_Request_ tiles{};
  tiles.format_version = format_version;
  lend(tiles.ids, ids);
  questions.call<decltype(tiles), TilesReply>("get_tiles", tiles,
                                              [](Line& line, const TilesReply& reply) {
                                                line.add("tiles", reply.tiles._length)
                                                    .add("remaining", reply.remaining._length)
                                                    .add("missing", reply.missing._length);
                                              });
}

void ask_for_area(Questions& questions) {
  using AreaReply = stillmap_msgs_srv_dds__GetTraversableArea_Response_;
  stillmap_msgs_srv_dds__GetTraversableArea_Request_ area{};
  area.format_version = format_version;
  area.profile = car.data();
  area.region = everywhere();
  area.include_grid = area.include_outlines = true;
  questions.call<decltype(area), AreaReply>(
      "get_traversable_area", area, [](Line& line, const AreaReply& reply) {
        line.add("cells", reply.grid.width * reply.grid.height)
            .add("outlines", reply.outlines._length)
            .add("reason", reply.status.reason);
      });
  using NearestReply = stillmap_msgs_srv_dds__NearestTraversable_Response_;
  stillmap_msgs_srv_dds__NearestTraversable_Request_ nearest{};
  nearest.format_version = format_version;
  nearest.profile = car.data();
  nearest.max_distance_m = 30.0;
  double x = 0.0;
  double y = 0.0;
  questions.call<decltype(nearest), NearestReply>(
      "nearest_traversable", nearest, [&](Line& line, const NearestReply& reply) {
        x = reply.x;
        y = reply.y;
        line.add("distance_m", reply.distance_m).add("ground_z", reply.ground_z);
      });
  using PathReply = stillmap_msgs_srv_dds__CheckPath_Response_;
  std::array<double, 2> xs = {x, x + 1.0};
  std::array<double, 2> ys = {y, y};
  stillmap_msgs_srv_dds__CheckPath_Request_ path{};
  path.format_version = format_version;
  path.profile = car.data();
  lend(path.x, xs);
  lend(path.y, ys);
  questions.call<decltype(path), PathReply>(
      "check_path", path, [](Line& line, const PathReply& reply) {
        line.add("is_free", reply.is_free).add("checked_m", reply.checked_m);
      });
}

void ask_for_occupancy(Questions& questions) {
  using Reply = stillmap_msgs_srv_dds__QueryOccupancy_Response_;
  std::array<stillmap_msgs_msg_dds__OccupancyRay_, 1> rays{};
  rays[0].direction = {0.0, 0.0, -1.0};
  rays[0].max_range_m = 10.0;
  rays[0].ignore_unknown = true;
  stillmap_msgs_srv_dds__QueryOccupancy_Request_ request{};
  request.format_version = format_version;
  lend(request.rays, rays);
  questions.call<decltype(request), Reply>("query_occupancy", request,
                                           [](Line& line, const Reply& reply) {
                                             const auto found = elements(reply.rays);
                                             line.add("rays", found.size());
                                             if (!found.empty())
                                               line.add("length_m", found[0].length_m);
                                           });
  using OctomapReply = octomap_msgs_srv_dds__GetOctomap_Response_;
  const octomap_msgs_srv_dds__GetOctomap_Request_ nothing{};
  for (const std::string& service : {std::string("octomap_binary"), std::string("octomap_full")}) {
    questions.call<octomap_msgs_srv_dds__GetOctomap_Request_, OctomapReply>(
        service, nothing, [](Line& line, const OctomapReply& reply) {
          line.add("id", reply.map.id).add("bytes", reply.map.data._length);
        });
  }
}

void ask_for_rest(Questions& questions) {
  using MapReply = nav_msgs_srv_dds__GetMap_Response_;
  questions.call<nav_msgs_srv_dds__GetMap_Request_, MapReply>(
      "get_map", {}, [](Line& line, const MapReply& reply) {
        line.add("cells", reply.map.data._length).add("resolution_m", reply.map.info.resolution);
      });
  using RemovedReply = stillmap_msgs_srv_dds__GetRemoved_Response_;
  stillmap_msgs_srv_dds__GetRemoved_Request_ removed{};
  removed.format_version = format_version;
  removed.region = everywhere();
  removed.max_voxels = 1000;
  questions.call<decltype(removed), RemovedReply>(
      "get_removed", removed,
      [](Line& line, const RemovedReply& reply) { line.add("total", reply.total); });
  using SaveReply = stillmap_msgs_srv_dds__SaveMap_Response_;
  stillmap_msgs_srv_dds__SaveMap_Request_ save{};
  save.format_version = format_version;
  save.file = no_text.data();
  questions.call<decltype(save), SaveReply>(
      "save_map", save, [](Line& line, const SaveReply& reply) { line.add("file", reply.file); });
}

}  // namespace

int ask_services(const ServerAddress& address) {
  Questions questions(address);
  ask_for_status(questions);
  ask_for_map(questions);
  ask_for_tiles(questions);
  ask_for_area(questions);
  ask_for_occupancy(questions);
  ask_for_rest(questions);
  return questions.has_all() ? 0 : 1;
}

}  // namespace stillmap::peer
