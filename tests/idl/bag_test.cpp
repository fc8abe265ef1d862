#include "idl/bag/bag.hpp"

#include <SQLiteCpp/Database.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zstd.h>

#include <fstream>
#include <random>

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/bag_scan_source.hpp"
#include "idl/bag/cdr_reader.hpp"
#include "idl/conversions/gnss.hpp"
#include "idl/conversions/imu.hpp"
#include "tests/idl/bag_fixture.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

std::string fault_of(const fs::path& path, const std::string& topic = {}) {
  return message_of<DatasetError>([&] { (void)open_sequence(path, topic); });
}

void expect_scan(const Scan& scan, const Scan& expected) {
  EXPECT_EQ(scan.stamp_ns, expected.stamp_ns);
  EXPECT_EQ(scan.points_lidar, expected.points_lidar);
  EXPECT_EQ(scan.intensity, expected.intensity);
  EXPECT_EQ(scan.ring, expected.ring);
  ASSERT_EQ(scan.time_offset_s.size(), expected.time_offset_s.size());
  for (std::size_t i = 0; i < scan.size(); ++i) {
    EXPECT_FLOAT_EQ(scan.time_offset_s[i], expected.time_offset_s[i]);
  }
}

TEST(Bag, WhatIsWrittenComesBackInEitherByteOrder) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {bag_message(0), bag_message(1, false), bag_message(2)});
  for (const fs::path& path : {folder / "bag", folder / "bag" / "bag_0.db3"}) {
    const ScanDataset dataset = open_sequence(path);
    ASSERT_EQ(dataset.size(), 3U);
    for (int k = 0; k < 3; ++k) {
      const auto i = static_cast<std::size_t>(k);
      EXPECT_EQ(dataset.stamp_ns(i), bag_scan(k).stamp_ns);
      EXPECT_FALSE(dataset.has_labels(i));
      expect_scan(dataset.read(i).scan, bag_scan(k));
    }
    EXPECT_FALSE(dataset.truth());
  }
}

TEST(Bag, ReadsTheImuBesideTheScansInEitherByteOrder) {
  const ScratchFolder folder;
  const ImuSample sample{1'700'000'000'123'456'789, {0.1, -0.2, 0.3}, {0.5, -9.5, 1.5}};
  BagTopic imu = cloud_topic("/imu/data");
  imu.type = "sensor_msgs/msg/Imu";
  BagWriter writer(folder / "bag", {cloud_topic("/points"), imu});
  writer.add(0, 1, bag_message(0));
  writer.add(1, 2, serialized(wire::to_imu(sample, "a_frame")));
  writer.add(1, 3, serialized(wire::to_imu(sample, "f"), false));
  writer.add(1, 4, Bytes{0, 1, 0, 0, 7});
  writer.finish();
  const std::vector<ImuSample> samples = open_sequence(folder / "bag").imu();
  ASSERT_EQ(samples.size(), 2U) << "the damaged message is left out";
  for (const ImuSample& read : samples) {
    EXPECT_EQ(read.stamp_ns, sample.stamp_ns);
    EXPECT_EQ(read.angular_velocity_imu, sample.angular_velocity_imu);
    EXPECT_EQ(read.acceleration_imu, sample.acceleration_imu);
  }
}

TEST(Bag, ReadsAReceiversFixesBesideTheScansInEitherByteOrder) {
  const ScratchFolder folder;
  GnssFix fix{.stamp_ns = 1'700'000'000'123'456'789,
              .latitude_deg = 49.1,
              .longitude_deg = -8.2,
              .altitude_m = 115.5};
  fix.covariance_enu.diagonal() << 4.0, 3.0, 9.0;
  BagTopic gnss = cloud_topic("/fix");
  gnss.type = "sensor_msgs/msg/NavSatFix";
  BagWriter writer(folder / "bag", {cloud_topic("/points"), gnss});
  writer.add(0, 1, bag_message(0));
  writer.add(1, 2, serialized(wire::to_nav_sat_fix(fix, "a_frame")));
  writer.add(1, 3, serialized(wire::to_nav_sat_fix(fix, "f"), false));
  auto none = wire::to_nav_sat_fix(fix, "f");
  none.status().status(0xFF);
  writer.add(1, 4, serialized(none));
  writer.add(1, 5, Bytes{0, 1, 0, 0, 7});
  writer.finish();
  const std::vector<GnssFix> fixes = open_sequence(folder / "bag").gnss();
  ASSERT_EQ(fixes.size(), 2U) << "no fix and the damaged message are left out";
  for (const GnssFix& read : fixes) {
    EXPECT_EQ(read.stamp_ns, fix.stamp_ns);
    EXPECT_EQ(read.latitude_deg, fix.latitude_deg);
    EXPECT_EQ(read.longitude_deg, fix.longitude_deg);
    EXPECT_EQ(read.altitude_m, fix.altitude_m);
    EXPECT_EQ(read.covariance_enu, fix.covariance_enu);
  }
}

