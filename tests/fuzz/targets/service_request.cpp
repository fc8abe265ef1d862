// A number that says which service of the table, then the request as it comes over DDS, answered
// from a small map.

#include <array>
#include <memory>
#include <stdexcept>

#include "idl/conversions/localization.hpp"
#include "idl/conversions/map_query.hpp"
#include "idl/conversions/occupancy.hpp"
#include "idl/conversions/path_query.hpp"
#include "idl/conversions/region.hpp"
#include "idl/conversions/traversability.hpp"
#include "idl/interface/topics.hpp"
#include "server/services/service_handlers.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/cdr.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/service_fixture.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace service_request_inputs {
namespace {

using namespace stillmap_msgs::srv;

ServiceFixture& world() {
  static ServiceFixture world;
  return world;
}

/// A request is answered, with a reason where the answer is not ok. Those that change the world are
/// answered by a fresh one.
template <typename Request, typename Reply>
void answer_to(const server::ServiceHandler<Request, Reply>& handler, Bytes bytes) {
  const auto request = from_cdr<Request>(bytes);
  if (!request) return;
  const Reply reply = handler.answer(world().context(), *request);
  if constexpr (requires { reply.status().code(); }) {
    require(reply.status().code() == 0 || !reply.status().reason().empty(), "a refusal says why");
  }
  static_cast<void>(to_cdr(reply));
  if (handler.spec.effect == dds::ServiceEffect::modifies) world().reset();
}

constexpr std::size_t service_count = std::tuple_size_v<decltype(server::service_handlers)>;

/// The service's place in the table of handlers: an input's first byte.
std::uint8_t number_of(std::string_view service) {
  std::uint8_t number = 0;
  std::uint8_t found = service_count;
  server::for_each_handler([&](const auto& handler) {
    if (handler.spec.name == service) found = number;
    ++number;
  });
  require(found < service_count, "a seed is for a service of the table");
  return found;
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const std::size_t chosen = source.byte() % service_count;
  const Bytes request = source.rest();
  std::size_t number = 0;
  server::for_each_handler([&](const auto& handler) {
    if (number++ == chosen) answer_to(handler, request);
  });
}

/// An input of this target.
template <typename Request, typename Reply>
Seed seed(const std::string& name, const dds::ServiceSpec<Request, Reply>& service,
          const Request& request) {
  return {name, with_choice(number_of(service.name), to_cdr(request))};
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
    all.push_back(
        seed("static_map_" + number, dds::services::get_static_map, wire::to_request(query)));
    TraversabilityQuery area_query;
    area_query.profile = "car";
    area_query.region = region;
    area_query.include_outlines = true;
    area_query.max_cells = 10'000;
    all.push_back(
        seed("area_" + number, dds::services::get_traversable_area, wire::to_request(area_query)));
  }
}

void add_removed_seeds(std::vector<Seed>& all) {
  auto get = versioned<GetRemoved_Request>();
  get.region(wire::to_wire(regions().front()));
  get.reasons({0, 1});
  get.max_voxels(100);
  all.push_back(seed("removed", dds::services::get_removed, get));
  auto restore = versioned<RestoreRemoved_Request>();
  restore.region(wire::to_wire(regions().front()));
  restore.reason(1);
  all.push_back(seed("restore", dds::services::restore_removed, restore));
}

void add_place_seeds(std::vector<Seed>& all) {
  auto versions = versioned<GetTileVersions_Request>();
  versions.max_x(5.0);
  versions.max_y(5.0);
  all.push_back(seed("tile_versions", dds::services::get_tile_versions, versions));
  auto ids = versioned<GetTiles_Request>();
  ids.ids().resize(2);
  all.push_back(seed("tiles", dds::services::get_tiles, ids));
  PathQuery path_query{"car", {{-1.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}}, {0.0, 0.0, 1.5}};
  all.push_back(seed("path_headings", dds::services::check_path, wire::to_request(path_query)));
  path_query.headings_rad.clear();
  all.push_back(seed("path", dds::services::check_path, wire::to_request(path_query)));
  auto near = versioned<NearestTraversable_Request>();
  near.profile("car");
  near.max_distance_m(10.0);
  all.push_back(seed("nearest", dds::services::nearest_traversable, near));
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
    all.push_back(seed("save_" + number, dds::services::save_map, save_request));
    auto load_request = versioned<LoadMap_Request>();
    load_request.file(name);
    all.push_back(seed("load_" + number, dds::services::load_map, load_request));
  }
}

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  add_region_seeds(all);
  add_place_seeds(all);
  add_removed_seeds(all);
  add_file_seeds(all);
  all.push_back(
      seed("occupancy", dds::services::query_occupancy, wire::to_request(occupancy_query())));
  all.push_back(seed("status", dds::services::get_status, versioned<GetStatus_Request>()));
  all.push_back(seed("octomap", dds::services::octomap_binary, {}));
  all.push_back(seed("map", dds::services::get_map, {}));
  const LocalizationQuestion question{
      .guess = PlaceGuess{.T_map_base = Eigen::Isometry3d::Identity(), .radius_m = 20.0}};
  all.push_back(seed("localize", dds::services::localize, wire::to_request(question)));
  all.push_back(seed("reset", dds::services::reset, versioned<Reset_Request>()));
  return all;
}

}  // namespace
}  // namespace service_request_inputs

const Target service_request_target{"service_request", service_request_inputs::run,
                                    service_request_inputs::seeds};

}  // namespace stillmap::fuzz
