// A byte of settings, then a sensor_msgs/PointCloud2 as it comes over DDS, which is then prepared
// as the mapper does it.

#include "core/lidar/prepare.hpp"
#include "core/lidar/range_image.hpp"
#include "core/lidar/rings.hpp"
#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/conversions/to_cloud.hpp"
#include "sensor_msgs.h"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/cdr.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/idl/driver_clouds.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace point_cloud_inputs {
namespace {

using sensor_msgs::msg::PointCloud2;

wire::CloudReadOptions reading_of(std::uint8_t settings) {
  wire::CloudReadOptions reading;
  reading.labels_are_classes = (settings & 1U) != 0;
  if ((settings & 2U) != 0) reading.intensity_scale = 1.0F / 255.0F;
  if ((settings & 4U) != 0) {
    reading.fields = {.intensity = {"intensity", "i", "reflectivity"},
                      .ring = {"ring", "channel"},
                      .time = {"time", "t", "timestamp", "offset_time"},
                      .label = {"label"}};
  }
  return reading;
}

void check(const Scan& scan, const PointCloud2& cloud) {
  const auto fits = [&](const auto& values) {
    return values.empty() || values.size() == scan.size();
  };
  require(fits(scan.intensity) && fits(scan.time_offset_s) && fits(scan.ring) && fits(scan.labels),
          "every list of a scan is empty or as long as its points");
  require(scan.size() <= cloud.data().size(), "a point needs a byte at least");
  for (const SemanticClass label : scan.labels) {
    require(static_cast<std::size_t>(label) < semantic_class_count, "classes exist");
  }
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const std::uint8_t settings = source.byte();
  const auto cloud = from_cdr<PointCloud2>(source.rest());
  if (!cloud) return;
  wire::CloudReader reader(reading_of(settings));
  // The second cloud is read as the first one taught.
  auto read = reader.read(*cloud);
  read = reader.read(*cloud);
  if (!read.from_cloud.scan) return;
  const Scan& scan = *read.from_cloud.scan;
  check(scan, *cloud);
  constexpr double period_s = 0.1;
  const Scan prepared =
      deskew(drop_unusable_points(scan, PrepareConfig{}), Eigen::Isometry3d::Identity(), period_s);
  static_cast<void>(assign_rings(prepared, vlp_16()));
  const RangeImage image(prepared.points_lidar,
                         {.rows = 16, .columns = 64, .fov_up = 0.3, .fov_down = -0.3});
}

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  Scan seen = wire::seen_by_driver();
  for (const auto& layout : wire::driver_layouts()) {
    PointCloud2 cloud = wire::as_driver_sends(layout, seen);
    // A few columns are enough, and small.
    cloud.data().resize(std::min<std::size_t>(cloud.data().size(), 64 * layout.point_step));
    cloud.height(1);
    cloud.width(static_cast<std::uint32_t>(cloud.data().size() / layout.point_step));
    cloud.row_step(static_cast<std::uint32_t>(cloud.data().size()));
    const std::string name = "driver_" + std::to_string(all.size());
    all.push_back({name, with_choice(4, to_cdr(cloud))});
  }
  seen.points_lidar.resize(8);
  for (auto* values : {&seen.intensity, &seen.time_offset_s}) values->resize(8);
  seen.ring.resize(8);
  seen.labels.assign(8, SemanticClass::car);
  all.push_back({"own", with_choice(0, to_cdr(wire::to_cloud(seen, {}, "lidar")))});
  return all;
}

}  // namespace
}  // namespace point_cloud_inputs

const Target point_cloud_target{"point_cloud", point_cloud_inputs::run, point_cloud_inputs::seeds};

}  // namespace stillmap::fuzz
