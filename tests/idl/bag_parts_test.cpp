// Bags of which a part is packed, missing, damaged or not of the bag: what is there is read, and
// what is left out is told.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <zstd.h>

#include <cstdlib>
#include <fstream>

#include "core/dataset/dataset_error.hpp"
#include "core/process/temporary_folder.hpp"
#include "idl/bag/bag_scan_source.hpp"
#include "tests/idl/bag_fixture.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string open_fault(const fs::path& path) {
  return message_of<DatasetError>([&] { (void)open_sequence(path); });
}

Bytes zstd_frame(std::span<const std::uint8_t> content) {
  Bytes frame(ZSTD_compressBound(content.size()));
  frame.resize(ZSTD_compress(frame.data(), frame.size(), content.data(), content.size(), 1));
  return frame;
}

/// Puts the packed file in the place of the file, which stays where `keeps_file`.
void pack(const fs::path& file, bool keeps_file = false) {
  const std::string content = content_of(file);
  const Bytes frame =
      zstd_frame({reinterpret_cast<const std::uint8_t*>(content.data()), content.size()});
  std::ofstream(file.string() + ".zstd", std::ios::binary)
      .write(reinterpret_cast<const char*>(frame.data()),
             static_cast<std::streamsize>(frame.size()));
  if (!keeps_file) fs::remove(file);
}

/// Three parts of two scans each, "f_0" to "f_2", and no metadata.
class BagPartsTest : public testing::Test {
 protected:
  void write_parts(BagFormat format = BagFormat::sqlite) {
    ending_ = format == BagFormat::sqlite ? ".db3" : ".mcap";
    fs::create_directories(bag_);
    for (int part = 0; part < 3; ++part) {
      const std::string name = "f_" + std::to_string(part);
      {
        BagWriter writer(folder_ / name, {cloud_topic("/points")}, format, mcap::Compression::none);
        for (const int k : {2 * part, 2 * part + 1})
          writer.add(0, bag_scan(k).stamp_ns, bag_message(k));
        writer.finish();
      }
      fs::rename(folder_ / name / (name + "_0" + ending_), file(part));
    }
  }
  [[nodiscard]] fs::path file(int part) const {
    return bag_ / ("f_" + std::to_string(part) + ending_);
  }
  void write_metadata(const std::vector<int>& parts) const {
    BagMetadata metadata;
    metadata.storage = ending_ == ".db3" ? "sqlite3" : "mcap";
    for (const int part : parts) metadata.files.push_back(file(part).filename().string());
    write_bag_metadata(bag_ / "metadata.yaml", metadata);
  }
  /// By the numbers of the scans.
  void expect_scans(const Recording& recording, const std::vector<int>& numbers) {
    ASSERT_EQ(recording.dataset.size(), numbers.size());
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      EXPECT_EQ(recording.dataset.stamp_ns(i), bag_scan(numbers[i]).stamp_ns);
      EXPECT_EQ(recording.dataset.read(i).scan.points_lidar, bag_scan(numbers[i]).points_lidar);
    }
  }

  ScratchFolder folder_;
  fs::path bag_ = folder_ / "bag";
  std::string ending_;
};

// The recorder packs a part once it is full; killed, it leaves the last one and no metadata.
TEST_F(BagPartsTest, PackedPartsAreReadWithThoseThatAreNot) {
  for (const BagFormat format : {BagFormat::sqlite, BagFormat::mcap}) {
    fs::remove_all(folder_.path());
    write_parts(format);
    for (const int part : {0, 1}) pack(file(part));
    const Recording recording = open_recording(bag_);
    expect_scans(recording, {0, 1, 2, 3, 4, 5});
    EXPECT_THAT(recording.faults, IsEmpty());
  }
}

TEST_F(BagPartsTest, APartThatLiesThereTwiceIsReadOnce) {
  write_parts();
  pack(file(2), true);
  fs::resize_file(file(2).string() + ".zstd", 100);
  const Recording recording = open_recording(bag_);
  expect_scans(recording, {0, 1, 2, 3, 4, 5});
  EXPECT_THAT(recording.faults, IsEmpty());
}

TEST_F(BagPartsTest, TellsOfFilesThatItsMetadataDoesNotName) {
  write_parts();
  write_metadata({0, 1});
  const Recording recording = open_recording(bag_);
  expect_scans(recording, {0, 1, 2, 3});
  EXPECT_THAT(recording.faults,
              ElementsAre(AllOf(HasSubstr("f_2.db3"), HasSubstr("metadata.yaml"))));
}

TEST_F(BagPartsTest, TellsOfFilesOfAnotherStorage) {
  write_parts(BagFormat::mcap);
  write_bag(folder_ / "other", {bag_message(7)});
  fs::rename(folder_ / "other" / "other_0.db3", bag_ / "f_0.db3");
  const Recording recording = open_recording(bag_);
  expect_scans(recording, {7});
  EXPECT_THAT(recording.faults,
              ElementsAre(HasSubstr("f_0.mcap"), HasSubstr("f_1.mcap"), HasSubstr("f_2.mcap")));
}

