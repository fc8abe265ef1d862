#include <iostream>
#include <memory>
#include <stdexcept>

#include "clients/commands/command.hpp"
#include "clients/commands/query/query_report.hpp"
#include "clients/commands/query/region_arguments.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/map/tools/map_export.hpp"
#include "core/map/tools/outlier_removal.hpp"

namespace stillmap::cli {
namespace {

struct MapExportArguments {
  std::string file;
  std::string output;
  RegionArguments region;
  std::vector<std::string> classes;
  double resolution_m = 0.0;
  /// 0: outliers stay.
  double outlier_sigma = 0.0;
  int outlier_neighbours = OutlierRemovalConfig{}.neighbours;
  std::string datum;
  bool json = false;
};

bool is_raster_name(const std::string& file) {
  return file.ends_with(".tif") || file.ends_with(".tiff");
}

void check_output_name(const std::string& file) {
  if (is_cloud_file(file) || is_raster_name(file)) return;
  const bool is_octree = file.ends_with(".bt") || file.ends_with(".ot");
  throw std::invalid_argument("--output " + file + ": the name must end in .pcd, .ply or .tif" +
                              (is_octree ? "; OctoMap files come from stillmap octomap" : ""));
}

/// Throws std::invalid_argument for what is no datum, and for one that no file takes.
void check_datum(const MapExportArguments& arguments) {
  if (arguments.datum.empty()) return;
  static_cast<void>(datum_from_text(arguments.datum));
  if (is_raster_name(arguments.output)) return;
  throw std::invalid_argument("--datum " + arguments.datum + " is of a GeoTIFF, and --output " +
                              arguments.output +
                              " is none: leave it out, or name a file that ends in .tif");
}

MapQuery query_of(const MapExportArguments& arguments, const SavedMap& map) {
  if (map.trajectory.empty() && arguments.region.around_robot_m > 0.0) {
    throw std::invalid_argument(
        "--around-robot: " + arguments.file +
        " has no path that ends where the robot was: name a place by --around or --box");
  }
  const Eigen::Vector2d robot_map =
      map.trajectory.empty()
          ? Eigen::Vector2d(Eigen::Vector2d::Zero())
          : Eigen::Vector2d(map.trajectory.back().T_map_lidar.translation().head<2>());
  MapQuery query;
  query.region = region_at(arguments.region, robot_map);
  query.classes = classes_of(arguments.classes);
  query.resolution_m = arguments.resolution_m;
  return query;
}

std::vector<QueryVoxel> voxels_of(const MapSnapshot& view, MapQuery query) {
  std::vector<QueryVoxel> voxels;
  do {
    const MapQueryResult page = query_map(view, query);
    if (page.status != QueryStatus::ok) throw std::invalid_argument(page.reason);
    voxels.insert(voxels.end(), page.voxels.begin(), page.voxels.end());
    query.continuation = page.continuation;
  } while (!query.continuation.empty());
  return voxels;
}

Datum datum_of(const MapExportArguments& arguments, const SavedMap& map) {
  if (!arguments.datum.empty()) return datum_from_text(arguments.datum);
  const auto stored = map.metadata.find("datum");
  if (stored != map.metadata.end()) return datum_from_text(stored->second);
  throw std::invalid_argument(
      "a GeoTIFF needs to know where the map lies: give --datum "
      "latitude,longitude[,altitude_m[,azimuth_deg]] of the map's origin, as --datum "
      "48.137,11.575,519,90");
}

void write(const MapExportArguments& arguments, const SavedMap& map,
           const std::vector<QueryVoxel>& voxels) {
  if (is_cloud_file(arguments.output)) {
    write_cloud(arguments.output, voxels);
    return;
  }
  const double cell_size_m =
      arguments.resolution_m == 0.0 ? map.view.voxel_size_m : arguments.resolution_m;
  export_geotiff(voxels, cell_size_m, datum_of(arguments, map), arguments.output);
}

ExitCode run(const MapExportArguments& arguments) {
  check_output_name(arguments.output);
  check_datum(arguments);
  check_region(arguments.region);
  end_cleanly_when_stopped();
  const SavedMap map = read_map_file(arguments.file);
  std::vector<QueryVoxel> voxels = voxels_of(map.view, query_of(arguments, map));
  const std::size_t found = voxels.size();
  if (arguments.outlier_sigma != 0.0) {
    voxels = without_outliers(
        voxels, {.neighbours = arguments.outlier_neighbours, .sigma = arguments.outlier_sigma});
  }
  const std::size_t outliers = found - voxels.size();
  write(arguments, map, voxels);
  std::vector<std::string> files{arguments.output};
  if (is_raster_name(arguments.output)) files.push_back(height_file_of(arguments.output).string());
  if (arguments.json) {
    const Json json{{"voxels", voxels.size()}, {"outliers_removed", outliers}, {"files", files}};
    std::cout << json.dump(2) << "\n";
    return ExitCode::ok;
  }
  std::cout << voxels.size() << " voxels written to";
  for (const std::string& file : files) std::cout << " " << file;
  if (arguments.outlier_sigma > 0.0) std::cout << ", outliers removed: " << outliers;
  std::cout << "\n";
  return ExitCode::ok;
}

}  // namespace

void add_map_export_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<MapExportArguments>();
  CommandHandle command =
      program.command("map-export", "Write a map file, or a part of it, as PCD, PLY or GeoTIFF");
  command.option("FILE,--map", arguments->file, "A map file; it is only read").required();
  command
      .option("--output,--out,-o", arguments->output,
              "FILE.pcd or FILE.ply: a point a voxel, with class and colour; FILE.tif: from above, "
              "classes there and heights in FILE_height.tif")
      .required();
  add_region_options(command, arguments->region);
  command.option("--classes", arguments->classes, "Only these: road,building,traffic-sign")
      .comma_separated();
  command.option("--resolution", arguments->resolution_m,
                 "Voxel size of the export [m]; default: the map's own");
  const OptionHandle remove_outliers =
      command
          .option(
              "--remove-outliers", arguments->outlier_sigma,
              "SIGMA: without voxels whose mean distance to their nearest others is more than so "
              "many standard deviations above the mean")
          .above_zero();
  command
      .option("--outlier-neighbours", arguments->outlier_neighbours,
              "How many others --remove-outliers looks at")
      .with_default()
      .between(1, 1000)
      .needs(remove_outliers);
  command.option("--datum", arguments->datum,
                 "Of a GeoTIFF: LATITUDE,LONGITUDE[,ALTITUDE[,AZIMUTH]] of the map's origin and "
                 "where its x axis points, clockwise from north (90, east); default: the file's "
                 "own datum");
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap map-export city.stillmap --output city.ply\n"
      "  stillmap map-export city.stillmap -o poles.pcd --classes pole,traffic-sign\n"
      "  stillmap map-export city.stillmap -o way.ply --corridor path.txt --width 6 --max-z 2\n"
      "  stillmap map-export city.stillmap -o clean.ply --remove-outliers 3\n"
      "  stillmap map-export city.stillmap -o city.tif --datum 49.011,8.417,115,35\n"
      "Points are in the map frame [m]. --around-robot is round the end of the stored path. The "
      "GeoTIFF is in the transverse Mercator projection at the datum (WGS 84), which any GIS reads "
      "from the file.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
