#include "core/occupancy/octomap_file.hpp"

#include <gmock/gmock.h>
#include <octomap/OcTree.h>

#include <random>
#include <sstream>

#include "core/occupancy/occupancy_map.hpp"
#include "tests/occupancy/random_scans.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

OccupancyMap some_map() {
  OccupancyMap map(OccupancyConfig{});
  for (std::uint32_t seed = 0; seed < 4; ++seed) {
    const PlacedScan placed = random_scan(seed, 2000, 8.0);
    map.insert(placed.scan, placed.T_map_lidar);
  }
  return map;
}

class OctomapFile : public testing::TestWithParam<const char*> {
 protected:
  [[nodiscard]] bool is_binary() const { return std::string(GetParam()) == "map.bt"; }
  [[nodiscard]] OctomapEncoding encoding() const {
    return is_binary() ? OctomapEncoding::binary : OctomapEncoding::full;
  }
  [[nodiscard]] std::filesystem::path file() const { return folder_ / GetParam(); }
  ScratchFolder folder_;
  OccupancyMap map_ = some_map();
};

INSTANTIATE_TEST_SUITE_P(Kinds, OctomapFile, testing::Values("map.bt", "map.ot"),
                         [](const auto& tested) { return std::string(tested.param + 4, 2); });

TEST_P(OctomapFile, ComesBackWithTheSameAnswers) {
  write_octomap_file(file(), map_.encode(encoding()));
  const OccupancyMap back(read_octomap_file(file()));
  EXPECT_EQ(back.resolution_m(), map_.resolution_m());
  for (const Eigen::Vector3f& p : random_scan(77, 5000, 9.0).scan.scan.points_lidar) {
    const PointOccupancy before = map_.at_point(p.cast<double>());
    const PointOccupancy after = back.at_point(p.cast<double>());
    ASSERT_EQ(after.occupancy, before.occupancy);
    ASSERT_TRUE(is_binary() || after.probability == before.probability);
  }
  EXPECT_EQ(back.encode(encoding()).bytes, map_.encode(encoding()).bytes);
}

TEST_P(OctomapFile, IsReadByOctoMapItself) {
  write_octomap_file(file(), map_.encode(encoding()));
  octomap::OcTree binary(1.0);
  std::unique_ptr<octomap::AbstractOcTree> full;
  const octomap::OcTree* read = &binary;
  if (is_binary()) {
    ASSERT_TRUE(binary.readBinary(file().string()));
  } else {
    full.reset(octomap::AbstractOcTree::read(file().string()));
    read = dynamic_cast<octomap::OcTree*>(full.get());
  }
  ASSERT_NE(read, nullptr);
  EXPECT_EQ(read->getResolution(), 0.2);
  EXPECT_EQ(read->size(), read->calcNumNodes());
  std::uint64_t occupied = 0;
  for (auto leaf = read->begin_leafs(); leaf != read->end_leafs(); ++leaf) {
    const auto side = static_cast<std::uint64_t>(1) << (16U - leaf.getDepth());
    if (read->isNodeOccupied(*leaf)) occupied += side * side * side;
  }
  const Eigen::Vector3d corner = Eigen::Vector3d::Constant(50.0);
  EXPECT_EQ(occupied, map_.in_box({-corner, corner}, 0).occupied);
}

TEST_P(OctomapFile, OfAnEmptyMapIsAnEmptyMap) {
  write_octomap_file(file(), OccupancyMap(OccupancyConfig{}).encode(encoding()));
  EXPECT_EQ(OccupancyMap(read_octomap_file(file())).size().nodes, 0U);
}

TEST_P(OctomapFile, ReplacesAnOldFileAndLeavesNothingBeside) {
  static_cast<void>(folder_.file(GetParam(), "old"));
  write_octomap_file(file(), map_.encode(encoding()));
  EXPECT_EQ(read_octomap_file(file()).bytes, map_.encode(encoding()).bytes);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_.path()), {}), 1);
}

