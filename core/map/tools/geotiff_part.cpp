#include "core/map/tools/geotiff_part.hpp"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <gdal.h>
#include <gdal_frmts.h>
#include <ogr_srs_api.h>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>

#include "core/dataset/dataset_error.hpp"
#include "core/lidar/semantic_class.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

struct CloseRaster {
  void operator()(void* raster) const { GDALClose(raster); }
};
using Raster = std::unique_ptr<void, CloseRaster>;

/// As long as it lasts, GDAL keeps its errors for whoever asks instead of printing them.
class QuietErrors {
 public:
  QuietErrors() { CPLPushErrorHandler(CPLQuietErrorHandler); }
  ~QuietErrors() { CPLPopErrorHandler(); }
  QuietErrors(const QuietErrors&) = delete;
  QuietErrors& operator=(const QuietErrors&) = delete;
};

[[noreturn]] void fail(const fs::path& file) {
  throw DatasetError(file, std::string("cannot be written (") + CPLGetLastErrorMsg() +
                               "); its folder must exist and be writable, with room left");
}

void require(bool is_done, const fs::path& file) {
  if (!is_done) fail(file);
}

/// The datum's projection as WKT.
std::string projection_of(const Datum& datum) {
  const std::unique_ptr<void, decltype(&OSRDestroySpatialReference)> system(
      OSRNewSpatialReference(nullptr), &OSRDestroySpatialReference);
  OSRSetProjCS(system.get(), "Stillmap map at its datum");
  OSRSetWellKnownGeogCS(system.get(), "WGS84");
  OSRSetTM(system.get(), datum.latitude_deg, datum.longitude_deg, 1.0, 0.0, 0.0);
  OSRSetLinearUnits(system.get(), "metre", 1.0);
  char* text = nullptr;
  OSRExportToWkt(system.get(), &text);
  const std::string wkt = text == nullptr ? "" : text;
  CPLFree(text);
  return wkt;
}

/// GDAL's six numbers: easting and northing of a cell's corner from its column and row. With the
/// azimuth a of the map's x axis, east = x sin a - y cos a, north = x cos a + y sin a; rows go
/// against y.
std::array<double, 6> geo_transform(const TopView& top, const Datum& datum) {
  const double azimuth = datum.x_axis_azimuth_deg * std::numbers::pi / 180.0;
  const double sin = std::sin(azimuth);
  const double cos = std::cos(azimuth);
  const Eigen::Vector2d corner = top.corner_map;
  const double cell = top.cell_size_m;
  return {corner.x() * sin - corner.y() * cos, cell * sin, cell * cos,
          corner.x() * cos + corner.y() * sin, cell * cos, -cell * sin};
}

Raster create(const fs::path& file, const TopView& top, const Datum& datum, GDALDataType type) {
  GDALRegister_GTiff();
  GDALDriverH driver = GDALGetDriverByName("GTiff");
  std::array<const char*, 4> options{"COMPRESS=DEFLATE", "TILED=YES", "BIGTIFF=IF_SAFER", nullptr};
  Raster raster(GDALCreate(driver, file.c_str(), top.columns, top.rows, 1, type,
                           const_cast<char**>(options.data())));
  require(raster != nullptr, file);
  auto transform = geo_transform(top, datum);
  require(GDALSetGeoTransform(raster.get(), transform.data()) == CE_None, file);
  require(GDALSetProjection(raster.get(), projection_of(datum).c_str()) == CE_None, file);
  return raster;
}

void write_cells(GDALRasterBandH band, const TopView& top, const void* cells, GDALDataType type,
                 const fs::path& file) {
  require(GDALRasterIO(band, GF_Write, 0, 0, top.columns, top.rows, const_cast<void*>(cells),
                       top.columns, top.rows, type, 0, 0) == CE_None,
          file);
}

void finish(Raster raster, const fs::path& file) {
  CPLErrorReset();
  raster.reset();
  require(CPLGetLastErrorType() < CE_Failure, file);
}

void set_colours(GDALRasterBandH band) {
  const std::unique_ptr<void, decltype(&GDALDestroyColorTable)> table(GDALCreateColorTable(GPI_RGB),
                                                                      &GDALDestroyColorTable);
  for (std::size_t k = 0; k < semantic_class_count; ++k) {
    const Rgb rgb = colour(static_cast<SemanticClass>(k));
    const GDALColorEntry entry{rgb.r, rgb.g, rgb.b, 255};
    GDALSetColorEntry(table.get(), static_cast<int>(k), &entry);
  }
  GDALSetRasterColorTable(band, table.get());
}

void write_classes(const TopView& top, const Datum& datum, const fs::path& file) {
  Raster raster = create(file, top, datum, GDT_Byte);
  for (std::size_t k = 0; k < semantic_class_count; ++k) {
    const std::string key = "CLASS_" + std::to_string(k);
    const std::string class_name(name(static_cast<SemanticClass>(k)));
    GDALSetMetadataItem(raster.get(), key.c_str(), class_name.c_str(), nullptr);
  }
  GDALRasterBandH band = GDALGetRasterBand(raster.get(), 1);
  GDALSetDescription(band, "class of the highest voxel");
  GDALSetRasterNoDataValue(band, TopView::nothing);
  set_colours(band);
  write_cells(band, top, top.label.data(), GDT_Byte, file);
  finish(std::move(raster), file);
}

void write_heights(TopView top, const Datum& datum, const fs::path& file) {
  for (float& height_m : top.height_m) {
    if (height_m != TopView::no_height) height_m += static_cast<float>(datum.altitude_m);
  }
  Raster raster = create(file, top, datum, GDT_Float32);
  GDALRasterBandH band = GDALGetRasterBand(raster.get(), 1);
  GDALSetDescription(band, "height of the highest voxel [m]");
  GDALSetRasterUnitType(band, "m");
  GDALSetRasterNoDataValue(band, TopView::no_height);
  write_cells(band, top, top.height_m.data(), GDT_Float32, file);
  finish(std::move(raster), file);
}

}  // namespace
}  // namespace stillmap

extern "C" void stillmap_write_geotiffs(const stillmap::TopView& top, const stillmap::Datum& datum,
                                        const std::filesystem::path& class_file,
                                        const std::filesystem::path& height_file) {
  const stillmap::QuietErrors quiet;
  stillmap::write_classes(top, datum, class_file);
  stillmap::write_heights(top, datum, height_file);
}

static_assert(std::is_same_v<decltype(stillmap_write_geotiffs), stillmap::WriteGeotiffs>);
