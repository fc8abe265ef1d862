// PCD files that PCL writes are read as PCL wrote them, and the other way round.
#include <gtest/gtest.h>
#include <pcl/PCLPointCloud2.h>
#include <pcl/io/pcd_io.h>

#include <cstring>
#include <random>
#include <string>

#include "core/dataset/point_cloud_files.hpp"
#include "tests/scratch_folder.hpp"

#if defined(__SANITIZE_THREAD__)
/// OpenNI, which PCL links, unlocks what it has not locked when a program ends: already when the
/// build asks this one for its tests.
extern "C" const char* __tsan_default_suppressions() { return "mutex:libOpenNI2.so\n"; }
#endif

namespace stillmap {
namespace {

using pcl::PCLPointField;

constexpr std::uint32_t points = 1000;
constexpr std::uint32_t point_step = 32;

struct Place {
  const char* name;
  std::uint8_t datatype;
  std::uint32_t offset;
};
/// With gaps, as PCL's own point types have them.
constexpr Place places[] = {
    {"x", PCLPointField::FLOAT32, 0},    {"y", PCLPointField::FLOAT32, 4},
    {"z", PCLPointField::FLOAT32, 8},    {"intensity", PCLPointField::UINT8, 16},
    {"ring", PCLPointField::UINT16, 18}, {"label", PCLPointField::UINT32, 20},
    {"time", PCLPointField::FLOAT64, 24}};

struct Truth {
  Scan scan;
  std::vector<std::uint32_t> raw_labels;
};

Truth random_scan() {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> coordinate(-90.0F, 90.0F);
  Truth truth;
  for (std::uint32_t i = 0; i < points; ++i) {
    truth.scan.points_lidar.emplace_back(coordinate(random), coordinate(random),
                                         coordinate(random));
    truth.scan.intensity.push_back(static_cast<float>(random() % 256));
    truth.scan.ring.push_back(static_cast<std::uint16_t>(random() % 64));
    truth.scan.time_offset_s.push_back(1e-4F * static_cast<float>(i));
    truth.raw_labels.push_back(static_cast<std::uint32_t>((random() % 9) << 16U | random() % 260));
  }
  return truth;
}

pcl::PCLPointCloud2 pcl_cloud(const Truth& truth) {
  pcl::PCLPointCloud2 cloud;
  for (const Place& place : places) {
    PCLPointField& field = cloud.fields.emplace_back();
    field.name = place.name;
    field.datatype = place.datatype;
    field.offset = place.offset;
    field.count = 1;
  }
  cloud.width = points;
  cloud.height = 1;
  cloud.point_step = point_step;
  cloud.row_step = points * point_step;
  cloud.data.resize(cloud.row_step);
  for (std::size_t i = 0; i < points; ++i) {
    std::uint8_t* to = cloud.data.data() + i * point_step;
    const double time = truth.scan.time_offset_s[i];
    std::memcpy(to, truth.scan.points_lidar[i].data(), 12);
    to[16] = static_cast<std::uint8_t>(truth.scan.intensity[i]);
    std::memcpy(to + 18, &truth.scan.ring[i], 2);
    std::memcpy(to + 20, &truth.raw_labels[i], 4);
    std::memcpy(to + 24, &time, 8);
  }
  return cloud;
}

enum class Encoding { ascii, binary, binary_compressed };

void write_with_pcl(const std::filesystem::path& file, const pcl::PCLPointCloud2& cloud,
                    Encoding encoding) {
  const Eigen::Vector4f origin = Eigen::Vector4f::Zero();
  const Eigen::Quaternionf orientation = Eigen::Quaternionf::Identity();
  pcl::PCDWriter writer;
  switch (encoding) {
    case Encoding::ascii:
      ASSERT_EQ(writer.writeASCII(file.string(), cloud, origin, orientation, 10), 0);
      break;
    case Encoding::binary:
      ASSERT_EQ(writer.writeBinary(file.string(), cloud, origin, orientation), 0);
      break;
    case Encoding::binary_compressed:
      ASSERT_EQ(writer.writeBinaryCompressed(file.string(), cloud, origin, orientation), 0);
      break;
  }
}

class PclFile : public testing::TestWithParam<Encoding> {};

TEST_P(PclFile, IsReadAsPclWroteIt) {
  const ScratchFolder folder;
  const std::filesystem::path file = folder.path() / "a.pcd";
  const Truth truth = random_scan();
  write_with_pcl(file, pcl_cloud(truth), GetParam());
  const CloudFile read = read_point_cloud(file, 0);
  EXPECT_EQ(read.scan.points_lidar, truth.scan.points_lidar);
  EXPECT_EQ(read.scan.intensity, truth.scan.intensity);
  EXPECT_EQ(read.scan.ring, truth.scan.ring);
  EXPECT_EQ(read.raw_labels, truth.raw_labels);
  ASSERT_EQ(read.scan.time_offset_s.size(), points);
  for (std::size_t i = 0; i < points; ++i) {
    EXPECT_NEAR(read.scan.time_offset_s[i], truth.scan.time_offset_s[i], 1e-7F);
  }
}

std::string name_of(const testing::TestParamInfo<Encoding>& info) {
  constexpr const char* names[] = {"Ascii", "Binary", "BinaryCompressed"};
  return names[static_cast<std::size_t>(info.param)];
}

INSTANTIATE_TEST_SUITE_P(PointCloudFiles, PclFile,
                         testing::Values(Encoding::ascii, Encoding::binary,
                                         Encoding::binary_compressed),
                         name_of);

TEST(PointCloudFilesOfOurs, PclReadsWhatWeWrite) {
  const ScratchFolder folder;
  const std::filesystem::path file = folder.path() / "map.pcd";
  const std::vector<ColouredPoint> written{
      {.position = {1.0F, -2.0F, 3.5F}, .label = SemanticClass::road, .confidence = 0.25F},
      {.position = {4.0F, 5.0F, 6.0F}, .label = SemanticClass::pole, .confidence = 0.75F}};
  write_pcd(file, written);
  pcl::PCLPointCloud2 cloud;
  ASSERT_EQ(pcl::PCDReader().read(file.string(), cloud), 0);
  ASSERT_EQ(std::size_t{cloud.width} * cloud.height, written.size());
  for (std::size_t i = 0; i < written.size(); ++i) {
    Eigen::Vector3f position;
    std::memcpy(position.data(), cloud.data.data() + i * cloud.point_step, 12);
    EXPECT_EQ(position, written[i].position);
  }
}

}  // namespace
}  // namespace stillmap
