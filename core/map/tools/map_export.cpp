#include "core/map/tools/map_export.hpp"

#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "core/lidar/semantic_class.hpp"
#include "core/process/file_beside.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

std::vector<ColouredPoint> points_of(const MapSnapshot& view) {
  std::vector<ColouredPoint> points;
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      points.push_back({voxel.mean_map, voxel.evidence.winner(), voxel.evidence.share()});
    }
  }
  return points;
}

/// Column and row from the map's origin, y upwards.
using PlanCell = Eigen::Matrix<std::int64_t, 2, 1>;

PlanCell plan_cell(const QueryVoxel& voxel, double cell_size_m) {
  const Eigen::Vector2d at = voxel.position_map.head<2>().cast<double>() / cell_size_m;
  return {static_cast<std::int64_t>(std::floor(at.x())),
          static_cast<std::int64_t>(std::floor(at.y()))};
}

TopView empty_raster(const PlanCell& low, const PlanCell& high, double cell_size_m) {
  const PlanCell size = high - low + PlanCell::Ones();
  if (size.maxCoeff() > TopView::max_cells || size.prod() > TopView::max_cells) {
    throw std::invalid_argument("a raster of " + std::to_string(size.x()) + " by " +
                                std::to_string(size.y()) +
                                " cells is too large; name a region, or a coarser resolution");
  }
  TopView top;
  top.columns = static_cast<int>(size.x());
  top.rows = static_cast<int>(size.y());
  top.corner_map = {static_cast<double>(low.x()) * cell_size_m,
                    static_cast<double>(high.y() + 1) * cell_size_m};
  top.cell_size_m = cell_size_m;
  top.label.assign(static_cast<std::size_t>(size.prod()), TopView::nothing);
  top.height_m.assign(static_cast<std::size_t>(size.prod()), TopView::no_height);
  return top;
}

// GeoTIFF (OGC 19-008): tags that libtiff does not know.
constexpr ttag_t model_transformation_tag = 34264;
constexpr ttag_t geo_keys_tag = 34735;
constexpr ttag_t geo_doubles_tag = 34736;
constexpr ttag_t geo_text_tag = 34737;
// GDAL's own, which QGIS reads as well.
constexpr ttag_t gdal_metadata_tag = 42112;
constexpr ttag_t gdal_no_data_tag = 42113;

TIFFFieldInfo field(ttag_t tag, const char* name, short values, TIFFDataType type, bool has_count) {
  return {tag,
          values,
          values,
          type,
          FIELD_CUSTOM,
          1,
          static_cast<unsigned char>(has_count),
          const_cast<char*>(name)};
}

/// A TIFF that is being written. libtiff's errors are kept instead of printed.
class TiffWriter {
 public:
  /// `beside` is where `file` is written.
  TiffWriter(fs::path file, const FileBeside& beside) : file_(std::move(file)) {
    const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(
        TIFFOpenOptionsAlloc(), &TIFFOpenOptionsFree);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), &keep_error, &error_);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), &ignore, nullptr);
    tiff_.reset(TIFFOpenExt(beside.path().c_str(), "w", options.get()));
    require(tiff_ != nullptr);
    constexpr short any = TIFF_VARIABLE;
    const std::array<TIFFFieldInfo, 6> fields{
        field(model_transformation_tag, "ModelTransformation", any, TIFF_DOUBLE, true),
        field(geo_keys_tag, "GeoKeyDirectory", any, TIFF_SHORT, true),
        field(geo_doubles_tag, "GeoDoubleParams", any, TIFF_DOUBLE, true),
        field(geo_text_tag, "GeoAsciiParams", any, TIFF_ASCII, false),
        field(gdal_metadata_tag, "GDALMetadata", any, TIFF_ASCII, false),
        field(gdal_no_data_tag, "GDALNoData", any, TIFF_ASCII, false)};
    require(TIFFMergeFieldInfo(tiff_.get(), fields.data(), fields.size()) == 0);
  }
  // libtiff holds the address of `error_`.
  TiffWriter(const TiffWriter&) = delete;
  TiffWriter& operator=(const TiffWriter&) = delete;

  template <typename... Values>
  void set(ttag_t tag, Values... values) {
    require(TIFFSetField(tiff_.get(), tag, values...) == 1);
  }

  /// Cells row by row, written as square blocks.
  template <typename Cell>
  void write(const TopView& top, const std::vector<Cell>& cells) {
    constexpr int side = 256;
    set(TIFFTAG_TILEWIDTH, side);
    set(TIFFTAG_TILELENGTH, side);
    std::vector<Cell> block(std::size_t{side} * side);
    for (int row = 0; row < top.rows; row += side) {
      for (int column = 0; column < top.columns; column += side) {
        const int width = std::min(side, top.columns - column);
        for (int y = 0; y < std::min(side, top.rows - row); ++y) {
          const auto first = std::int64_t{row + y} * top.columns + column;
          std::copy_n(cells.begin() + first, width, block.begin() + std::ptrdiff_t{side} * y);
        }
        require(TIFFWriteTile(tiff_.get(), block.data(), static_cast<std::uint32_t>(column),
                              static_cast<std::uint32_t>(row), 0, 0) >= 0);
      }
    }
    require(TIFFFlush(tiff_.get()) == 1);
    tiff_.reset();
    require(error_.empty());
  }

 private:
  static int keep_error(TIFF* /*tiff*/, void* kept, const char* /*module*/, const char* format,
                        va_list values) {
    std::array<char, 256> text{};
    static_cast<void>(std::vsnprintf(text.data(), text.size(), format, values));
    *static_cast<std::string*>(kept) = text.data();
    return 1;
  }
  static int ignore(TIFF* /*tiff*/, void* /*user*/, const char* /*module*/, const char* /*format*/,
                    va_list /*values*/) {
    return 1;
  }

  void require(bool is_done) const {
    if (is_done) return;
    throw DatasetWriteError(file_, "cannot be written (" + error_ +
                                       "); its folder must exist and be writable, with room left");
  }

  struct Close {
    void operator()(TIFF* tiff) const { TIFFClose(tiff); }
  };
  fs::path file_;
  std::string error_;
  std::unique_ptr<TIFF, Close> tiff_;
};

