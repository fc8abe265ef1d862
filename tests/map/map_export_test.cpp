#include "core/map/tools/map_export.hpp"

#include <gdal.h>
#include <gmock/gmock.h>
#include <ogr_srs_api.h>

#include <numbers>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "tests/file_size_limit.hpp"
#include "tests/map/map_worlds.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::HasSubstr;

void expect_points_of(const MapSnapshot& view, const CloudFile& cloud) {
  std::size_t i = 0;
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      ASSERT_LT(i, cloud.scan.size());
      EXPECT_EQ(cloud.scan.points_lidar[i], voxel.mean_map);
      EXPECT_EQ(cloud.raw_labels.at(i), semantic_kitti_id(voxel.evidence.winner()));
      ++i;
    }
  }
  EXPECT_EQ(i, cloud.scan.size());
}

TEST(MapExport, FilesHoldEveryVoxelWithItsClass) {
  const ScratchFolder folder;
  const auto view = test::street_map(1, 200).view();
  export_pcd(*view, folder / "map.pcd");
  expect_points_of(*view, read_point_cloud(folder / "map.pcd", 0));
  export_ply(*view, folder / "map.ply");
  expect_points_of(*view, read_point_cloud(folder / "map.ply", 0));
}

TEST(MapExport, FolderThatIsMissingIsNamed) {
  const ScratchFolder folder;
  EXPECT_THROW(export_ply(MapSnapshot{}, folder / "no" / "map.ply"), DatasetError);
}

QueryVoxel voxel(float x, float y, float z, SemanticClass label) {
  return {.position_map = {x, y, z}, .label = label, .confidence = 1.0F, .point_count = 1};
}

std::vector<QueryVoxel> small_map() {
  return {voxel(0.1F, 0.1F, 0.0F, SemanticClass::road),
          voxel(0.2F, 0.2F, 3.0F, SemanticClass::vegetation),
          voxel(9.8F, 0.1F, 1.0F, SemanticClass::pole),
          voxel(-3.9F, 4.7F, -1.0F, SemanticClass::terrain)};
}

TEST(TopView, KeepsTheHighestVoxelOfEachCell) {
  const TopView top = rasterize_top_view(small_map(), 0.5);
  EXPECT_EQ(top.columns, 28);
  EXPECT_EQ(top.rows, 10);
  EXPECT_EQ(top.corner_map, Eigen::Vector2d(-4.0, 5.0));
  const auto at = [&](int row, int column) {
    return static_cast<std::size_t>(row * top.columns + column);
  };
  EXPECT_EQ(top.label.at(at(9, 8)), static_cast<int>(SemanticClass::vegetation));
  EXPECT_EQ(top.height_m.at(at(9, 8)), 3.0F);
  EXPECT_EQ(top.label.at(at(0, 0)), static_cast<int>(SemanticClass::terrain));
  EXPECT_EQ(top.label.at(at(9, 27)), static_cast<int>(SemanticClass::pole));
  EXPECT_EQ(top.label.at(at(5, 5)), TopView::nothing);
  EXPECT_EQ(top.height_m.at(at(5, 5)), TopView::no_height);
}

TEST(TopView, RefusesWhatMakesNoRaster) {
  EXPECT_THROW(static_cast<void>(rasterize_top_view({}, 0.5)), std::invalid_argument);
  const std::vector<QueryVoxel> far{voxel(-9e4F, -9e4F, 0, SemanticClass::road),
                                    voxel(9e4F, 9e4F, 0, SemanticClass::road)};
  EXPECT_THAT(
      message_of<std::invalid_argument>([&] { static_cast<void>(rasterize_top_view(far, 0.2)); }),
      HasSubstr("too large"));
}

/// A GeoTIFF as GDAL reads it.
class ReadRaster {
 public:
  explicit ReadRaster(const std::filesystem::path& file) {
    GDALAllRegister();
    raster_ = GDALOpen(file.c_str(), GA_ReadOnly);
    if (raster_ == nullptr) throw std::runtime_error("GDAL does not open " + file.string());
  }
  ~ReadRaster() { GDALClose(raster_); }
  ReadRaster(const ReadRaster&) = delete;
  ReadRaster& operator=(const ReadRaster&) = delete;

