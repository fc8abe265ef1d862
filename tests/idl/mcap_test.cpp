#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <zstd.h>

#include <csignal>
#include <fstream>
#include <random>
#include <set>

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/bag_scan_source.hpp"
#include "idl/bag/cdr_reader.hpp"
#include "idl/bag/mcap_bag_file.hpp"
#include "idl/bag/mcap_writer.hpp"
#include "idl/conversions/imu.hpp"
#include "tests/idl/bag_fixture.hpp"
#include "tests/scratch_folder.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;
using mcap::Compression;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::int64_t begin_ns = 1'700'000'000'000'000'000;

BagTopic imu_topic() {
  BagTopic topic = cloud_topic("/imu/data");
  topic.type = "sensor_msgs/msg/Imu";
  topic.definition = "std_msgs/Header header\n";
  return topic;
}

/// Message `k` of a topic: a few to many bytes, by a fixed rule.
Bytes made_message(std::size_t topic, int k, std::size_t size) {
  std::mt19937 random(static_cast<unsigned>(1000 * topic) + static_cast<unsigned>(k));
  Bytes bytes{0, 1, 0, 0};
  for (std::size_t i = 0; i < size; ++i) {
    bytes.push_back(static_cast<std::uint8_t>(i % 3 == 0 ? random() : i));
  }
  return bytes;
}

/// Three messages of an IMU for each of a lidar, which has 400 kB: two or three a chunk.
void write_drive(const fs::path& folder, Compression compression, int scans,
                 std::size_t scan_bytes = 400'000) {
  BagWriter writer(folder, {cloud_topic("/points"), imu_topic()}, BagFormat::mcap, compression);
  for (int k = 0; k < scans; ++k) {
    const std::int64_t now_ns = begin_ns + 100'000'000 * std::int64_t{k};
    for (int i = 0; i < 3; ++i) writer.add(1, now_ns + 1 + i, made_message(1, 3 * k + i, 320));
    writer.add(0, now_ns, made_message(0, k, scan_bytes));
  }
  writer.finish();
}

std::vector<Bytes> messages_of(const BagFile& file, const std::string& topic) {
  std::vector<Bytes> messages;
  for (const BagMessage& message : file.messages(topic, 0)) messages.push_back(file.bytes(message));
  return messages;
}

class Mcap : public testing::TestWithParam<Compression> {
 protected:
  ScratchFolder folder_;
};

INSTANTIATE_TEST_SUITE_P(Compressions, Mcap,
                         testing::Values(Compression::none, Compression::lz4, Compression::zstd),
                         [](const auto& tested) {
                           const auto name = mcap::compression_name(tested.param);
                           return std::string(name.empty() ? "none" : name);
                         });

