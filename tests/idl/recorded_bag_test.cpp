#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <set>
#include <tuple>

#include "core/dataset/point_cloud_files.hpp"
#include "idl/bag/bag_scan_source.hpp"
#include "tests/idl/bag_fixture.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

/// A bag that ROS 2 Humble recorded, with one of its scans as another decoder made it.
class RecordedBag : public testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("STILLMAP_TEST_DATA");
    if (folder == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA names no folder of recordings";
    folder_ = fs::path(folder) / "vlp16_packets";
    bag_ = folder_ / "1673400471837873222";
  }

  fs::path folder_;
  fs::path bag_;
};

std::string schema_of(const fs::path& file) {
  SQLite::Database database(file.string(), SQLite::OPEN_READONLY);
  SQLite::Statement query(database, "SELECT sql FROM sqlite_master ORDER BY name");
  std::string schema;
  while (query.executeStep()) schema += query.getColumn(0).getString() + "\n";
  SQLite::Statement version(database, "SELECT schema_version || ros_distro FROM schema");
  return version.executeStep() ? schema + version.getColumn(0).getString() : schema;
}

/// Names of all fields, nested ones below their parent's.
void add_names(const YAML::Node& node, const std::string& parent, std::set<std::string>& names) {
  if (node.IsSequence()) {
    for (const YAML::Node& entry : node) add_names(entry, parent + "[]", names);
  }
  if (!node.IsMap()) return;
  for (const auto& entry : node) {
    const std::string name = parent + "/" + entry.first.as<std::string>();
    names.insert(name);
    add_names(entry.second, name, names);
  }
}

std::set<std::string> names_in(const fs::path& file) {
  std::set<std::string> names;
  add_names(YAML::LoadFile(file.string()), "", names);
  return names;
}

/// Of bags that ROS 2 Humble records.
constexpr const char* humble_schema =
    "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT "
    "NULL, data BLOB NOT NULL)\n"
    "CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT "
    "NOT NULL)\n"
    "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL)\n"
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC)\n"
    "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT "
    "NULL,serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL)\n"
    "3humble";

std::set<std::string> humble_metadata() {
  std::set<std::string> names{"/rosbag2_bagfile_information"};
  for (const char* name : {"compression_format",
                           "compression_mode",
                           "duration",
                           "duration/nanoseconds",
                           "files",
                           "files[]/duration",
                           "files[]/duration/nanoseconds",
                           "files[]/message_count",
                           "files[]/path",
                           "files[]/starting_time",
                           "files[]/starting_time/nanoseconds_since_epoch",
                           "message_count",
                           "relative_file_paths",
                           "starting_time",
                           "starting_time/nanoseconds_since_epoch",
                           "storage_identifier",
                           "topics_with_message_count",
                           "topics_with_message_count[]/message_count",
                           "topics_with_message_count[]/topic_metadata",
                           "topics_with_message_count[]/topic_metadata/name",
                           "topics_with_message_count[]/topic_metadata/offered_qos_profiles",
                           "topics_with_message_count[]/topic_metadata/serialization_format",
                           "topics_with_message_count[]/topic_metadata/type",
                           "version"})
    names.insert("/rosbag2_bagfile_information/" + std::string(name));
  return names;
}

TEST(WrittenBag, HasTheTablesAndMetadataOfHumble) {
  const ScratchFolder folder;
  write_bag(folder / "ours", {bag_message(0)});
  EXPECT_EQ(schema_of(folder / "ours" / "ours_0.db3"), humble_schema);
  EXPECT_EQ(names_in(folder / "ours" / "metadata.yaml"), humble_metadata());
}

TEST_F(RecordedBag, HasTheTablesAndMetadataOfHumble) {
  EXPECT_EQ(schema_of(bag_ / "1673400471837873222_0.db3"), humble_schema);
  EXPECT_EQ(names_in(bag_ / "metadata.yaml"), humble_metadata());
}

/// Finds the nearest of many points within a quarter of a metre.
class PointsByPlace {
 public:
  void add(const Scan& scan) {
    for (const auto& p : scan.points_lidar) cells_[cell(p)].push_back(p);
  }
  [[nodiscard]] float distance_to(const Eigen::Vector3f& p) const {
    float nearest = INFINITY;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3f side((corner & 1) != 0 ? 1.0F : -1.0F, (corner & 2) != 0 ? 1.0F : -1.0F,
                                 (corner & 4) != 0 ? 1.0F : -1.0F);
      const auto found = cells_.find(cell(p + 0.25F * side));
      if (found == cells_.end()) continue;
      for (const auto& q : found->second) nearest = std::min(nearest, (q - p).norm());
    }
    return nearest;
  }

 private:
  using Cell = std::tuple<long, long, long>;
  [[nodiscard]] static Cell cell(const Eigen::Vector3f& p) {
    return {std::lround(2.0F * p.x()), std::lround(2.0F * p.y()), std::lround(2.0F * p.z())};
  }
  std::map<Cell, std::vector<Eigen::Vector3f>> cells_;
};

TEST_F(RecordedBag, ItsPacketsGiveThePointsOfAnotherDecoder) {
  const ScanDataset dataset = open_sequence(bag_);
  ASSERT_EQ(dataset.size(), 4U);
  EXPECT_EQ(dataset.suggested_sensor().name, "VLP-16");
  // Theirs is cut at another azimuth: the points lie in several of our scans.
  PointsByPlace ours;
  for (std::size_t i = 0; i < dataset.size(); ++i) ours.add(dataset.read(i).scan);
  const Scan theirs = read_point_cloud(folder_ / "1673400472138016708.pcd", 0).scan;
  ASSERT_EQ(theirs.size(), 14831U);
  // Their azimuth stands still during some blocks, by up to 0.4 degrees.
  std::size_t equal = 0;
  for (const auto& p : theirs.points_lidar) {
    const float distance = ours.distance_to(p);
    EXPECT_LT(distance, 0.06F) << p.transpose();
    equal += distance < 0.01F ? 1U : 0U;
  }
  EXPECT_GT(static_cast<double>(equal), 0.95 * static_cast<double>(theirs.size()));
}

}  // namespace
}  // namespace stillmap::dds
