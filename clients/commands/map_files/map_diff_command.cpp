#include <algorithm>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>

#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/map/tools/map_diff.hpp"
#include "core/picture/map_change_picture.hpp"

namespace stillmap::cli {
namespace {

constexpr std::size_t max_tiles = 10;
constexpr std::size_t max_pairs = 10;

std::string text_of(SemanticClass label) { return std::string(name(label)); }

Json to_json(const DifferenceCounts& counts) {
  return {
      {"appeared", counts.appeared}, {"removed", counts.gone}, {"relabelled", counts.relabelled}};
}

bool is_there(const ClassDifference& difference) {
  return difference.voxels_before + difference.voxels_after > 0;
}

std::vector<std::string> cells(const DifferenceCounts& counts) {
  return {std::to_string(counts.appeared), std::to_string(counts.gone),
          std::to_string(counts.relabelled)};
}

void add_row(Table& table, std::vector<std::string> row, const DifferenceCounts& counts) {
  std::ranges::copy(cells(counts), std::back_inserter(row));
  table.add(std::move(row));
}

std::string class_table(const MapDiff& diff) {
  Table table({"class", "before", "after", "appeared", "removed", "relabelled"});
  std::uint64_t before = 0;
  std::uint64_t after = 0;
  for (std::size_t k = 0; k < semantic_class_count; ++k) {
    const ClassDifference& difference = diff.classes.at(k);
    if (!is_there(difference)) continue;
    before += difference.voxels_before;
    after += difference.voxels_after;
    add_row(table,
            {text_of(static_cast<SemanticClass>(k)), std::to_string(difference.voxels_before),
             std::to_string(difference.voxels_after)},
            difference.counts);
  }
  add_row(table, {"all", std::to_string(before), std::to_string(after)}, diff.counts);
  return table.text();
}

std::string relabelled_lines(const MapDiff& diff) {
  std::vector<std::pair<std::uint64_t, std::string>> pairs;
  for (const auto& [classes, voxels] : diff.relabelled) {
    pairs.emplace_back(voxels, text_of(classes.first) + " to " + text_of(classes.second));
  }
  std::ranges::stable_sort(pairs, std::greater(), [](const auto& pair) { return pair.first; });
  std::string text;
  for (std::size_t i = 0; i < std::min(pairs.size(), max_pairs); ++i) {
    text +=
        (i == 0 ? "relabelled: " : ", ") + pairs[i].second + " " + std::to_string(pairs[i].first);
  }
  return text.empty() ? text : text + "\n";
}

std::string tile_table(const MapDiff& diff) {
  std::vector<TileDifference> tiles = diff.tiles;
  std::ranges::stable_sort(tiles, std::greater(),
                           [](const TileDifference& tile) { return tile.counts.sum(); });
  Table table({"tile", "appeared", "removed", "relabelled"});
  for (std::size_t i = 0; i < std::min(tiles.size(), max_tiles); ++i) {
    add_row(table, {std::to_string(tiles[i].id.x) + ", " + std::to_string(tiles[i].id.y)},
            tiles[i].counts);
  }
  std::string text = table.text();
  if (tiles.size() > max_tiles) {
    text += "and " + std::to_string(tiles.size() - max_tiles) +
            " more tiles with fewer changes; --json lists all\n";
  }
  return text;
}

/// Counts by class and tile.
Json to_json(const MapDiff& diff) {
  Json classes = Json::object();
  for (std::size_t k = 0; k < semantic_class_count; ++k) {
    const ClassDifference& difference = diff.classes.at(k);
    if (!is_there(difference)) continue;
    Json json = to_json(difference.counts);
    json.set("before", difference.voxels_before);
    json.set("after", difference.voxels_after);
    classes.set(text_of(static_cast<SemanticClass>(k)), json);
  }
  Json relabelled = Json::array();
  for (const auto& [pair, voxels] : diff.relabelled) {
    relabelled.push_back(
        {{"from", text_of(pair.first)}, {"to", text_of(pair.second)}, {"voxels", voxels}});
  }
  Json tiles = Json::array();
  for (const TileDifference& tile : diff.tiles) {
    Json json = to_json(tile.counts);
    json.set("x", tile.id.x);
    json.set("y", tile.id.y);
    tiles.push_back(json);
  }
  Json json = to_json(diff.counts);
  json.set("classes", classes);
  json.set("relabelled_pairs", relabelled);
  json.set("tiles", tiles);
  return json;
}

/// The same as text, with the most changed tiles only.
std::string describe(const MapDiff& diff) {
  if (diff.counts.sum() == 0) return "nothing changed\n";
  return class_table(diff) + relabelled_lines(diff) + "\n" + tile_table(diff);
}

struct MapDiffArguments {
  std::string before;
  std::string after;
  MapDiffOptions options;
  std::string picture;
  bool json = false;
};

ExitCode run(const MapDiffArguments& arguments) {
  end_cleanly_when_stopped();
  const MapSnapshot before = read_map_file(arguments.before).view;
  const MapSnapshot after = read_map_file(arguments.after).view;
  const MapDiff diff = diff_maps(before, after, arguments.options);
  if (!arguments.picture.empty()) write_diff_picture(arguments.picture, before, after, diff);
  std::cout << (arguments.json ? to_json(diff).dump(2) + "\n" : describe(diff));
  return ExitCode::ok;
}

}  // namespace

void add_map_diff_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<MapDiffArguments>();
  CommandHandle command =
      program.command("map-diff", "Say what changed between two map files of one place, by class");
  command.option("BEFORE", arguments->before, "The earlier map").required();
  command.option("AFTER", arguments->after, "The later map, in the same frame").required();
  command
      .option(
          "--tolerance", arguments->options.tolerance_voxels,
          "A voxel counts as removed, or new, only when the other map has none so many cells away")
      .between(0, MapDiffOptions::max_tolerance_voxels)
      .with_default();
  command
      .option("--picture", arguments->picture,
              "Draw it from above, to FILE.png: appeared green, removed red, another class yellow")
      .ends_in(".png");
  command.flag("--json", arguments->json, "Print JSON, with all tiles");
  command.explain(
      "Examples:\n"
      "  stillmap map-diff monday.stillmap tuesday.stillmap --picture changes.png\n"
      "  stillmap map-diff a.stillmap b.stillmap --tolerance 0 --json | jq .classes\n"
      "The maps must lie in one frame: the later one was mapped on in a copy of the earlier, or\n"
      "both began at the same place. Voxels must have one size.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
