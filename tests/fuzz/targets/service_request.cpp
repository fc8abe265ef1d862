// A number that says which service, then the request as it comes over DDS, answered from a small
// map. Those that change it are answered from a fresh one.

#include <array>
#include <memory>
#include <stdexcept>

#include "idl/conversions/map_query.hpp"
#include "idl/conversions/occupancy_query.hpp"
#include "idl/conversions/path_query.hpp"
#include "idl/conversions/region.hpp"
#include "idl/conversions/traversability_query.hpp"
#include "idl/interface/topics.hpp"
#include "server/services/check_path.hpp"
#include "server/services/get_tile_versions.hpp"
#include "server/services/get_tiles.hpp"
#include "server/services/get_traversable_area.hpp"
#include "server/services/load_map.hpp"
#include "server/services/nearest_traversable.hpp"
#include "server/services/reset.hpp"
#include "server/services/save_map.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/cdr.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/service_fixture.hpp"

namespace stillmap::fuzz {
namespace {

using namespace stillmap_msgs::srv;

ServiceFixture& world() {
  static ServiceFixture world;
  return world;
}

/// Requests are answered, with a reason where the answer is not ok.
template <typename Request, typename Answer>
void answer_to(Bytes bytes, const Answer& answer) {
  const auto request = from_cdr<Request>(bytes);
  if (!request) return;
  const auto response = answer(*request);
  require(response.status().code() == 0 || !response.status().reason().empty(),
          "a refusal says why");
  static_cast<void>(to_cdr(response));
}

void static_map(Bytes bytes) {
  answer_to<GetStaticMap_Request>(bytes, [](const auto& r) { return world().static_map()(r); });
}
void tile_versions(Bytes bytes) {
  answer_to<GetTileVersions_Request>(
      bytes, [](const auto& r) { return get_tile_versions(world().context(), r); });
}
void tiles(Bytes bytes) {
  answer_to<GetTiles_Request>(bytes, [](const auto& r) { return get_tiles(world().context(), r); });
}
void area(Bytes bytes) {
  answer_to<GetTraversableArea_Request>(
      bytes, [](const auto& r) { return get_traversable_area(world().context(), r); });
}
void path(Bytes bytes) {
  answer_to<CheckPath_Request>(bytes,
                               [](const auto& r) { return check_path(world().context(), r); });
}
void nearest(Bytes bytes) {
  answer_to<NearestTraversable_Request>(
      bytes, [](const auto& r) { return nearest_traversable(world().context(), r); });
}
void removed(Bytes bytes) {
  answer_to<GetRemoved_Request>(
      bytes, [](const auto& r) { return get_removed(world().context(), world().removed(), r); });
}

/// Without the server's thread that keeps the octree.
void occupancy(Bytes bytes) {
  answer_to<QueryOccupancy_Request>(bytes, [](const auto& request) {
    return answer<QueryOccupancy_Response>(
        world().context(), request, [&](const MapSnapshot&, QueryOccupancy_Response& response) {
          wire::write_answers(world().octree().answer(wire::from_request(request)), response);
        });
  });
}

/// Those that change the world.
template <typename Request, typename Answer>
void change_by(Bytes bytes, const Answer& answer) {
  answer_to<Request>(bytes, answer);
  world().reset();
}

void restore(Bytes bytes) {
  change_by<RestoreRemoved_Request>(bytes, [](const auto& r) {
    return restore_removed(world().context(), world().removed(), r);
  });
}
void save(Bytes bytes) {
  change_by<SaveMap_Request>(bytes, [](const auto& r) { return save_map(world().context(), r); });
}
void load(Bytes bytes) {
  change_by<LoadMap_Request>(bytes, [](const auto& r) { return load_map(world().context(), r); });
}
void forget(Bytes bytes) {
  change_by<Reset_Request>(bytes,
                           [](const auto& r) { return server::reset(world().context(), r); });
}

constexpr std::array<void (*)(Bytes), 12> services = {static_map, tile_versions, tiles,   area,
                                                      path,       nearest,       removed, occupancy,
                                                      restore,    save,          load,    forget};

void run(Bytes bytes) {
  ByteSource source(bytes);
  const std::size_t service = source.byte() % services.size();
  services.at(service)(source.rest());
}

template <typename Request>
Request versioned() {
  Request request;
  request.format_version(dds::wire_format_version);
  return request;
}

std::vector<Region> regions() {
  const HeightRange heights{-1.0, 3.0};
  const std::vector<Eigen::Vector2d> square{{-2.0, -2.0}, {2.0, -2.0}, {2.0, 2.0}, {-2.0, 2.0}};
  return {BoxRegion{{Eigen::Vector3d(-3, -3, -1), Eigen::Vector3d(3, 3, 3)}},
          SphereRegion{Eigen::Vector3d::Zero(), 2.5}, PolygonRegion{square, heights},
          CorridorRegion{square, 0.5, heights}};
}

void add_region_seeds(std::vector<Seed>& all) {
  for (const Region& region : regions()) {
    MapQuery query;
    query.region = region;
    query.max_bytes = 500;
    query.resolution_m = all.size() % 4 == 1 ? 1.0 : 0.0;
    const std::string number = std::to_string(region.index());
    all.push_back({"static_map_" + number, with_choice(0, to_cdr(wire::to_request(query)))});
    TraversabilityQuery area_query;
    area_query.profile = "car";
    area_query.region = region;
    area_query.include_outlines = true;
    area_query.max_cells = 10'000;
    all.push_back({"area_" + number, with_choice(3, to_cdr(wire::to_request(area_query)))});
  }
}

void add_removed_seeds(std::vector<Seed>& all) {
  auto get = versioned<GetRemoved_Request>();
  get.region(wire::to_wire(regions().front()));
  get.reasons({0, 1});
  get.max_voxels(100);
  all.push_back({"removed", with_choice(6, to_cdr(get))});
  auto restore = versioned<RestoreRemoved_Request>();
  restore.region(wire::to_wire(regions().front()));
  restore.reason(1);
  all.push_back({"restore", with_choice(8, to_cdr(restore))});
}

void add_place_seeds(std::vector<Seed>& all) {
  auto versions = versioned<GetTileVersions_Request>();
  versions.max_x(5.0);
  versions.max_y(5.0);
  all.push_back({"tile_versions", with_choice(1, to_cdr(versions))});
  auto ids = versioned<GetTiles_Request>();
  ids.ids().resize(2);
  all.push_back({"tiles", with_choice(2, to_cdr(ids))});
  PathQuery path_query{"car", {{-1.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}}, {0.0, 0.0, 1.5}};
  all.push_back({"path_headings", with_choice(4, to_cdr(wire::to_request(path_query)))});
  path_query.headings_rad.clear();
  all.push_back({"path", with_choice(4, to_cdr(wire::to_request(path_query)))});
  auto near = versioned<NearestTraversable_Request>();
  near.profile("car");
  near.max_distance_m(10.0);
  all.push_back({"nearest", with_choice(5, to_cdr(near))});
}

OccupancyQuery occupancy_query() {
  OccupancyQuery query;
  query.points_map = {Eigen::Vector3d(0.1, 0.1, 0.1)};
  query.boxes_map = {{Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1)}};
  query.rays = {RayQuery{}};
  return query;
}

void add_file_seeds(std::vector<Seed>& all) {
  for (const char* name : {"", "other.stillmap", "map.stillmap", "../up"}) {
    auto save_request = versioned<SaveMap_Request>();
    save_request.file(name);
    const std::string number = std::to_string(all.size());
    all.push_back({"save_" + number, with_choice(9, to_cdr(save_request))});
    auto load_request = versioned<LoadMap_Request>();
    load_request.file(name);
    all.push_back({"load_" + number, with_choice(10, to_cdr(load_request))});
  }
}

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  add_region_seeds(all);
  add_place_seeds(all);
  add_removed_seeds(all);
  add_file_seeds(all);
  all.push_back({"occupancy", with_choice(7, to_cdr(wire::to_request(occupancy_query())))});
  all.push_back({"reset", with_choice(11, to_cdr(versioned<Reset_Request>()))});
  return all;
}

}  // namespace

const Target service_request_target{"service_request", run, seeds};

}  // namespace stillmap::fuzz