  [[nodiscard]] double value(int column, int row) const {
    double value = 0.0;
    EXPECT_EQ(GDALRasterIO(band(), GF_Read, column, row, 1, 1, &value, 1, 1, GDT_Float64, 0, 0),
              CE_None);
    return value;
  }
  [[nodiscard]] double no_data() const { return GDALGetRasterNoDataValue(band(), nullptr); }
  [[nodiscard]] std::string description() const { return GDALGetDescription(band()); }
  [[nodiscard]] std::string unit() const { return GDALGetRasterUnitType(band()); }
  [[nodiscard]] std::string metadata(const char* key) const {
    const char* const value = GDALGetMetadataItem(raster_, key, nullptr);
    return value == nullptr ? "" : value;
  }
  /// Of a class, as the file's palette has it.
  [[nodiscard]] Rgb colour(SemanticClass label) const {
    GDALColorEntry entry{};
    GDALGetColorEntryAsRGB(GDALGetRasterColorTable(band()), static_cast<int>(label), &entry);
    return {static_cast<std::uint8_t>(entry.c1), static_cast<std::uint8_t>(entry.c2),
            static_cast<std::uint8_t>(entry.c3)};
  }
  /// Latitude and longitude of a corner of a cell, through the file's own coordinate system.
  [[nodiscard]] Eigen::Vector2d lat_lon(double column, double row) const {
    std::array<double, 6> t{};
    EXPECT_EQ(GDALGetGeoTransform(raster_, t.data()), CE_None);
    double x = t[0] + column * t[1] + row * t[2];
    double y = t[3] + column * t[4] + row * t[5];
    OGRSpatialReferenceH from = OSRNewSpatialReference(GDALGetProjectionRef(raster_));
    OGRSpatialReferenceH to = OSRCloneGeogCS(from);
    OSRSetAxisMappingStrategy(from, OAMS_TRADITIONAL_GIS_ORDER);
    OSRSetAxisMappingStrategy(to, OAMS_TRADITIONAL_GIS_ORDER);
    OGRCoordinateTransformationH transformation = OCTNewCoordinateTransformation(from, to);
    EXPECT_TRUE(OCTTransform(transformation, 1, &x, &y, nullptr));
    OCTDestroyCoordinateTransformation(transformation);
    OSRDestroySpatialReference(from);
    OSRDestroySpatialReference(to);
    return {y, x};
  }

 private:
  [[nodiscard]] GDALRasterBandH band() const { return GDALGetRasterBand(raster_, 1); }
  GDALDatasetH raster_ = nullptr;
};