TEST_P(Mcap, WhatIsWrittenComesBack) {
  constexpr int scans = 11;
  write_drive(folder_ / "bag", GetParam(), scans);
  const Bag bag(folder_ / "bag");
  ASSERT_EQ(bag.topics().size(), 2U);
  EXPECT_EQ(bag.topics()[0].name, "/points");
  EXPECT_EQ(bag.topics()[0].type, "sensor_msgs/msg/PointCloud2");
  EXPECT_EQ(bag.topics()[0].serialization_format, "cdr");
  EXPECT_EQ(bag.topics()[0].offered_qos_profiles, cloud_topic("").offered_qos_profiles);
  EXPECT_EQ(bag.topics()[0].messages, static_cast<std::uint64_t>(scans));
  EXPECT_EQ(bag.topics()[1].messages, static_cast<std::uint64_t>(3 * scans));
  EXPECT_THAT(bag.faults(), IsEmpty());
  const auto points = bag.messages("/points"), imu = bag.messages("/imu/data");
  ASSERT_EQ(points.size(), static_cast<std::size_t>(scans));
  ASSERT_EQ(imu.size(), static_cast<std::size_t>(3 * scans));
  EXPECT_GT(points.back().chunk, 3U) << "several chunks";
  for (int k = 0; k < scans; ++k) {
    const BagMessage& message = points[static_cast<std::size_t>(k)];
    EXPECT_EQ(message.received_ns, begin_ns + 100'000'000 * std::int64_t{k});
    const Bytes written = made_message(0, k, 400'000);
    EXPECT_EQ(bag.first_bytes(message, 12), Bytes(written.begin(), written.begin() + 12));
    EXPECT_EQ(bag.bytes(message), written);
  }
  // And backwards, so that every chunk is left and come back to.
  for (int k = 3 * scans - 1; k >= 0; --k) {
    EXPECT_EQ(bag.bytes(imu[static_cast<std::size_t>(k)]), made_message(1, k, 320));
  }
}

TEST_P(Mcap, AFileWithoutSummaryIsReadToItsLastChunk) {
  write_drive(folder_ / "bag", GetParam(), 7);
  const fs::path file = folder_ / "bag" / "bag_0.mcap";
  const McapBagFile whole(file);
  const InputFile input(file);
  const auto footer = mcap::parse_footer(input.read(input.size() - 8 - mcap::footer_bytes, 20));
  fs::resize_file(file, footer.summary_start);
  const McapBagFile cut(file);
  EXPECT_EQ(messages_of(cut, "/points"), messages_of(whole, "/points"));
  EXPECT_EQ(messages_of(cut, "/imu/data"), messages_of(whole, "/imu/data"));
}

/// Has the file's statistics count no channel's messages, as some recorders' do not.
void forget_channel_counts(const fs::path& file) {
  std::string bytes = content_of(file);
  const InputFile input(file);
  std::size_t offset =
      mcap::parse_footer(input.read(input.size() - 8 - mcap::footer_bytes, 20)).summary_start;
  const auto head_at = [&](std::size_t at) {
    return mcap::parse_record_head(input.read(at, mcap::record_head_bytes));
  };
  while (head_at(offset).opcode != mcap::Opcode::statistics)
    offset += mcap::record_head_bytes + head_at(offset).length;
  // The list comes after three numbers of 64 bits, four of 32 and one of 16; the summary's CRC
  // before the magic number.
  bytes.replace(offset + mcap::record_head_bytes + 42, 4, 4, '\0');
  bytes.replace(bytes.size() - 8 - 4, 4, 4, '\0');
  std::ofstream(file, std::ios::binary) << bytes;
}

TEST_P(Mcap, AFileThatCountsNoChannelsMessagesHasThemAll) {
  write_drive(folder_ / "bag", GetParam(), 5);
  const fs::path file = folder_ / "bag" / "bag_0.mcap";
  const auto points = messages_of(McapBagFile(file), "/points");
  forget_channel_counts(file);
  ASSERT_FALSE(mcap::read_summary(InputFile(file)));
  const McapBagFile uncounted(file);
  ASSERT_EQ(uncounted.topics().size(), 2U);
  EXPECT_EQ(uncounted.topics()[0].messages, 5U);
  EXPECT_EQ(uncounted.topics()[1].messages, 15U);
  EXPECT_EQ(messages_of(uncounted, "/points"), points);
}

/// Every message that can be read is one that was written.
void expect_only_sound_messages(const fs::path& file, const std::set<Bytes>& written) {
  try {
    const McapBagFile damaged(file);
    for (const BagTopic& topic : damaged.topics()) {
      for (const BagMessage& message : damaged.messages(topic.name, 0)) {
        try {
          EXPECT_TRUE(written.contains(damaged.bytes(message)));
        } catch (const CdrError&) {
        }
      }
    }
  } catch (const DatasetError&) {
  }
}

TEST_P(Mcap, DamagedFilesGiveErrorsAndSoundMessages) {
  write_drive(folder_ / "bag", GetParam(), 4, 300);
  const std::string sound = content_of(folder_ / "bag" / "bag_0.mcap");
  const auto all = messages_of(McapBagFile(folder_ / "bag" / "bag_0.mcap"), "/points");
  std::set<Bytes> written(all.begin(), all.end());
  for (Bytes& bytes : messages_of(McapBagFile(folder_ / "bag" / "bag_0.mcap"), "/imu/data")) {
    written.insert(std::move(bytes));
  }
  std::mt19937 random(5);
  for (int round = 0; round < 600; ++round) {
    std::string bytes = sound;
    for (int i = 0; i < 1 + round % 4; ++i) {
      bytes[random() % bytes.size()] = static_cast<char>(random());
    }
    if (round % 3 == 0) bytes.resize(random() % bytes.size());
    expect_only_sound_messages(folder_.file("damaged.mcap", bytes), written);
  }
}

TEST_P(Mcap, CutAnywhereItGivesEveryWholeChunk) {
  constexpr int scans = 5;
  // A commit ends a chunk.
  {
    BagWriter writer(folder_ / "bag", {cloud_topic("/points")}, BagFormat::mcap, GetParam());
    for (int k = 0; k < scans; ++k) {
      writer.add(0, begin_ns + k, made_message(0, k, 60));
      writer.commit();
    }
  }
  const fs::path file = folder_ / "bag" / "bag_0.mcap";
  const std::string sound = content_of(file);
  std::vector<std::uint64_t> ends;
  std::uint64_t data_end = 0;
  {
    const InputFile input(file);
    data_end =
        mcap::parse_footer(input.read(input.size() - 8 - mcap::footer_bytes, 20)).summary_start - 1;
    const auto contents = mcap::read_contents(input);
    for (const mcap::StoredChunk& chunk : contents.chunks) {
      ends.push_back(chunk.offset + mcap::record_head_bytes +
                     mcap::parse_record_head(input.read(chunk.offset, 9)).length);
    }
  }
  ASSERT_EQ(ends.size(), static_cast<std::size_t>(scans));
  for (std::size_t length = mcap::magic.size(); length < sound.size(); ++length) {
    const McapBagFile cut(folder_.file("cut.mcap", sound.substr(0, length)));
    const auto whole = static_cast<std::size_t>(
        std::ranges::count_if(ends, [&](std::uint64_t end) { return end <= length; }));
    ASSERT_EQ(messages_of(cut, "/points").size(), whole) << length << " of " << sound.size();
    EXPECT_EQ(cut.faults().empty(), length > data_end) << length;
  }
}

TEST(McapBag, IsReadAsFolderAsFileAndInParts) {
  const ScratchFolder folder;
  write_bag(folder / "bag", {bag_message(0), bag_message(1)}, BagFormat::mcap);
  EXPECT_EQ(open_sequence(folder / "bag").size(), 2U);
  EXPECT_THAT(content_of(folder / "bag" / "metadata.yaml"),
              AllOf(HasSubstr("storage_identifier: mcap"), HasSubstr("- bag_0.mcap")));
  EXPECT_EQ(open_sequence(folder / "bag" / "bag_0.mcap").read(1).scan.points_lidar,
            bag_scan(1).points_lidar);
  fs::remove(folder / "bag" / "metadata.yaml");
  {
    BagWriter writer(folder / "b", {cloud_topic("/points")}, BagFormat::mcap, Compression::zstd);
    writer.add(0, begin_ns * 2, bag_message(2));
  }
  fs::rename(folder / "b" / "b_0.mcap", folder / "bag" / "bag_1.mcap");
  const ScanDataset parts = open_sequence(folder / "bag");
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_EQ(parts.stamp_ns(2), bag_scan(2).stamp_ns);
  // Files that rosbag2 has compressed as a whole.
  const std::string plain = content_of(folder / "bag" / "bag_0.mcap");
  std::string packed(ZSTD_compressBound(plain.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), plain.data(), plain.size(), 1));
  EXPECT_EQ(open_sequence(folder.file("packed/bag_0.mcap.zstd", packed)).size(), 2U);
}

