// A driver's cloud gives the same scan whether it comes over DDS or from a PCD with the same
// points.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <vector>

#include "core/dataset/point_cloud_files.hpp"
#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/conversions/header.hpp"
#include "tests/idl/driver_clouds.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::wire {
namespace {

using sensor_msgs::msg::PointCloud2;
using testing::ElementsAreArray;
using testing::NanSensitiveFloatEq;
using testing::Pointwise;

/// FIELDS, SIZE, TYPE and COUNT of a PCD header.
class FieldLists {
 public:
  void add(const std::string& name, std::size_t size, char type, std::size_t count) {
    names_ << ' ' << name;
    sizes_ << ' ' << size;
    types_ << ' ' << type;
    counts_ << ' ' << count;
  }
  void add_padding(std::size_t bytes) {
    if (bytes > 0) add("_", 1, 'U', bytes);
  }
  [[nodiscard]] std::string text() const {
    return "FIELDS" + names_.str() + "\nSIZE" + sizes_.str() + "\nTYPE" + types_.str() + "\nCOUNT" +
           counts_.str() + '\n';
  }

 private:
  std::ostringstream names_, sizes_, types_, counts_;
};

char pcd_type(FieldType type) {
  if (!is_integer(type)) return 'F';
  return *name_of(type) == 'u' ? 'U' : 'I';
}

/// The cloud's points, padding included, as a binary PCD.
std::string pcd_of(const PointCloud2& cloud) {
  auto fields = cloud.fields();
  std::ranges::sort(fields, {}, [](const auto& field) { return field.offset(); });
  FieldLists lists;
  std::size_t end = 0;
  for (const auto& field : fields) {
    const FieldType type = field_type(field.datatype()).value();
    lists.add_padding(field.offset() - end);
    lists.add(field.name(), size_of(type), pcd_type(type), 1);
    end = field.offset() + size_of(type);
  }
  lists.add_padding(cloud.point_step() - end);
  std::string pcd = "VERSION 0.7\n" + lists.text() + "WIDTH " + std::to_string(cloud.width()) +
                    "\nHEIGHT " + std::to_string(cloud.height()) + "\nDATA binary\n";
  for (std::size_t row = 0; row < cloud.height(); ++row) {
    const auto* begin = reinterpret_cast<const char*>(cloud.data().data()) + row * cloud.row_step();
    pcd.append(begin, std::size_t{cloud.width()} * cloud.point_step());
  }
  return pcd;
}

class DriverPcd : public testing::TestWithParam<DriverLayout> {};

TEST_P(DriverPcd, GivesTheScanOfTheCloud) {
  const PointCloud2 cloud = as_driver_sends(GetParam(), seen_by_driver());
  const auto live = to_scan(cloud, {}).scan;
  ASSERT_TRUE(live);
  const ScratchFolder folder;
  const Scan read = read_point_cloud(folder.file("scan.pcd", pcd_of(cloud)), live->stamp_ns).scan;
  ASSERT_EQ(read.size(), live->size());
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> from_file, from_cloud;
    for (const auto& point : read.points_lidar) from_file.push_back(point[axis]);
    for (const auto& point : live->points_lidar) from_cloud.push_back(point[axis]);
    EXPECT_THAT(from_file, Pointwise(NanSensitiveFloatEq(), from_cloud));
  }
  EXPECT_THAT(read.intensity, Pointwise(NanSensitiveFloatEq(), live->intensity));
  EXPECT_THAT(read.time_offset_s, Pointwise(NanSensitiveFloatEq(), live->time_offset_s));
  EXPECT_THAT(read.ring, ElementsAreArray(live->ring));
}

INSTANTIATE_TEST_SUITE_P(Files, DriverPcd, testing::ValuesIn(driver_layouts()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace stillmap::wire
