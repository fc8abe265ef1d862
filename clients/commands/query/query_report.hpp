#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "clients/commands/stage_stopwatch.hpp"
#include "core/map/query/map_query.hpp"

namespace stillmap::cli {

/// What became of a query of the command line.
struct QueryAnswer {
  MapQuery query;
  MapQueryResult result;
  /// Of every time it was asked, all pages together.
  StageDurations times;
};

[[nodiscard]] nlohmann::json to_json(const QueryAnswer& answer);
/// The same for people, shorter.
[[nodiscard]] std::string describe(const QueryAnswer& answer);

/// "appeared", "changed", "removed".
[[nodiscard]] const char* name(TileChangeKind kind);

}  // namespace stillmap::cli