TEST(Bag, ReadsLabelsThatAReplaySent) {
  const ScratchFolder folder;
  const std::vector<std::uint32_t> raw(10, 252);
  write_bag(folder / "bag", {serialized(wire::to_cloud(bag_scan(0), raw, "lidar"))});
  const DatasetFrame frame = open_sequence(folder / "bag").read(0);
  EXPECT_THAT(frame.scan.labels, testing::Each(SemanticClass::car));
  EXPECT_EQ(frame.raw_labels, raw) << "moving ones are truth for evaluation";
}

TEST(Bag, ReadsLabelsOfTheKindThatItIsTold) {
  const ScratchFolder folder;
  const std::vector<std::uint32_t> raw(10, 17);
  write_bag(folder / "bag", {serialized(wire::to_cloud(bag_scan(0), raw, "lidar"))});
  EXPECT_TRUE(open_sequence(folder / "bag").label_census().look_like_classes());
  const ScanDataset told = open_recording(folder / "bag", "", LabelKind::classes).dataset;
  EXPECT_THAT(told.read(0).scan.labels, testing::Each(SemanticClass::terrain));
}

TEST(Bag, AMissingMetadataFileIsNoFault) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {bag_message(0), bag_message(1)});
  fs::remove(folder / "bag" / "metadata.yaml");
  EXPECT_EQ(open_sequence(folder / "bag").size(), 2U);
}

TEST(Bag, ASplitBagIsReadInOrderOfTime) {
  const ScratchFolder folder;
  write_bag(folder / "a", {bag_message(0), bag_message(1)});
  {
    BagWriter writer(folder / "b", {cloud_topic("/points")});
    writer.add(0, 1'800'000'000'000'000'000, bag_message(2));
  }
  fs::rename(folder / "b" / "b_0.db3", folder / "a" / "a_1.db3");
  BagMetadata metadata;
  metadata.files = {"a_0.db3", "a_1.db3"};
  write_bag_metadata(folder / "a" / "metadata.yaml", metadata);
  const ScanDataset dataset = open_sequence(folder / "a");
  ASSERT_EQ(dataset.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(dataset.stamp_ns(i), bag_scan(static_cast<int>(i)).stamp_ns);
  }
  EXPECT_EQ(dataset.file(2).parent_path().parent_path().filename(), "a_1.db3");
}

TEST(Bag, ABagWhoseRecorderWasKilledKeepsWhatWasCommitted) {
  const ScratchFolder folder;
  fs::create_directories(folder / "copy");
  BagWriter writer(folder / "bag", {cloud_topic("/points")});
  writer.add(0, 1, bag_message(0));
  writer.add(0, 2, bag_message(1));
  writer.commit();
  writer.add(0, 3, bag_message(2));
  // What is on the disk at this moment, log and all.
  ASSERT_GT(fs::file_size(folder / "bag" / "bag_0.db3-wal"), 0U);
  for (const char* file : {"bag_0.db3", "bag_0.db3-wal", "metadata.yaml"}) {
    fs::copy(folder / "bag" / file, folder / "copy" / file);
  }
  EXPECT_EQ(open_sequence(folder / "copy").size(), 2U);
  // A reader may also look in while the recorder goes on.
  EXPECT_EQ(open_sequence(folder / "bag").size(), 2U);
}