TEST(McapBag, ReadsTheImuBesideTheScans) {
  const ScratchFolder folder;
  const ImuSample sample{1'700'000'000'123'456'789, {0.1, -0.2, 0.3}, {0.5, -9.5, 1.5}};
  {
    BagWriter writer(folder / "bag", {cloud_topic("/points"), imu_topic()}, BagFormat::mcap);
    writer.add(0, 1, bag_message(0));
    writer.add(1, 2, serialized(wire::to_imu(sample, "a_frame")));
  }
  const auto samples = open_sequence(folder / "bag").imu();
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].acceleration_imu, sample.acceleration_imu);
}

TEST(McapBag, ARecorderThatGoesOnIsReadMeanwhile) {
  const ScratchFolder folder;
  BagWriter writer(folder / "bag", {cloud_topic("/points")}, BagFormat::mcap, Compression::lz4);
  for (int k = 0; k < 3; ++k) writer.add(0, begin_ns + k, bag_message(k));
  writer.commit();
  writer.add(0, begin_ns + 3, bag_message(3));
  const Recording recording = open_recording(folder / "bag");
  EXPECT_EQ(recording.dataset.size(), 3U);
  ASSERT_EQ(recording.faults.size(), 1U);
  EXPECT_THAT(recording.faults[0], AllOf(HasSubstr("bag_0.mcap"), HasSubstr("not finished")));
}

TEST(McapBag, ADamagedChunkIsNamedAndTheOthersAreRead) {
  const ScratchFolder folder;
  {
    BagWriter writer(folder / "bag", {cloud_topic("/points")}, BagFormat::mcap);
    for (int k = 0; k < 3; ++k) {
      writer.add(0, begin_ns + k, bag_message(k));
      writer.commit();
    }
  }
  const fs::path file = folder / "bag" / "bag_0.mcap";
  std::string bytes = content_of(file);
  const auto second_chunk = mcap::read_contents(InputFile(file)).chunks.at(1).offset;
  bytes[second_chunk + 200] = static_cast<char>(bytes[second_chunk + 200] + 1);
  std::ofstream(file, std::ios::binary) << bytes;
  const ScanDataset dataset = open_sequence(folder / "bag");
  ASSERT_EQ(dataset.size(), 3U);
  EXPECT_THAT(message_of<DatasetError>([&] { (void)dataset.read(1); }),
              AllOf(HasSubstr("byte " + std::to_string(second_chunk)), HasSubstr("CRC")));
  EXPECT_EQ(dataset.read(0).scan.points_lidar, bag_scan(0).points_lidar);
  EXPECT_EQ(dataset.read(2).scan.points_lidar, bag_scan(2).points_lidar);
}

