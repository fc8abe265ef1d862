#include "core/dataset/point_cloud_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <random>

#include "core/dataset/dataset_error.hpp"
#include "tests/file_size_limit.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::FloatNear;
using testing::HasSubstr;

template <class... Values>
std::string packed(Values... values) {
  std::string bytes;
  const auto add = [&](const auto& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  (add(values), ...);
  return bytes;
}

std::string pcd_header(const std::string& fields, const std::string& sizes,
                       const std::string& types, const std::string& counts, int points,
                       const std::string& data) {
  const std::string n = std::to_string(points);
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS " + fields + "\nSIZE " +
         sizes + "\nTYPE " + types + "\nCOUNT " + counts + "\nWIDTH " + n +
         "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + n + "\nDATA " + data + "\n";
}

const std::string ascii_pcd =
    pcd_header("x y z intensity", "4 4 4 4", "F F F F", "1 1 1 1", 2, "ascii") +
    "1 2 3 0.5\n-4 -5 -6 0.25\n";

std::string binary_ply(const std::string& count = "2") {
  return "ply\nformat binary_little_endian 1.0\nelement vertex " + count +
         "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar intensity\n"
         "end_header\n" +
         packed(1.0F, 2.0F, 3.0F, std::uint8_t{255}) + packed(4.0F, 5.0F, 6.0F, std::uint8_t{51});
}

TEST(PointCloudFiles, ReadsAnAsciiPcd) {
  const ScratchFolder folder;
  const CloudFile cloud = read_point_cloud(folder.file("a.pcd", ascii_pcd), 77);
  EXPECT_EQ(cloud.scan.stamp_ns, 77);
  EXPECT_THAT(cloud.scan.points_lidar,
              ElementsAre(Eigen::Vector3f(1, 2, 3), Eigen::Vector3f(-4, -5, -6)));
  EXPECT_THAT(cloud.scan.intensity, ElementsAre(0.5F, 0.25F));
  EXPECT_TRUE(cloud.raw_labels.empty());
}

TEST(PointCloudFiles, ReadsAllFieldsAndPassesOverPadding) {
  const ScratchFolder folder;
  const std::string body = pcd_header("x y z _ intensity ring _ time label", "4 4 4 1 4 2 1 4 4",
                                      "F F F U F U U F U", "1 1 1 4 1 1 10 1 1", 2, "binary") +
                           packed(1.0F, 2.0F, 3.0F, 0U, 90.0F, std::uint16_t{5}) +
                           std::string(10, '\0') + packed(-0.05F, (9U << 16U) | 252U) +
                           packed(4.0F, 5.0F, 6.0F, 0U, 7.0F, std::uint16_t{15}) +
                           std::string(10, '\0') + packed(0.05F, 40U);
  const CloudFile cloud = read_point_cloud(folder.file("a.pcd", body), 0);
  EXPECT_THAT(cloud.scan.points_lidar,
              ElementsAre(Eigen::Vector3f(1, 2, 3), Eigen::Vector3f(4, 5, 6)));
  EXPECT_THAT(cloud.scan.intensity, ElementsAre(90.0F, 7.0F));
  EXPECT_THAT(cloud.scan.ring, ElementsAre(5, 15));
  EXPECT_THAT(cloud.scan.time_offset_s, ElementsAre(-0.05F, 0.05F));
  EXPECT_THAT(cloud.raw_labels, ElementsAre((9U << 16U) | 252U, 40U));
}

TEST(PointCloudFiles, ReadsCoordinatesByTheirNamesAndSigns) {
  const ScratchFolder folder;
  PointFieldNames names;
  names.x = {"z"};
  names.y = {"-left", "-x"};
  names.z = {"y"};
  const CloudFile cloud = read_point_cloud(folder.file("a.pcd", ascii_pcd), 0, names);
  EXPECT_THAT(cloud.scan.points_lidar,
              ElementsAre(Eigen::Vector3f(3, -1, 2), Eigen::Vector3f(-6, 4, -5)));
  EXPECT_THAT(cloud.format, testing::StartsWith("x from z, y from -left, z from y, intensity"));
  names.y = {"-left"};
  EXPECT_THAT(message_of<DatasetError>(
                  [&] { (void)read_point_cloud(folder.file("a.pcd", ascii_pcd), 0, names); }),
              HasSubstr("has no fields x, y and z"));
}

TEST(PointCloudFiles, SaysThatCarlasOwnAreMirrored) {
  const ScratchFolder folder;
  const auto format_of = [&](const std::string& properties, const std::string& point,
                             const PointFieldNames& names = {}) {
    const std::string text =
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float32 x\n"
        "property float32 y\nproperty float32 z\n" +
        properties + "end_header\n" + point + "\n";
    return read_point_cloud(folder.file("a.ply", text), 0, names).format;
  };
  const std::string intensity = "property float32 I\n";
  const std::string semantic =
      "property float32 CosAngle\nproperty uint32 ObjIdx\nproperty uint32 ObjTag\n";
  EXPECT_THAT(format_of(intensity, "1 2 3 0.9"), HasSubstr("the map is mirrored"));
  EXPECT_THAT(format_of(semantic, "1 2 3 0.5 7 14"), HasSubstr("the map is mirrored"));
  EXPECT_THAT(format_of("property float32 i\n", "1 2 3 0.9"), testing::Not(HasSubstr("mirrored")));
  PointFieldNames names;
  names.y = {"-y"};
  EXPECT_EQ(format_of(intensity, "1 2 3 0.9", names),
            "x from x, y from -y, z from z, intensity from I (float32), no time, no ring");
}

TEST(PointCloudFiles, LeavesLabelsOutThatFloatsHaveRounded) {
  const ScratchFolder folder;
  const auto labels_from = [&](float label) {
    const std::string header =
        pcd_header("x y z label", "4 4 4 4", "F F F F", "1 1 1 1", 1, "binary");
    const std::string body = header + packed(1.0F, 2.0F, 3.0F, label);
    return read_point_cloud(folder.file("a.pcd", body), 0).raw_labels;
  };
  EXPECT_THAT(labels_from(255.0F * 65536.0F + 50.0F), ElementsAre((255U << 16U) | 50U));
  EXPECT_THAT(labels_from(256.0F * 65536.0F), testing::IsEmpty());
}

TEST(PointCloudFiles, ReadsNanosecondOffsetsAndAbsoluteDoubles) {
  const ScratchFolder folder;
  const auto nanoseconds = folder.file(
      "t.pcd", pcd_header("x y z t", "4 4 4 4", "F F F U", "1 1 1 1", 2, "binary") +
                   packed(1.0F, 2.0F, 3.0F, 0U) + packed(4.0F, 5.0F, 6.0F, 50'000'000U));
  EXPECT_THAT(read_point_cloud(nanoseconds, 0).scan.time_offset_s, ElementsAre(0.0F, 0.05F));
  const auto absolute = folder.file(
      "timestamp.pcd", pcd_header("x y z timestamp", "4 4 4 8", "F F F F", "1 1 1 1", 2, "binary") +
                           packed(1.0F, 2.0F, 3.0F, 1.6e9) + packed(4.0F, 5.0F, 6.0F, 1.6e9 + 0.1));
  EXPECT_THAT(read_point_cloud(absolute, 1'600'000'000'000'000'000).scan.time_offset_s,
              ElementsAre(FloatNear(0.0F, 1e-6F), FloatNear(0.1F, 1e-6F)));
}

/// LZF without any compression: runs of up to 32 bytes, each after its length less one.
std::string lzf_literals(std::string_view bytes) {
  std::string packed_bytes;
  for (; !bytes.empty(); bytes.remove_prefix(std::min<std::size_t>(32, bytes.size()))) {
    const std::string_view run = bytes.substr(0, 32);
    packed_bytes += static_cast<char>(run.size() - 1);
    packed_bytes += run;
  }
  return packed_bytes;
}

/// x of all points, then y, then z, ring: as binary_compressed stores them.
std::string compressed_pcd() {
  const std::string columns = packed(1.0F, 4.0F, 2.0F, 5.0F, 3.0F, 6.0F) + std::string(8, '\7') +
                              packed(std::uint16_t{3}, std::uint16_t{9});
  const std::string body = lzf_literals(columns);
  return pcd_header("x y z _ ring", "4 4 4 1 2", "F F F U U", "1 1 1 4 1", 2, "binary_compressed") +
         packed(static_cast<std::uint32_t>(body.size()),
                static_cast<std::uint32_t>(columns.size())) +
         body;
}

TEST(PointCloudFiles, ReadsACompressedPcd) {
  const ScratchFolder folder;
  const CloudFile cloud = read_point_cloud(folder.file("a.pcd", compressed_pcd()), 0);
  EXPECT_THAT(cloud.scan.points_lidar,
              ElementsAre(Eigen::Vector3f(1, 2, 3), Eigen::Vector3f(4, 5, 6)));
  EXPECT_THAT(cloud.scan.ring, ElementsAre(3, 9));
}

TEST(PointCloudFiles, ReadsABigEndianPly) {
  const ScratchFolder folder;
  const auto big = [](float value) {
    std::string bytes = packed(value);
    std::ranges::reverse(bytes);
    return bytes;
  };
  const auto file = folder.file("a.ply",
                                "ply\nformat binary_big_endian 1.0\nelement vertex 1\n"
                                "property float x\nproperty float y\nproperty float z\n"
                                "end_header\n" +
                                    big(1.0F) + big(-2.5F) + big(3.0F));
  EXPECT_THAT(read_point_cloud(file, 0).scan.points_lidar,
              ElementsAre(Eigen::Vector3f(1, -2.5F, 3)));
}

TEST(PointCloudFiles, ReadsPlyWithByteIntensity) {
  const ScratchFolder folder;
  const CloudFile cloud = read_point_cloud(folder.file("a.ply", binary_ply()), 0);
  EXPECT_THAT(cloud.scan.points_lidar,
              ElementsAre(Eigen::Vector3f(1, 2, 3), Eigen::Vector3f(4, 5, 6)));
  EXPECT_THAT(cloud.scan.intensity, ElementsAre(255.0F, 51.0F));
}

TEST(PointCloudFiles, ReadsAnAsciiPlyWithFaces) {
  const ScratchFolder folder;
  const auto file = folder.file(
      "a.ply",
      "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty float z\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n0 0 1\n1 0 1\n0 1 1\n3 0 1 2\n");
  EXPECT_EQ(read_point_cloud(file, 0).scan.size(), 3U);
}

TEST(PointCloudFiles, PassesNanPointsOn) {
  const ScratchFolder folder;
  const auto file = folder.file(
      "a.pcd", pcd_header("x y z", "4 4 4", "F F F", "1 1 1", 2, "ascii") + "nan nan nan\n1 2 3\n");
  const Scan scan = read_point_cloud(file, 0).scan;
  ASSERT_EQ(scan.size(), 2U);
  EXPECT_TRUE(std::isnan(scan.points_lidar[0].x()));
}

TEST(PointCloudFiles, AWrittenMapComesBack) {
  const ScratchFolder folder;
  std::vector<ColouredPoint> points;
  for (std::size_t i = 0; i < semantic_class_count; ++i) {
    points.push_back({.position = Eigen::Vector3f(static_cast<float>(i), -1.5F, 0.125F),
                      .label = static_cast<SemanticClass>(i),
                      .confidence = 0.75F});
  }
  write_pcd(folder.path() / "map.pcd", points);
  write_ply(folder.path() / "map.ply", points);
  for (const char* name : {"map.pcd", "map.ply"}) {
    const CloudFile back = read_point_cloud(folder.path() / name, 0);
    ASSERT_EQ(back.scan.size(), points.size()) << name;
    ASSERT_EQ(back.raw_labels.size(), points.size()) << name;
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(back.scan.points_lidar[i], points[i].position) << name;
      EXPECT_EQ(class_from_semantic_kitti(static_cast<std::uint16_t>(back.raw_labels[i])),
                points[i].label);
    }
  }
  const std::string ply = content_of(folder.path() / "map.ply");
  const Rgb last = colour(points.back().label);
  EXPECT_EQ(static_cast<std::uint8_t>(ply[ply.size() - 11]), last.r);
  EXPECT_EQ(static_cast<std::uint8_t>(ply[ply.size() - 10]), last.g);
  EXPECT_EQ(static_cast<std::uint8_t>(ply[ply.size() - 9]), last.b);
}

