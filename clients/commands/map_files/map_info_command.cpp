#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <iostream>
#include <memory>
#include <sstream>
#include <string>

#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/map/tools/map_info.hpp"

namespace stillmap::cli {
namespace {

std::string utc(std::int64_t stamp_ns) {
  const auto seconds = static_cast<std::time_t>(stamp_ns / 1'000'000'000);
  std::tm parts{};
  if (gmtime_r(&seconds, &parts) == nullptr) return std::to_string(stamp_ns) + " ns";
  std::array<char, 32> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S", &parts)};
}

double seconds(const TimeSpan& span) {
  return static_cast<double>(span.last_ns - span.first_ns) / 1e9;
}

std::string megabytes(std::uint64_t bytes) {
  return fixed(static_cast<double>(bytes) / 1e6, 2) + " MB";
}

double bytes_a_voxel(const MapFileInfo& info) {
  return info.map.voxels == 0
             ? 0.0
             : static_cast<double>(info.bytes) / static_cast<double>(info.map.voxels);
}

double share(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

/// Classes with their shares, most frequent first, each with its bar.
std::string class_bars(const MapInfo& map) {
  constexpr double bar_width = 40.0;
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < semantic_class_count; ++k) {
    if (map.voxels_of_class.at(k) > 0) order.push_back(k);
  }
  std::ranges::stable_sort(order, std::greater(),
                           [&](std::size_t k) { return map.voxels_of_class.at(k); });
  Table table({"class", "voxels", "share"});
  for (const std::size_t k : order) {
    table.add({std::string(name(static_cast<SemanticClass>(k))),
               std::to_string(map.voxels_of_class.at(k)),
               fixed(100.0 * share(map.voxels_of_class.at(k), map.voxels), 1) + " %"});
  }
  std::istringstream lines(table.text());
  std::string text;
  for (std::size_t row = 0; row < order.size() + 2; ++row) {
    std::string line;
    std::getline(lines, line);
    text += line;
    if (row >= 2) {
      const double part = share(map.voxels_of_class.at(order[row - 2]), map.voxels);
      text += "  " + std::string(static_cast<std::size_t>(std::ceil(part * bar_width)), '#');
    }
    text += "\n";
  }
  return text;
}

std::string bounds_text(const Eigen::AlignedBox3d& bounds_map) {
  std::string text;
  for (const auto& [axis, letter] :
       {std::pair(0, "x "), std::pair(1, ", y "), std::pair(2, ", z ")}) {
    text.append(letter).append(fixed(bounds_map.min()[axis], 1)).append(" .. ");
    text.append(fixed(bounds_map.max()[axis], 1));
  }
  return text + " m (map frame)";
}

Json corner(const Eigen::Vector3d& p_map) { return {p_map.x(), p_map.y(), p_map.z()}; }

Json span_json(const TimeSpan& span) {
  return {{"first_ns", span.first_ns}, {"last_ns", span.last_ns}};
}

Json to_json(const MapFileInfo& info) {
  const MapInfo& map = info.map;
  Json classes = Json::object();
  for (std::size_t k = 0; k < semantic_class_count; ++k) {
    if (map.voxels_of_class.at(k) == 0) continue;
    classes.set(std::string(name(static_cast<SemanticClass>(k))), map.voxels_of_class.at(k));
  }
  Json bounds_map = nullptr;
  if (!map.bounds_map.isEmpty()) {
    bounds_map = {{"min", corner(map.bounds_map.min())}, {"max", corner(map.bounds_map.max())}};
  }
  return {{"file", {{"bytes", info.bytes}, {"schema_version", info.schema_version}}},
          {"map_id", map.map_id},
          {"map_version", map.version},
          {"tile_size_m", map.tile_size_m},
          {"voxel_size_m", map.voxel_size_m},
          {"tiles", map.tiles},
          {"voxels", map.voxels},
          {"points", map.points},
          {"bytes_per_voxel", bytes_a_voxel(info)},
          {"classes", classes},
          {"bounds_map", bounds_map},
          {"observed_span", span_json(map.observation_span)},
          {"poses", map.poses},
          {"path_length_m", map.path_length_m},
          {"trajectory_span", span_json(map.trajectory_span)},
          {"metadata", map.metadata}};
}

/// The same for people, with a bar for the share of every class.
std::string describe(const MapFileInfo& info) {
  const MapInfo& map = info.map;
  std::ostringstream text;
  text << "file      " << megabytes(info.bytes) << ", format " << info.schema_version
       << " (SQLite), " << fixed(bytes_a_voxel(info), 1) << " bytes a voxel\n"
       << "map       id " << map.map_id << ", version " << map.version << "\n"
       << "content   " << map.voxels << " voxels of " << fixed(map.voxel_size_m, 2) << " m in "
       << map.tiles << " tiles of " << fixed(map.tile_size_m, 1) << " m, from " << map.points
       << " points\n";
  if (!map.bounds_map.isEmpty()) text << "bounds    " << bounds_text(map.bounds_map) << "\n";
  text << "path      " << map.poses << " poses, " << fixed(map.path_length_m, 1) << " m\n";
  if (map.poses > 0) {
    text << "recorded  " << utc(map.trajectory_span.first_ns) << " to "
         << utc(map.trajectory_span.last_ns) << " UTC, " << fixed(seconds(map.trajectory_span), 1)
         << " s\n";
  }
  if (map.voxels > 0) {
    text << "observed  " << utc(map.observation_span.first_ns) << " to "
         << utc(map.observation_span.last_ns) << " UTC\n";
  }
  for (const auto& [key, value] : map.metadata)
    text << "metadata  " << key << ": " << value << "\n";
  if (map.voxels > 0) {
    text << "\n" << class_bars(map);
  } else {
    text << "the map is empty\n";
  }
  return text.str();
}

struct MapInfoArguments {
  std::string file;
  bool json = false;
};

ExitCode run(const MapInfoArguments& arguments) {
  end_cleanly_when_stopped();
  const MapFileInfo info = map_file_info(arguments.file);
  std::cout << (arguments.json ? to_json(info).dump(2) + "\n" : describe(info));
  return ExitCode::ok;
}

}  // namespace

void add_map_info_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<MapInfoArguments>();
  CommandHandle command =
      program.command("map-info", "Say what a map file holds: sizes, classes, bounds, path, times");
  command.option("FILE,--map", arguments->file, "A map file; it is only read").required();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap map-info city_map/map.stillmap\n"
      "  stillmap map-info city.stillmap --json | jq .classes\n"
      "A server may be mapping in the file: this shows its last save.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
