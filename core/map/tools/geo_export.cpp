#include "core/map/tools/geo_export.hpp"

#include "core/dataset/plugin.hpp"
#include "core/map/tools/geotiff_part.hpp"

namespace stillmap {

namespace fs = std::filesystem;

fs::path height_file_of(const fs::path& class_file) {
  return class_file.parent_path() /
         (class_file.stem().string() + "_height" + class_file.extension().string());
}

void export_geotiff(std::span<const QueryVoxel> voxels, double cell_size_m, const Datum& datum,
                    const fs::path& file) {
  const TopView top = rasterize_top_view(voxels, cell_size_m);
  auto* const write_geotiffs =
      plugin_function<WriteGeotiffs>("geotiff", write_geotiffs_name, "GeoTIFFs are written");
  write_geotiffs(top, datum, file, height_file_of(file));
}

}  // namespace stillmap