TEST_P(OctomapFile, ThatIsDamagedIsRefusedByName) {
  write_octomap_file(file(), map_.encode(encoding()));
  const std::string whole = content_of(file());
  const auto refusal = [&](const std::string& content) {
    static_cast<void>(folder_.file(GetParam(), content));
    const std::string said =
        message_of<MapFileError>([&] { static_cast<void>(read_octomap_file(file())); });
    EXPECT_THAT(said, HasSubstr(file().string()));
    return said;
  };
  EXPECT_THAT(refusal(""), HasSubstr("does not begin with"));
  EXPECT_THAT(refusal(whole.substr(0, 60)), HasSubstr("damaged"));
  EXPECT_THAT(refusal(whole.substr(0, whole.size() / 2)), HasSubstr("damaged"));
  EXPECT_THAT(refusal(whole.substr(0, whole.size() - 1)), HasSubstr("middle of a node"));
  EXPECT_THAT(refusal(whole + "x"), HasSubstr("1 bytes follow"));
  const std::size_t data = whole.find("data\n") + 5;
  EXPECT_THAT(refusal(whole.substr(0, data) + std::string(100'000, '\xFF')), HasSubstr("damaged"));
  std::string other = whole;
  other.replace(other.find("id OcTree"), 9, "id Colour");
  EXPECT_THAT(refusal(other), HasSubstr("type 'Colour'"));
  other = whole;
  other.replace(other.find("res 0.2"), 7, "res -.2");
  EXPECT_THAT(refusal(other), HasSubstr("resolution"));
}

TEST_P(OctomapFile, WithRandomFaultsNeverDoesHarm) {
  const OctomapData good = map_.encode(encoding());
  std::mt19937 generator(3);
  std::uniform_int_distribution<std::size_t> place(0, good.bytes.size() - 1);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < 300; ++i) {
    OctomapData bad = good;
    bad.bytes[place(generator)] = static_cast<char>(byte(generator));
    if (i % 3 == 0) bad.bytes.resize(place(generator));
    try {
      const OccupancyMap map(bad);
      static_cast<void>(map.along_ray({}));
    } catch (const std::invalid_argument& fault) {
      EXPECT_THAT(fault.what(), HasSubstr("damaged"));
    }
  }
}

TEST(OctomapFileName, DecidesTheKind) {
  EXPECT_EQ(octomap_encoding_of("a/b.bt"), OctomapEncoding::binary);
  EXPECT_EQ(octomap_encoding_of("b.ot"), OctomapEncoding::full);
  EXPECT_THAT(message_of<MapFileError>([] { static_cast<void>(octomap_encoding_of("b.ply")); }),
              HasSubstr("b.ply: the name must end in .bt"));
}

TEST(OctomapFileThatCannotBe, IsNamed) {
  const ScratchFolder folder;
  EXPECT_THAT(
      message_of<MapFileError>([&] { static_cast<void>(read_octomap_file(folder / "none.bt")); }),
      HasSubstr("none.bt: cannot be read"));
  EXPECT_THAT(message_of<MapFileError>([&] {
                write_octomap_file(folder / "no" / "map.bt",
                                   some_map().encode(OctomapEncoding::binary));
              }),
              HasSubstr("cannot be written"));
}

TEST_P(OctomapFile, OfOtherProgramsIsReadWhateverItsResolution) {
  for (const double resolution_m : {0.01, 25.0}) {
    octomap::OcTree tree(resolution_m);
    tree.updateNode(octomap::point3d(0.0F, 0.0F, 0.0F), true);
    is_binary() ? tree.writeBinary(file().string()) : tree.write(file().string());
    const OccupancyMap map(read_octomap_file(file()));
    EXPECT_EQ(map.resolution_m(), resolution_m);
    const Eigen::Vector3d p_map = Eigen::Vector3d::Constant(0.5 * resolution_m);
    EXPECT_EQ(map.at_point(p_map).occupancy, Occupancy::occupied);
  }
  // What would be no resolution is still refused, by the file's name.
  OctomapData none = map_.encode(encoding());
  none.resolution_m = 1e-300;
  write_octomap_file(file(), none);
  EXPECT_THAT(message_of<MapFileError>([&] { static_cast<void>(read_octomap_file(file())); }),
              HasSubstr(std::string(GetParam()) + ": is damaged: a resolution of"));
}

}  // namespace
}  // namespace stillmap::test
