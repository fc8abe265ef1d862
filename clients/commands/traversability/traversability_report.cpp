#include "clients/commands/traversability/traversability_report.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

double square_metres(const TraversabilityView& view, std::uint64_t cells) {
  return static_cast<double>(cells) * view.cell_m * view.cell_m;
}

double ms_per_tile(const TraversabilityReport& report) {
  return report.milliseconds / static_cast<double>(std::max<std::size_t>(1, report.work->surfaces));
}

}  // namespace

nlohmann::json to_json(const TraversabilityView& view, const TraversabilityReport& report) {
  nlohmann::json lethal = nlohmann::json::object();
  for (std::size_t i = 0; i < block_reason_count; ++i) {
    const auto reason = static_cast<BlockReason>(i);
    if (reason == BlockReason::none || reason == BlockReason::unknown) continue;
    lethal[std::string(name(reason))] = square_metres(view, report.summary.lethal.at(i));
  }
  nlohmann::json json = {{"profile", view.profile.name},
                         {"map_id", view.map_id},
                         {"map_version", view.version},
                         {"cell_m", view.cell_m},
                         {"free_m2", square_metres(view, report.summary.free)},
                         {"inferred_m2", square_metres(view, report.summary.inferred)},
                         {"unknown_m2", square_metres(view, report.summary.unknown)},
                         {"lethal_m2", lethal},
                         {"ms", report.milliseconds}};
  if (report.work) {
    json["tiles"] = report.work->map_tiles;
    json["ms_per_tile"] = ms_per_tile(report);
  }
  return json;
}

std::string describe(const TraversabilityView& view, const TraversabilityReport& report) {
  const auto area = [&](std::uint64_t cells) { return fixed(square_metres(view, cells), 0); };
  Table table({"area for " + view.profile.name, "m2"});
  table.add({"free", area(report.summary.free)});
  table.add({"  of it inferred", area(report.summary.inferred)});
  for (std::size_t i = 0; i < block_reason_count; ++i) {
    if (report.summary.lethal.at(i) == 0) continue;
    table.add({"lethal: " + std::string(name(static_cast<BlockReason>(i))),
               area(report.summary.lethal.at(i))});
  }
  table.add({"unknown", area(report.summary.unknown)});
  std::string work;
  if (report.work) {
    work.append(" (").append(std::to_string(report.work->map_tiles)).append(" tiles, ");
    work.append(fixed(ms_per_tile(report), 1)).append(" ms each)");
  }
  return table.text() + "map version " + std::to_string(view.version) + ", cells of " +
         fixed(view.cell_m, 2) + " m, in " + fixed(report.milliseconds, 0) + " ms" + work + "\n";
}

}  // namespace stillmap::cli