Bytes packed(std::span<const std::uint8_t> content) {
  Bytes frame(ZSTD_compressBound(content.size()));
  frame.resize(ZSTD_compress(frame.data(), frame.size(), content.data(), content.size(), 1));
  return frame;
}

/// Says in the metadata how the bag is compressed.
void set_compression(const fs::path& bag, const std::string& mode, const std::string& file) {
  std::ofstream(bag / "metadata.yaml", std::ios::trunc)
      << "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n"
      << "  compression_format: zstd\n  compression_mode: " << mode
      << "\n  relative_file_paths:\n    - " << file << "\n";
}

TEST(Bag, ReadsMessagesThatAreCompressed) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {packed(bag_message(0)), packed(bag_message(1))});
  set_compression(folder / "bag", "MESSAGE", "bag_0.db3");
  const ScanDataset dataset = open_sequence(folder / "bag");
  expect_scan(dataset.read(1).scan, bag_scan(1));
  EXPECT_EQ(dataset.stamp_ns(1), bag_scan(1).stamp_ns);
}

TEST(Bag, ReadsFilesThatAreCompressed) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {bag_message(0), bag_message(1)});
  const std::string content = content_of(folder / "bag" / "bag_0.db3");
  const Bytes frame =
      packed({reinterpret_cast<const std::uint8_t*>(content.data()), content.size()});
  fs::remove(folder / "bag" / "bag_0.db3");
  std::ofstream(folder / "bag" / "bag_0.db3.zstd", std::ios::binary)
      .write(reinterpret_cast<const char*>(frame.data()),
             static_cast<std::streamsize>(frame.size()));
  set_compression(folder / "bag", "FILE", "bag_0.db3.zstd");
  expect_scan(open_sequence(folder / "bag").read(1).scan, bag_scan(1));
  fs::resize_file(folder / "bag" / "bag_0.db3.zstd", frame.size() / 2);
  EXPECT_THAT(fault_of(folder / "bag"), HasSubstr("cut off"));
}

TEST(Bag, SeveralTopicsOfScansMustBeChosenFrom) {
  const ScratchFolder folder;
  {
    BagTopic poses{"/odometry", "nav_msgs/msg/Odometry", "cdr", "", 0};
    BagWriter writer(folder / "bag", {cloud_topic("/front"), cloud_topic("/rear"), poses});
    writer.add(0, 1, bag_message(0));
    writer.add(1, 2, bag_message(1));
    writer.add(2, 3, bag_message(2));
  }
  EXPECT_THAT(fault_of(folder / "bag"),
              AllOf(HasSubstr("--topic-in"), HasSubstr("/front"), HasSubstr("/rear")));
  EXPECT_EQ(open_sequence(folder / "bag", "rear").stamp_ns(0), bag_scan(1).stamp_ns);
  EXPECT_EQ(open_sequence(folder / "bag", "/front").stamp_ns(0), bag_scan(0).stamp_ns);
  EXPECT_THAT(fault_of(folder / "bag", "side"), AllOf(HasSubstr("/side"), HasSubstr("/rear")));
  EXPECT_THAT(fault_of(folder / "bag", "odometry"), HasSubstr("no scans"));
}

TEST(Bag, OneDamagedMessageLeavesTheOthersReadable) {
  const ScratchFolder folder;
  Bytes cut = bag_message(1);
  cut.resize(cut.size() / 2);
  write_bag(folder / "bag", {bag_message(0), cut, bag_message(2), {}});
  const ScanDataset dataset = open_sequence(folder / "bag");
  ASSERT_EQ(dataset.size(), 4U);
  EXPECT_THAT(message_of<DatasetError>([&] { (void)dataset.read(1); }),
              AllOf(HasSubstr("message 2 of /points"), HasSubstr("cut off")));
  EXPECT_THROW((void)dataset.read(3), DatasetError);
  expect_scan(dataset.read(2).scan, bag_scan(2));
}