TEST(GeoExport, FilesHoldClassesAndHeightsWhereTheDatumSays) {
  const ScratchFolder folder;
  const Datum datum = datum_from_text("48.137,11.575,519");
  export_geotiff(small_map(), 0.5, datum, folder / "map.tif");
  const ReadRaster classes(folder / "map.tif");
  const ReadRaster heights(folder / "map_height.tif");
  EXPECT_EQ(classes.value(8, 9), static_cast<int>(SemanticClass::vegetation));
  EXPECT_EQ(classes.value(5, 5), 255.0);
  EXPECT_EQ(classes.no_data(), 255.0);
  EXPECT_EQ(heights.value(8, 9), 522.0);
  EXPECT_EQ(heights.no_data(), -9999.0);
  // The map's origin is 4 m right of and 5 m below the first cell's corner.
  EXPECT_TRUE(classes.lat_lon(8, 10).isApprox(Eigen::Vector2d(48.137, 11.575), 1e-9));
  // 5 m north: 5 m of 111.2 km a degree.
  EXPECT_NEAR(classes.lat_lon(8, 0).x() - 48.137, 5.0 / 111'200.0, 1e-7);
  EXPECT_GT(classes.lat_lon(20, 10).y(), 11.575);
}

TEST(GeoExport, FilesNameTheirClassesAndUnits) {
  const ScratchFolder folder;
  export_geotiff(small_map(), 0.5, Datum{}, folder / "map.tif");
  const ReadRaster classes(folder / "map.tif");
  EXPECT_EQ(classes.description(), "class of the highest voxel");
  for (const SemanticClass label : {SemanticClass::unlabeled, SemanticClass::traffic_sign}) {
    const std::string key = "CLASS_" + std::to_string(static_cast<int>(label));
    EXPECT_EQ(classes.metadata(key.c_str()), name(label));
    const Rgb expected = colour(label);
    const Rgb stored = classes.colour(label);
    EXPECT_EQ(std::tie(stored.r, stored.g, stored.b), std::tie(expected.r, expected.g, expected.b));
  }
  const ReadRaster heights(folder / "map_height.tif");
  EXPECT_EQ(heights.description(), "height of the highest voxel [m]");
  EXPECT_EQ(heights.unit(), "m");
}

TEST(GeoExport, RastersWiderThanABlockAreWhole) {
  const ScratchFolder folder;
  std::vector<QueryVoxel> diagonal;
  for (int i = 0; i < 700; ++i) {
    const auto at = static_cast<float>(i) + 0.5F;
    diagonal.push_back(voxel(at, 0.5F * at, static_cast<float>(i), SemanticClass::road));
  }
  export_geotiff(diagonal, 1.0, Datum{}, folder / "wide.tif");
  const ReadRaster heights(folder / "wide_height.tif");
  for (int i = 0; i < 700; ++i) {
    EXPECT_EQ(heights.value(i, 349 - i / 2), static_cast<double>(i));
  }
  EXPECT_EQ(heights.value(699, 349), -9999.0);
}

TEST(GeoExport, TurnsTheMapByTheAzimuthOfItsXAxis) {
  const ScratchFolder folder;
  export_geotiff(small_map(), 0.5, datum_from_text("-33.86,151.2,0,0"), folder / "north.tif");
  const ReadRaster raster(folder / "north.tif");
  const Eigen::Vector2d origin = raster.lat_lon(8, 10);
  EXPECT_TRUE(origin.isApprox(Eigen::Vector2d(-33.86, 151.2), 1e-9));
  // x to the north, so y to the west.
  EXPECT_GT(raster.lat_lon(20, 10).x(), origin.x() + 4e-5);
  EXPECT_LT(raster.lat_lon(8, 0).y(), origin.y() - 4e-5);
}

TEST(GeoExport, FilesThatFindNoRoomLeaveThoseBeforeThem) {
  const ScratchFolder folder;
  export_geotiff(small_map(), 0.5, Datum{}, folder / "map.tif");
  const std::string classes = content_of(folder / "map.tif");
  const std::string heights = content_of(folder / "map_height.tif");
  std::vector<QueryVoxel> larger = small_map();
  larger.push_back(voxel(90.0F, 90.0F, 0.0F, SemanticClass::road));
  {
    const FileSizeLimit limit(1000);
    EXPECT_THROW(export_geotiff(larger, 0.5, Datum{}, folder / "map.tif"), DatasetWriteError);
  }
  EXPECT_EQ(content_of(folder / "map.tif"), classes);
  EXPECT_EQ(content_of(folder / "map_height.tif"), heights);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 2);
}

TEST(GeoExport, NamesAFileThatCannotBeWritten) {
  const ScratchFolder folder;
  const auto write = [&] { export_geotiff(small_map(), 0.5, Datum{}, folder / "no" / "map.tif"); };
  EXPECT_THAT(message_of<DatasetError>(write), HasSubstr("map.tif"));
}

TEST(Datum, ReadsTwoToFourNumbers) {
  EXPECT_EQ(datum_from_text("1.5,-2").latitude_deg, 1.5);
  EXPECT_EQ(datum_from_text("1.5,-2").x_axis_azimuth_deg, 90.0);
  EXPECT_EQ(datum_from_text("1,2,3").altitude_m, 3.0);
  EXPECT_EQ(datum_from_text(" 1, 2,3 ,-45").x_axis_azimuth_deg, -45.0);
}

TEST(Datum, NamesWhatIsWrong) {
  for (const auto& [text, named] :
       {std::pair("", "0 numbers"), std::pair("48", "1 numbers"), std::pair("1,2,3,4,5", "5"),
        std::pair("48;11", "48;11"), std::pair("north,11", "north"), std::pair("85,0", "latitude"),
        std::pair("nan,0", "nan"), std::pair("0,181", "longitude"),
        std::pair("0,0,1e9", "altitude"), std::pair("0,0,0,400", "azimuth")}) {
    EXPECT_THAT(
        message_of<std::invalid_argument>([&] { static_cast<void>(datum_from_text(text)); }),
        testing::AllOf(HasSubstr(named), HasSubstr("give latitude,longitude")));
  }
}

}  // namespace
}  // namespace stillmap