/// Easting and northing of a cell's corner from its column and row. With the azimuth a of the map's
/// x axis, east = x sin a - y cos a, north = x cos a + y sin a; rows run against y.
std::array<double, 16> model_transformation(const TopView& top, const Datum& datum) {
  const double azimuth = datum.x_axis_azimuth_deg * std::numbers::pi / 180.0;
  const double sin = std::sin(azimuth);
  const double cos = std::cos(azimuth);
  const Eigen::Vector2d corner = top.corner_map;
  const double cell = top.cell_size_m;
  return {cell * sin, cell * cos,  0.0, corner.x() * sin - corner.y() * cos,
          cell * cos, -cell * sin, 0.0, corner.x() * cos + corner.y() * sin,
          0.0,        0.0,         0.0, 0.0,
          0.0,        0.0,         0.0, 1.0};
}

/// The transverse Mercator projection with its origin at the datum, as GeoKeys.
void set_projection(TiffWriter& tiff, const Datum& datum) {
  constexpr std::string_view name = "Stillmap map at its datum|";
  constexpr std::uint16_t doubles = geo_doubles_tag;
  constexpr std::uint16_t user_defined = 32767;
  // Key, where its value is (0: here), how many, value or position there. Sorted by key.
  constexpr std::array<std::array<std::uint16_t, 4>, 15> keys{{
      {1, 1, 0, 14},                                        // version 1.1.0, 14 keys
      {1024, 0, 1, 1},                                      // model: projected
      {1025, 0, 1, 1},                                      // a pixel is an area
      {1026, std::uint16_t{geo_text_tag}, name.size(), 0},  // citation
      {2048, 0, 1, 4326},                                   // WGS 84
      {2054, 0, 1, 9102},                                   // degrees
      {3072, 0, 1, user_defined},                           // projected system
      {3074, 0, 1, user_defined},                           // projection
      {3075, 0, 1, 1},                                      // transverse Mercator
      {3076, 0, 1, 9001},                                   // metres
      {3080, doubles, 1, 0},                                // longitude of the origin
      {3081, doubles, 1, 1},                                // latitude of the origin
      {3082, doubles, 1, 2},                                // false easting
      {3083, doubles, 1, 2},                                // false northing
      {3092, doubles, 1, 3},                                // scale at the origin
  }};
  const std::array<double, 4> values{datum.longitude_deg, datum.latitude_deg, 0.0, 1.0};
  tiff.set(geo_keys_tag, static_cast<int>(4 * keys.size()), keys.data());
  tiff.set(geo_doubles_tag, static_cast<int>(values.size()), values.data());
  tiff.set(geo_text_tag, name.data());
}

void set_layout(TiffWriter& tiff, const TopView& top, const Datum& datum) {
  tiff.set(TIFFTAG_IMAGEWIDTH, top.columns);
  tiff.set(TIFFTAG_IMAGELENGTH, top.rows);
  tiff.set(TIFFTAG_SAMPLESPERPIXEL, 1);
  tiff.set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  tiff.set(TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE);
  const std::array<double, 16> transformation = model_transformation(top, datum);
  tiff.set(model_transformation_tag, static_cast<int>(transformation.size()),
           transformation.data());
  set_projection(tiff, datum);
}

