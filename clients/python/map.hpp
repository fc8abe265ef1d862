#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "clients/python/arrays.hpp"
#include "core/lidar/trajectory.hpp"
#include "core/map/query/map_query.hpp"
#include "core/map/static_map.hpp"
#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"

namespace stillmap::python {

/// A state of a map, of a file, a mapper or a server, that does not change.
struct Map {
  std::shared_ptr<const MapSnapshot> view;
  Trajectory trajectory;
  std::map<std::string, std::string> metadata;
  /// Reads what is kept out of the view, when it is asked for; empty where nobody knows.
  std::function<TileEvidenceMap()> read_evidence;
};

/// An answer of a server or of a map. Raises ValueError for a query that was refused, with its
/// reason.
[[nodiscard]] py::object query_answer(MapQueryResult result);

[[nodiscard]] py::object removed_arrays(const std::vector<RemovedVoxel>& removed);

/// Classes by name; none are all. Throws std::invalid_argument for one that does not exist.
[[nodiscard]] std::bitset<semantic_class_count> classes_from(const std::vector<std::string>& names);

}  // namespace stillmap::python