TEST(PointCloudFiles, AnEmptyMapCanBeWrittenAndRead) {
  const ScratchFolder folder;
  write_pcd(folder.path() / "map.pcd", {});
  write_ply(folder.path() / "map.ply", {});
  EXPECT_TRUE(read_point_cloud(folder.path() / "map.pcd", 0).scan.empty());
  EXPECT_TRUE(read_point_cloud(folder.path() / "map.ply", 0).scan.empty());
  EXPECT_THROW(write_ply(folder.path() / "no" / "map.ply", {}), DatasetError);
}

TEST(PointCloudFiles, AMapThatFindsNoRoomLeavesTheOneBeforeIt) {
  const ScratchFolder folder;
  const std::filesystem::path file = folder.path() / "map.ply";
  write_ply(file, std::vector<ColouredPoint>(3));
  const std::string before = content_of(file);
  {
    const FileSizeLimit limit(10'000);
    EXPECT_THROW(write_ply(file, std::vector<ColouredPoint>(1000)), DatasetWriteError);
  }
  EXPECT_EQ(content_of(file), before);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
  // What a link leads to is replaced, not the link.
  const std::filesystem::path link = folder.path() / "link.ply";
  std::filesystem::create_symlink(file, link);
  write_ply(link, std::vector<ColouredPoint>(5));
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_EQ(read_point_cloud(file, 0).scan.size(), 5U);
}

TEST(PointCloudFiles, FaultsNameFileAndReason) {
  const ScratchFolder folder;
  const auto message = [&](const std::string& name, const std::string& content) {
    const auto file = folder.file(name, content);
    const std::string text = message_of<DatasetError>([&] { (void)read_point_cloud(file, 0); });
    EXPECT_THAT(text, HasSubstr(name));
    return text;
  };
  const auto pcd = [](const std::string& from, const std::string& to) {
    std::string text = ascii_pcd;
    return text.replace(text.find(from), from.size(), to);
  };
  message("empty.pcd", "");
  message("empty.ply", "");
  EXPECT_THAT(message("width.pcd", pcd("WIDTH 2", "WIDTH 999999999")), HasSubstr("999999999"));
  EXPECT_THAT(message("points.pcd", pcd("POINTS 2", "POINTS 3")), HasSubstr("POINTS 3"));
  EXPECT_THAT(message("negative.pcd", pcd("WIDTH 2", "WIDTH -2")), HasSubstr("WIDTH"));
  EXPECT_THAT(message("overflow.pcd", pcd("WIDTH 2", "WIDTH 18446744073709551618")),
              HasSubstr("WIDTH"));
  EXPECT_THAT(message("size.pcd", pcd("SIZE 4 4 4 4", "SIZE 4 4 4 3")), HasSubstr("SIZE 3"));
  EXPECT_THAT(message("lists.pcd", pcd("SIZE 4 4 4 4", "SIZE 4 4 4")), HasSubstr("SIZE"));
  EXPECT_THAT(message("data.pcd", pcd("DATA ascii", "DATA morse")), HasSubstr("morse"));
  EXPECT_THAT(message("fields.pcd", pcd("FIELDS x y z", "FIELDS a b c")), HasSubstr("x, y and z"));
  EXPECT_THAT(message("noheader.pcd", "1 2 3\n4 5 6\n"), HasSubstr("DATA"));
  EXPECT_THAT(message("count.ply", binary_ply("3")), HasSubstr("truncated"));
  EXPECT_THAT(message("huge.ply", binary_ply("999999999")), HasSubstr("999999999"));
  EXPECT_THAT(message("minus.ply", binary_ply("-1")), HasSubstr("-1"));
  EXPECT_THAT(message("list.ply",
                      "ply\nformat ascii 1.0\nelement vertex 1\n"
                      "property list uchar int x\nend_header\n1 2\n"),
              HasSubstr("list"));
  EXPECT_THAT(message("text.ply",
                      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                      "property float y\nproperty float z\nend_header\n1 2 up\n"),
              HasSubstr("no number for z"));
}

TEST(PointCloudFiles, ACutBinaryPcdIsTruncated) {
  const ScratchFolder folder;
  write_pcd(folder.path() / "map.pcd", std::vector<ColouredPoint>(100));
  const std::string whole = content_of(folder.path() / "map.pcd");
  const auto file = folder.file("cut.pcd", std::string_view(whole).substr(0, whole.size() - 1));
  EXPECT_THAT(message_of<DatasetError>([&] { (void)read_point_cloud(file, 0); }),
              AllOf(HasSubstr("cut.pcd"), HasSubstr("truncated")));
}

/// Bytes changed, cut out and cut off at random: a scan or a DatasetError, never anything else.
void survives_damage(const std::string& name, const std::string& whole, unsigned seed) {
  const ScratchFolder folder;
  std::mt19937 random(seed);
  int read = 0, refused = 0;
  for (int round = 0; round < 400; ++round) {
    std::string damaged = whole;
    for (unsigned k = 0; k <= random() % 4; ++k) {
      const std::size_t place = random() % damaged.size();
      if (random() % 8 == 0) damaged.resize(place + 1);
      if (random() % 4 == 0) damaged.erase(place / 2, random() % 5);
      if (!damaged.empty()) damaged[place % damaged.size()] = static_cast<char>(random() % 256);
      if (damaged.empty()) break;
    }
    const auto file = folder.file(name, damaged);
    try {
      const CloudFile cloud = read_point_cloud(file, 0);
      EXPECT_TRUE(cloud.scan.intensity.empty() || cloud.scan.intensity.size() == cloud.scan.size());
      ++read;
    } catch (const DatasetError&) {
      ++refused;
    }
  }
  EXPECT_GT(read, 0) << name;
  EXPECT_GT(refused, 0) << name;
}

TEST(PointCloudFiles, SurviveRandomDamage) {
  const ScratchFolder folder;
  write_pcd(folder.path() / "a.pcd", std::vector<ColouredPoint>(20));
  survives_damage("binary.pcd", content_of(folder.path() / "a.pcd"), 1);
  survives_damage("ascii.pcd", ascii_pcd, 2);
  survives_damage("compressed.pcd", compressed_pcd(), 5);
  survives_damage("binary.ply", binary_ply(), 3);
  survives_damage("faces.ply",
                  "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                  "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                  "end_header\n0 0 1\n1 0 1\n0 1 1\n3 0 1 2\n",
                  4);
}

TEST(PointCloudFiles, RefuseGarbage) {
  const ScratchFolder folder;
  std::mt19937 random(6);
  for (int round = 0; round < 100; ++round) {
    std::string garbage(random() % 2000, '\0');
    for (char& byte : garbage) byte = static_cast<char>(random() % 256);
    EXPECT_THROW((void)read_point_cloud(folder.file("g.pcd", garbage), 0), DatasetError);
    EXPECT_THROW((void)read_point_cloud(folder.file("g.ply", garbage), 0), DatasetError);
  }
}

}  // namespace
}  // namespace stillmap