TEST_F(BagPartsTest, AMissingPartLeavesTheOthersReadable) {
  write_parts();
  write_metadata({0, 1, 2});
  pack(file(2));
  fs::remove(file(1));
  const Recording recording = open_recording(bag_);
  expect_scans(recording, {0, 1, 4, 5});
  EXPECT_THAT(recording.faults, ElementsAre(AllOf(HasSubstr("f_1.db3"), HasSubstr("left out"),
                                                  HasSubstr("no such file"))));
  for (const char* rest : {"f_0.db3", "f_2.db3.zstd"}) fs::remove(bag_ / rest);
  EXPECT_THAT(open_fault(bag_), HasSubstr("f_0.db3: no such file"));
}

TEST_F(BagPartsTest, ADamagedPartLeavesTheOthersReadable) {
  write_parts();
  pack(file(0));
  fs::resize_file(file(0).string() + ".zstd", 100);
  const Recording recording = open_recording(bag_);
  expect_scans(recording, {2, 3, 4, 5});
  EXPECT_THAT(recording.faults,
              ElementsAre(AllOf(HasSubstr("f_0.db3.zstd"), HasSubstr("cut off"))));
}

// As a signal ends it, which no destructor sees.
TEST_F(BagPartsTest, WhatIsUnpackedGoesWithTheProcess) {
  write_parts();
  pack(file(0));
  const fs::path unpacked = folder_ / "unpacked";
  fs::create_directories(unpacked);
  EXPECT_EXIT(
      {
        setenv("TMPDIR", unpacked.c_str(), 1);
        const Bag bag(bag_);
        const bool lies_there = !fs::is_empty(unpacked);
        TemporaryFolder::remove_all_at_end();
        _exit(lies_there ? 0 : 1);
      },
      testing::ExitedWithCode(0), "");
  EXPECT_TRUE(fs::is_empty(unpacked));
}

TEST(Bag, UnpacksMessagesWithoutBeingTold) {
  const ScratchFolder folder;
  write_bag(folder / "bag",
            {zstd_frame(bag_message(0)), bag_message(1), zstd_frame(bag_message(2))});
  fs::remove(folder / "bag" / "metadata.yaml");
  const ScanDataset dataset = open_sequence(folder / "bag");
  ASSERT_EQ(dataset.size(), 3U);
  for (int k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(k);
    EXPECT_EQ(dataset.stamp_ns(i), bag_scan(k).stamp_ns);
    EXPECT_EQ(dataset.read(i).scan.points_lidar, bag_scan(k).points_lidar);
  }
}

TEST(Bag, RefusesRos1InMcapWithTheWayOut) {
  const ScratchFolder folder;
  BagTopic topic = cloud_topic("/points");
  topic.type = "sensor_msgs/PointCloud2";
  topic.serialization_format = "ros1";
  {
    BagWriter writer(folder / "bag", {topic}, BagFormat::mcap, mcap::Compression::none);
    writer.add(0, 1, bag_message(0));
    writer.finish();
  }
  EXPECT_THAT(open_fault(folder / "bag"), AllOf(HasSubstr("ROS 1"), HasSubstr("rosbags-convert")));
}

/// A page of the database that holds messages, overwritten.
TEST(Bag, ReadsWhatIsBeforeAndBehindTheDamageOfADatabase) {
  const ScratchFolder folder;
  constexpr int scans = 120;
  std::vector<Bytes> messages;
  for (int k = 0; k < scans; ++k) messages.push_back(bag_message(k));
  write_bag(folder / "bag", messages);
  const fs::path file = folder / "bag" / "bag_0.db3";
  const std::string sound = content_of(file);
  const Bytes& middle = messages[scans / 2];
  const std::size_t at = sound.find(std::string(middle.begin(), middle.end()));
  ASSERT_NE(at, std::string::npos);

  std::string damaged = sound;
  damaged.replace(at / 4096 * 4096, 4096, std::string(4096, '\xff'));
  std::ofstream(file, std::ios::binary) << damaged;
  const Recording recording = open_recording(folder / "bag");
  ASSERT_GT(recording.dataset.size(), scans * 3U / 4U);
  ASSERT_LT(recording.dataset.size(), static_cast<std::size_t>(scans));
  EXPECT_EQ(recording.dataset.read(0).scan.points_lidar, bag_scan(0).points_lidar);
  EXPECT_EQ(recording.dataset.read(recording.dataset.size() - 1).scan.points_lidar,
            bag_scan(scans - 1).points_lidar);
  EXPECT_THAT(recording.faults, ElementsAre(AllOf(HasSubstr("damaged"), HasSubstr(".recover"))));
}

TEST(Bag, ReadsADatabaseWhoseEndIsMissing) {
  const ScratchFolder folder;
  std::vector<Bytes> messages;
  for (int k = 0; k < 120; ++k) messages.push_back(bag_message(k));
  write_bag(folder / "bag", messages);
  const fs::path file = folder / "bag" / "bag_0.db3";
  fs::resize_file(file, fs::file_size(file) * 6 / 10);
  const Recording recording = open_recording(folder / "bag");
  EXPECT_GT(recording.dataset.size(), 50U);
  EXPECT_EQ(recording.dataset.read(40).scan.points_lidar, bag_scan(40).points_lidar);
  EXPECT_THAT(recording.faults, ElementsAre(HasSubstr("damaged")));
}

}  // namespace
}  // namespace stillmap::dds