// Large messages lie on pages of their own, each of which names the next.
TEST(Bag, ADamagedPageLeavesTheOtherMessagesReadable) {
  const ScratchFolder folder;
  Scan large = bag_scan(1);
  for (int i = 0; i < 4000; ++i) {
    large.points_lidar.emplace_back(1.0F, 2.0F, 3.0F);
    large.intensity.push_back(0.1F);
    large.time_offset_s.push_back(0.0F);
    large.ring.push_back(1);
  }
  write_bag(folder / "bag",
            {bag_message(0), serialized(wire::to_cloud(large, {}, "lidar")), bag_message(2)});
  const fs::path file = folder / "bag" / "bag_0.db3";
  std::string bytes = content_of(file);
  // In the middle of the large one.
  const std::string points("\x00\x00\x80\x3f\x00\x00\x00\x40\x00\x00\x40\x40", 12);
  const std::size_t page = bytes.find(points, bytes.size() / 2) / 4096 * 4096;
  ASSERT_GT(page, 0U);
  bytes.replace(page, 4, "\xff\xff\xff\xff");
  std::ofstream(file, std::ios::binary) << bytes;
  const ScanDataset dataset = open_sequence(folder / "bag");
  ASSERT_EQ(dataset.size(), 3U);
  EXPECT_THROW((void)dataset.read(1), DatasetError);
  expect_scan(dataset.read(0).scan, bag_scan(0));
  expect_scan(dataset.read(2).scan, bag_scan(2));
}

TEST(Bag, AFileThatIsNamedByItselfNeedsNoMetadata) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {bag_message(0), bag_message(1)});
  static_cast<void>(
      folder.file("bag/metadata.yaml", "rosbag2_bagfile_information:\n  storage_identifier: [\n"));
  EXPECT_THAT(fault_of(folder / "bag"), HasSubstr("give the .db3 or .mcap file itself"));
  EXPECT_EQ(open_sequence(folder / "bag" / "bag_0.db3").size(), 2U);
}

TEST(Bag, OtherFormatsAreRefusedWithTheWayOut) {
  const ScratchFolder folder;
  EXPECT_THAT(fault_of(folder.file("a/a_0.mcap", "MCAP").parent_path()),
              AllOf(HasSubstr("a_0.mcap"), HasSubstr("no MCAP file")));
  EXPECT_THAT(fault_of(folder.file("c.bag", "#ROSBAG V2.0")), HasSubstr("rosbags-convert"));
  const auto with_metadata = [&](const std::string& name, const std::string& text) {
    return folder.file(name + "/metadata.yaml", text).parent_path();
  };
  const std::string head = "rosbag2_bagfile_information:\n  storage_identifier: ";
  EXPECT_THAT(fault_of(with_metadata("d", head + "rosbag_v2\n")),
              AllOf(HasSubstr("'rosbag_v2'"), HasSubstr("ros2 bag convert")));
  EXPECT_THAT(fault_of(with_metadata("e", head + "sqlite3\n")), HasSubstr("relative_file_paths"));
  EXPECT_THAT(fault_of(with_metadata("f", head + "[\n")), HasSubstr("cannot be read"));
  EXPECT_THAT(fault_of(with_metadata("g", head + "sqlite3\n  compression_format: lz4\n"
                                                 "  compression_mode: FILE\n")),
              HasSubstr("lz4"));
  EXPECT_THAT(fault_of(folder.file("h.db3", "this is no database")), HasSubstr("h.db3"));
  EXPECT_THAT(fault_of(folder.file("i.db3", "")), HasSubstr("no table"));
  EXPECT_THAT(fault_of(folder / "nothing.db3"), HasSubstr("no such file"));
  EXPECT_THAT(fault_of(folder.file("j/1.pcd", "").parent_path(), "points"),
              HasSubstr("--topic-in"));
}

TEST(Bag, DamagedFilesNeverEndInAnythingButAnError) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {bag_message(0), bag_message(1)});
  const std::string sound = content_of(folder / "bag" / "bag_0.db3");
  std::mt19937 random(3);
  for (int round = 0; round < 150; ++round) {
    std::string bytes = sound;
    for (int i = 0; i < 40; ++i) bytes[random() % bytes.size()] = static_cast<char>(random());
    const fs::path file = folder.file("damaged.db3", bytes);
    try {
      const ScanDataset dataset = open_sequence(file);
      for (std::size_t i = 0; i < std::min<std::size_t>(dataset.size(), 4); ++i) {
        (void)dataset.read(i);
      }
    } catch (const DatasetError&) {
    }
  }
}

