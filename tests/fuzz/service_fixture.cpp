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

ServedWorld::ServedWorld()
    : map_(street_config()),
      saver_(board_, fresh_map_file(), {{"software", "0"}}),
      removed_{
          .removed = [this](const auto& box_map) { return map_.removed(box_map); },
          .restore = [this](RemovalReason reason,
                            const auto& box_map) { return map_.restore_removed(reason, box_map); }},
      context_{.board = board_,
               .tiles = tiles_,
               .saver = saver_,
               .status = [] { return ServerStatus{}; },
               .reset =
                   [this] {
                     map_.reset(78);
                     board_.begin(map_.view(), {});
                     return std::uint64_t{78};
                   },
               .load =
                   [this](const StoredMap& map, const auto&) {
                     map_.restore(map.view, map.memories);
                     board_.begin(map_.view(), map.trajectory);
                   },
               .show_now = [this] { board_.show(map_.view()); },
               .areas = atlas_,
               .planning_grid = grid_,
               .log = log_} {
  begin_again();
}

void ServedWorld::begin_again() {
  const StoredMap street = small_street();
  map_.restore(street.view, street.memories);
  board_.begin(map_.view(), street.trajectory);
  octree_ = OccupancyMap(OccupancyConfig{});
  octree_.insert(*board_.view());
  show_areas();
}

void ServedWorld::show_areas() {
  TraversabilityMap areas({robot()});
  static_cast<void>(areas.update(*board_.view()));
  areas_.show({areas.view("car")});
}

}  // namespace stillmap::fuzz
