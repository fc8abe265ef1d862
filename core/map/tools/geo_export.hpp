#pragma once

#include <filesystem>
#include <span>

#include "core/map/datum.hpp"
#include "core/map/query/map_query.hpp"

namespace stillmap {

/// Name of the heights' file beside the classes' one: "x.tif" gives "x_height.tif".
[[nodiscard]] std::filesystem::path height_file_of(const std::filesystem::path& class_file);

/// Writes the map from above as two GeoTIFFs, in cells of
/// `cell_size_m`: the class of the highest voxel
/// (bytes 0..19 with SemanticKITTI's colours, 255 where there is none), and beside it its height
/// (float, metres above the datum's altitude reference, -9999 where there is none). Coordinate
/// system: the transverse Mercator projection whose origin is the datum (WGS 84, metres, scale 1),
/// which the files state; in plan it departs from the map by less than 1 cm within 5 km.
/// Throws std::invalid_argument as rasterize_top_view does, DatasetError when a file cannot be
/// written.
void export_geotiff(std::span<const QueryVoxel> voxels, double cell_size_m, const Datum& datum,
                    const std::filesystem::path& file);

}  // namespace stillmap