std::string metadata_item(const std::string& attributes, const std::string& value) {
  return "<Item " + attributes + ">" + value + "</Item>";
}

void write_classes(const TopView& top, const Datum& datum, const fs::path& file,
                   const FileBeside& beside) {
  TiffWriter tiff(file, beside);
  set_layout(tiff, top, datum);
  std::array<std::array<std::uint16_t, 256>, 3> palette{};
  std::string metadata =
      "<GDALMetadata>" + metadata_item(R"(name="DESCRIPTION" sample="0" role="description")",
                                       "class of the highest voxel");
  for (std::size_t k = 0; k < semantic_class_count; ++k) {
    const auto label = static_cast<SemanticClass>(k);
    const Rgb rgb = colour(label);
    palette[0][k] = static_cast<std::uint16_t>(257 * rgb.r);
    palette[1][k] = static_cast<std::uint16_t>(257 * rgb.g);
    palette[2][k] = static_cast<std::uint16_t>(257 * rgb.b);
    metadata += metadata_item("name=\"CLASS_" + std::to_string(k) + "\"", std::string(name(label)));
  }
  tiff.set(TIFFTAG_BITSPERSAMPLE, 8);
  tiff.set(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_PALETTE);
  tiff.set(TIFFTAG_COLORMAP, palette[0].data(), palette[1].data(), palette[2].data());
  tiff.set(gdal_metadata_tag, (metadata + "</GDALMetadata>").c_str());
  tiff.set(gdal_no_data_tag, std::to_string(TopView::nothing).c_str());
  tiff.write(top, top.label);
}

void write_heights(TopView top, const Datum& datum, const fs::path& file,
                   const FileBeside& beside) {
  for (float& height_m : top.height_m) {
    if (height_m != TopView::no_height) height_m += static_cast<float>(datum.altitude_m);
  }
  TiffWriter tiff(file, beside);
  set_layout(tiff, top, datum);
  tiff.set(TIFFTAG_BITSPERSAMPLE, 32);
  tiff.set(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
  tiff.set(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  tiff.set(gdal_metadata_tag,
           ("<GDALMetadata>" +
            metadata_item(R"(name="DESCRIPTION" sample="0" role="description")",
                          "height of the highest voxel [m]") +
            metadata_item(R"(name="UNITTYPE" sample="0" role="unittype")", "m") + "</GDALMetadata>")
               .c_str());
  tiff.set(gdal_no_data_tag, "-9999");
  tiff.write(top, top.height_m);
}

void put_in_place(const fs::path& file, FileBeside& beside) {
  if (const std::error_code fault = beside.put_in_place())
    throw DatasetWriteError(file, "cannot be written (" + fault.message() + ")");
}

}  // namespace

void export_pcd(const MapSnapshot& view, const fs::path& file) { write_pcd(file, points_of(view)); }

void export_ply(const MapSnapshot& view, const fs::path& file) { write_ply(file, points_of(view)); }

TopView rasterize_top_view(std::span<const QueryVoxel> voxels, double cell_size_m) {
  if (voxels.empty()) throw std::invalid_argument("there are no voxels to make a raster of");
  PlanCell low = plan_cell(voxels.front(), cell_size_m);
  PlanCell high = low;
  for (const QueryVoxel& voxel : voxels) {
    low = low.cwiseMin(plan_cell(voxel, cell_size_m));
    high = high.cwiseMax(plan_cell(voxel, cell_size_m));
  }
  TopView top = empty_raster(low, high, cell_size_m);
  for (const QueryVoxel& voxel : voxels) {
    const PlanCell cell = plan_cell(voxel, cell_size_m);
    const auto at =
        static_cast<std::size_t>((high.y() - cell.y()) * top.columns + (cell.x() - low.x()));
    float& height_m = top.height_m.at(at);
    if (height_m != TopView::no_height && height_m >= voxel.position_map.z()) continue;
    height_m = voxel.position_map.z();
    top.label[at] = static_cast<std::uint8_t>(voxel.label);
  }
  return top;
}

fs::path height_file_of(const fs::path& class_file) {
  return class_file.parent_path() /
         (class_file.stem().string() + "_height" + class_file.extension().string());
}

void export_geotiff(std::span<const QueryVoxel> voxels, double cell_size_m, const Datum& datum,
                    const fs::path& file) {
  const TopView top = rasterize_top_view(voxels, cell_size_m);
  const fs::path heights = height_file_of(file);
  FileBeside classes_beside(file);
  FileBeside heights_beside(heights);
  write_classes(top, datum, file, classes_beside);
  write_heights(top, datum, heights, heights_beside);
  // Once both are whole: they belong together.
  put_in_place(file, classes_beside);
  put_in_place(heights, heights_beside);
}

}  // namespace stillmap