TEST(Cdr, AnyBytesGiveAScanOrAnError) {
  std::mt19937 random(8);
  const Bytes sound = bag_message(0);
  for (int round = 0; round < 20'000; ++round) {
    Bytes bytes = sound;
    if (round % 2 == 0) bytes.resize(random() % bytes.size());
    for (int i = 0; i < 4 && !bytes.empty(); ++i) {
      bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    }
    for (const auto kind : {ScanMessageType::point_cloud, ScanMessageType::velodyne_packets,
                            ScanMessageType::livox_points}) {
      try {
        (void)decode_scan(kind, bytes);
      } catch (const CdrError&) {
      }
    }
  }
}

TEST(Cdr, EveryCutOfAMessageIsNoticed) {
  const Bytes sound = bag_message(0);
  for (std::size_t length = 0; length < sound.size(); ++length) {
    // The end that is left over is padding of the encoder at most.
    const std::span<const std::uint8_t> cut(sound.data(), length);
    EXPECT_THROW((void)decode_scan(ScanMessageType::point_cloud, cut), CdrError) << length;
  }
}

/// Little-endian, by hand: the message has no generated type here.
class Encoder {
 public:
  template <typename T>
  Encoder& put(T value) {
    while ((bytes_.size() - 4) % sizeof(T) != 0) bytes_.push_back(0);
    const auto* begin = reinterpret_cast<const std::uint8_t*>(&value);
    bytes_.insert(bytes_.end(), begin, begin + sizeof value);
    return *this;
  }
  Encoder& header() {
    put(std::int32_t{1700}).put(std::uint32_t{5}).put(std::uint32_t{2});
    return put('a').put('\0');
  }
  [[nodiscard]] const Bytes& bytes() const { return bytes_; }

 private:
  Bytes bytes_ = {0, 1, 0, 0};
};

TEST(ScanMessages, ReadsLivoxsOwnMessage) {
  Encoder message;
  message.header().put(std::uint64_t{1'700'000'000'005}).put(std::uint32_t{2});
  message.put(std::uint8_t{1}).put('\0').put('\0').put('\0').put(std::uint32_t{2});
  for (int i = 0; i < 2; ++i) {
    message.put(std::uint32_t(i * 50'000'000))
        .put(1.0F + static_cast<float>(i))
        .put(2.0F)
        .put(3.0F);
    message.put(std::uint8_t(100 + i)).put(std::uint8_t{16}).put(std::uint8_t{3});
  }
  const Scan scan = decode_scan(ScanMessageType::livox_points, message.bytes()).frame.scan;
  EXPECT_EQ(scan.stamp_ns, 1'700'000'000'005);
  ASSERT_EQ(scan.size(), 2U);
  EXPECT_EQ(scan.points_lidar[1], Eigen::Vector3f(2.0F, 2.0F, 3.0F));
  EXPECT_THAT(scan.intensity, testing::ElementsAre(100.0F, 101.0F));
  EXPECT_FLOAT_EQ(scan.time_offset_s[1], 0.05F);
  EXPECT_TRUE(scan.ring.empty());
}

TEST(ScanMessages, VelodynePacketsOfAnotherSensorAreNamed) {
  Encoder message;
  message.header().put(std::uint32_t{1}).put(std::int32_t{1700}).put(std::uint32_t{5});
  for (int i = 0; i < 1206; ++i) {
    const bool flag = i < 1200 && i % 100 < 2;
    message.put(flag ? std::uint8_t(i % 100 == 0 ? 0xFF : 0xEE)
                     : std::uint8_t(i == 1205 ? 0x28 : 0));
  }
  try {
    (void)decode_scan(ScanMessageType::velodyne_packets, message.bytes());
    FAIL();
  } catch (const CdrError& fault) {
    EXPECT_THAT(fault.what(), HasSubstr("0x28"));
  }
}

TEST(BagWriter, NeverWritesOverAnotherBag) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {bag_message(0)});
  EXPECT_THAT(message_of<DatasetError>([&] { write_bag(folder / "bag", {}); }),
              HasSubstr("is there already"));
}

