#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "core/geodesy/datum.hpp"
#include "core/map/query/map_query.hpp"
#include "core/map/tile.hpp"

namespace stillmap {

/// Writes a point for every voxel: position (map frame [m]), class, its colour and its share of the
/// evidence. Binary PCD or PLY. Throws DatasetError when the file cannot be written.
void export_pcd(const MapSnapshot& view, const std::filesystem::path& file);
void export_ply(const MapSnapshot& view, const std::filesystem::path& file);

/// The highest voxel of every cell in plan. Row 0 has the greatest y, as in an image.
struct TopView {
  int columns = 0;
  int rows = 0;
  /// Map position of the upper left corner of the first cell [m].
  Eigen::Vector2d corner_map = Eigen::Vector2d::Zero();
  double cell_size_m = 0.0;
  /// `nothing` where the map has no voxel.
  std::vector<std::uint8_t> label;
  /// Mean height of the voxel's points, map frame [m]; `no_height` where there is none.
  std::vector<float> height_m;

  static constexpr std::uint8_t nothing = 255;
  static constexpr float no_height = -9999.0F;
  /// A map of 2.8 km by 2.8 km in 20 cm voxels.
  static constexpr std::int64_t max_cells = 200'000'000;
};

/// Cells lie on multiples of `cell_size_m` (above 0). Throws std::invalid_argument for no voxels,
/// or too many cells.
[[nodiscard]] TopView rasterize_top_view(std::span<const QueryVoxel> voxels, double cell_size_m);

/// Name of the file of heights that belongs to a file of classes: "x.tif" gives "x_height.tif".
[[nodiscard]] std::filesystem::path height_file_of(const std::filesystem::path& class_file);

/// Writes the map from above as two GeoTIFFs, in cells of `cell_size_m`: the class of the highest
/// voxel (bytes 0..19 with SemanticKITTI's colours, 255 where there is none), and in
/// `height_file_of(file)` its height (float, metres above the datum's altitude reference, -9999
/// where there is none). Coordinate system: the transverse Mercator projection whose origin is the
/// datum (WGS 84, metres, scale 1), which the files state; in plan it departs from the map by less
/// than 1 cm within 5 km. Throws std::invalid_argument as rasterize_top_view does, DatasetError
/// when a file cannot be written.
void export_geotiff(std::span<const QueryVoxel> voxels, double cell_size_m, const Datum& datum,
                    const std::filesystem::path& file);

}  // namespace stillmap
