#pragma once

#include <filesystem>

#include "core/map/datum.hpp"
#include "core/map/tools/top_view.hpp"

namespace stillmap {

/// The optional part "geotiff": two GeoTIFFs of a top view through GDAL, as export_geotiff
/// describes them. Throws DatasetError.
using WriteGeotiffs = void(const TopView& top, const Datum& datum,
                           const std::filesystem::path& class_file,
                           const std::filesystem::path& height_file);
inline constexpr const char* write_geotiffs_name = "stillmap_write_geotiffs";

}  // namespace stillmap