TEST(McapBag, AFullDiskKeepsWhatWasCommitted) {
  const ScratchFolder folder;
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  auto* const handler = std::signal(SIGXFSZ, SIG_IGN);
  {
    BagWriter writer(folder / "bag", {cloud_topic("/points")}, BagFormat::mcap);
    for (int k = 0; k < 4; ++k) writer.add(0, begin_ns + k, bag_message(k));
    writer.commit();
    const rlimit full{fs::file_size(folder / "bag" / "bag_0.mcap") + 100, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &full);
    writer.add(0, begin_ns + 9, made_message(0, 1, 5000));
    EXPECT_THAT(message_of<DatasetError>([&] { writer.commit(); }),
                AllOf(HasSubstr("bag_0.mcap"), HasSubstr("is kept")));
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  const McapBagFile file(folder / "bag" / "bag_0.mcap");
  EXPECT_EQ(messages_of(file, "/points").size(), 4U);
}

/// A file of one chunk that says of itself what it is not.
std::string lying_chunk(std::uint64_t uncompressed_bytes, const std::string& compression) {
  std::string file(mcap::magic), records;
  mcap::append_header(file, "ros2", "");
  mcap::append_schema(file,
                      {.id = 1, .name = "sensor_msgs/msg/PointCloud2", .encoding = "", .text = ""});
  mcap::append_channel(
      file,
      {.id = 0, .schema_id = 1, .topic = "/points", .message_encoding = "cdr", .metadata = {}});
  mcap::append_message(records, {.channel_id = 0}, bag_message(0));
  mcap::append_chunk(file,
                     {.uncompressed_bytes = uncompressed_bytes,
                      .compression = compression,
                      .compressed_bytes = records.size()},
                     records);
  mcap::append_message_index(file, {.channel_id = 0, .entries = {{0, 0}}});
  return file;
}

TEST(McapBag, HugeChunksAndOtherCompressionsAreRefusedWithTheWayOut) {
  const ScratchFolder folder;
  const auto fault = [&](const std::string& bytes) {
    return message_of<DatasetError>(
        [&] { (void)open_sequence(folder.file("a.mcap", bytes)).read(0); });
  };
  EXPECT_THAT(fault(lying_chunk(std::uint64_t{1} << 40U, "zstd")),
              AllOf(HasSubstr("1048576 MiB"), HasSubstr("--chunk-size")));
  EXPECT_THAT(fault(lying_chunk(100, "brotli")), HasSubstr("'brotli'"));
  EXPECT_THAT(fault(lying_chunk(mcap::max_chunk_bytes, "")), HasSubstr("end too early"));
  EXPECT_THAT(fault(lying_chunk(1000, "lz4")), HasSubstr("lz4"));
  EXPECT_THAT(fault("\x89MCAP1\r\n"), HasSubstr("no MCAP file"));
  EXPECT_THAT(fault(""), HasSubstr("no MCAP file"));
}

std::uint64_t peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::uint64_t kib = 0;
    if (word == "VmHWM:" && status >> kib) return kib * 1024;
  }
  return 0;
}

TEST(McapBag, MemoryDoesNotGrowWithTheFile) {
  const ScratchFolder folder;
  constexpr int scans = 200;
  constexpr std::size_t scan_bytes = 1'000'000;
  const Bytes message = made_message(0, 0, scan_bytes);
  {
    BagWriter writer(folder / "bag", {cloud_topic("/points")}, BagFormat::mcap, Compression::lz4);
    for (int k = 0; k < scans; ++k) writer.add(0, begin_ns + k, message);
  }
  const std::uint64_t before = peak_memory_bytes();
  const Bag bag(folder / "bag");
  for (const BagMessage& stored : bag.messages("/points")) {
    ASSERT_EQ(bag.bytes(stored).size(), message.size());
  }
  // Sanitizers keep what was freed for a while.
  const std::uint64_t max_bytes = test::slowdown > 1 ? 90'000'000U : 30'000'000U;
  EXPECT_LT(peak_memory_bytes() - before, max_bytes) << "of " << scans * scan_bytes;
}

}  // namespace
}  // namespace stillmap::dds
