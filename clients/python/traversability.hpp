#pragma once

#include <memory>
#include <string>

#include "clients/python/arrays.hpp"
#include "core/map/tile.hpp"
#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_query.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap::python {

/// Where a robot can go; does not change.
struct Traversability {
  std::shared_ptr<const TraversabilityView> view;
};

/// Throws ConfigError for a robot that does not exist.
[[nodiscard]] Traversability traversability_of(const MapSnapshot& view, const std::string& robot);

// What Python gets of an answer. A refusal is a ValueError, nothing found a LookupError, with the
// reason.
[[nodiscard]] py::object grid_of(const TraversabilityAnswer& answer);
[[nodiscard]] py::object nearest_of(const NearestTraversable& nearest);
[[nodiscard]] py::object check_of(const PathCheck& check);

[[nodiscard]] PathQuery path_query_from(const InArray<double>& positions_map,
                                        const std::optional<InArray<double>>& headings_rad);

}  // namespace stillmap::python