TEST(BagWriter, MetadataCountsWhatIsThere) {
  const ScratchFolder folder;
  write_bag(folder / "bag/", {bag_message(0), bag_message(1), bag_message(2)});
  const std::string text = content_of(folder / "bag" / "metadata.yaml");
  EXPECT_THAT(text,
              AllOf(HasSubstr("version: 5"), HasSubstr("storage_identifier: sqlite3"),
                    HasSubstr("message_count: 3"), HasSubstr("nanoseconds: 200000000"),
                    HasSubstr("nanoseconds_since_epoch: 1700000000150000000"),
                    HasSubstr("- bag_0.db3"), HasSubstr("type: sensor_msgs/msg/PointCloud2")));
  EXPECT_FALSE(fs::exists(folder / "bag" / "bag_0.db3-wal"));
}

TEST(BagScanSource, SaysThatATopicsMessagesCannotBeFound) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {bag_message(0)});
  for (const auto& entry : std::filesystem::directory_iterator(folder / "bag")) {
    if (entry.path().extension() != ".db3") continue;
    // Not text any more, and so equal to no text.
    SQLite::Database(entry.path().string(), SQLite::OPEN_READWRITE)
        .exec("UPDATE topics SET name = CAST(name AS BLOB)");
  }
  EXPECT_NE(message_of<DatasetError>([&] { BagScanSource(folder / "bag", ""); }).find("damaged"),
            std::string::npos);
}

TEST(BagScanSource, NamesTheImusAndReceiversOfWhichItUsesNone) {
  const ScratchFolder folder;
  BagTopic front = cloud_topic("/front/imu"), rear = cloud_topic("/rear/imu");
  front.type = rear.type = "sensor_msgs/msg/Imu";
  BagTopic fix = cloud_topic("/fix");
  fix.type = "sensor_msgs/msg/NavSatFix";
  {
    BagWriter writer(folder / "bag", {cloud_topic("/points"), front, rear, fix});
    writer.add(0, 1, bag_message(0));
    for (const std::size_t imu : {1U, 2U}) writer.add(imu, 2, serialized(wire::to_imu({}, "imu")));
    writer.add(3, 3, Bytes{0, 1, 0, 0});
    writer.finish();
  }
  const Recording recording = open_recording(folder / "bag");
  EXPECT_TRUE(recording.dataset.imu().empty());
  ASSERT_EQ(recording.faults.size(), 1U) << "of one receiver there is nothing to say";
  EXPECT_THAT(recording.faults.front(), AllOf(HasSubstr("sensor_msgs/msg/Imu"),
                                              HasSubstr("/front/imu"), HasSubstr("/rear/imu")));
}

TEST(BagScanSource, SaysFromWhichFieldsAScanIsAndTakesThoseThatItIsTold) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {bag_message(0), bag_message(1)});
  EXPECT_THAT(open_recording(folder / "bag").dataset.remarks(),
              testing::ElementsAre(AllOf(HasSubstr("intensity from intensity"),
                                         HasSubstr("time from"), HasSubstr("ring from ring"))));
  PointFieldNames fields;
  fields.intensity = {"ring"};
  fields.time = {"absent"};
  const ScanDataset dataset = open_recording(folder / "bag", "", {}, fields).dataset;
  EXPECT_THAT(dataset.remarks(),
              testing::ElementsAre(AllOf(HasSubstr("intensity from ring"), HasSubstr("no time"))));
  EXPECT_TRUE(dataset.read(0).scan.time_offset_s.empty());
}

TEST(BagScanSource, NamesTheFramesOfSeveralLidarsOnOneTopic) {
  const ScratchFolder folder;
  const auto rear = [](int k) { return serialized(wire::to_cloud(bag_scan(k), {}, "rear")); };
  write_bag(folder / "bag", {bag_message(0), rear(1), bag_message(2)});
  EXPECT_THAT(
      open_recording(folder / "bag").faults,
      testing::ElementsAre(AllOf(HasSubstr("/points"), HasSubstr("'lidar' (2), 'rear' (1)"))));
}

}  // namespace
}  // namespace stillmap::dds
