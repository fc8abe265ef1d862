#include "tests/fuzz/service_fixture.hpp"

#include "core/traversability/traversability_map.hpp"
#include "tests/fuzz/memory_folder.hpp"
#include "tests/fuzz/street_map.hpp"

namespace stillmap::fuzz {
namespace {

std::filesystem::path map_file() {
  return MemoryFolder::of_this_process().path("served/map.stillmap");
}

std::filesystem::path fresh_map_file() {
  std::filesystem::remove_all(map_file().parent_path());
  std::filesystem::create_directories(map_file().parent_path());
  return map_file();
}

RobotProfile robot() {
  RobotProfile robot;
  robot.name = "car";
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::road)) = 0.1;
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::unlabeled)) = 0.3;
  return robot;
}

}  // namespace

ServiceFixture::ServiceFixture()
    : map_(street_config()),
      saver_(latest_map_, statistics_, fresh_map_file(), {{"software", "0"}}),
      context_{
          .latest_map = latest_map_,
          .tiles = tiles_,
          .saver = saver_,
          .status = [] { return dds::ServerStatus{}; },
          .begin_map =
              [this](std::uint64_t map_id, const auto&) {
                map_.reset(map_id);
                latest_map_.begin(map_.view(), {});
              },
          .prepare_map =
              [this](const SavedMap& map, const auto&) {
                StaticMap resumed(street_config());
                resumed.resume(map.view, map.tile_evidence);
                return [this, map] {
                  map_.resume(map.view, map.tile_evidence);
                  latest_map_.begin(map_.view(), map.trajectory);
                };
              },
          .publish_now = [this] { latest_map_.publish(map_.view()); },
          .removed =
              [this](const auto& box_map) {
                return server::RemovedInBox{
                    map_.removed(box_map, map_.tiles_in(box_map)).voxels, {}, nullptr};
              },
          .restore_removed =
              [this](RemovalReason reason, const auto& box_map) {
                return map_.restore_removed(reason, box_map, map_.tiles_in(box_map)).count;
              },
          .localize =
              [](const LocalizationQuestion& question) {
                return LocalizationAnswer{.outcome = LocalizationStatus::found,
                                          .applied = question.apply};
              },
          .query_occupancy = [this](const OccupancyQuery& query) { return octree_.answer(query); },
          .encode_octomap =
              [this](OctomapEncoding encoding) {
                return server::EncodedOctree{.data = octree_.encode(encoding), .stamp_ns = 0};
              },
          .traversability = traversability_cache_,
          .grid_provider = grid_provider_,
          .map_frame = "map",
          .log = log_} {
  saver_.set_source(source_);
  reset();
}

void ServiceFixture::reset() {
  const SavedMap street = small_street();
  map_.resume(street.view, street.tile_evidence);
  latest_map_.begin(map_.view(), street.trajectory);
  octree_ = OccupancyMap(OccupancyConfig{});
  octree_.insert(*latest_map_.view());
  publish_traversability();
}

void ServiceFixture::publish_traversability() {
  TraversabilityMap areas({robot()});
  static_cast<void>(areas.update(*latest_map_.view()));
  snapshot_.publish({areas.view("car")}, {nullptr, {{-10'000, -10'000}, {10'000, 10'000}}});
}

}  // namespace stillmap::fuzz
