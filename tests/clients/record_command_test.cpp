#include <algorithm>
#include <cstdlib>
#include <thread>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "idl/bag/bag.hpp"
#include "idl/bag/bag_scan_source.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "tests/clients/command_test.hpp"
#include "tests/idl/bag_fixture.hpp"

namespace stillmap::test {
namespace {

using namespace std::chrono_literals;

std::uint64_t messages_of(const dds::Bag& bag, const std::string& topic) {
  const auto found = std::ranges::find(bag.topics(), topic, &dds::BagTopic::name);
  return found == bag.topics().end() ? 0 : found->messages;
}

class RecordTest : public CommandTest {
 protected:
  [[nodiscard]] std::string on_domain() const { return " --domain " + std::to_string(domain_); }

  /// Whether the bag that is being recorded comes to hold so many messages of a topic.
  [[nodiscard]] bool comes_to_hold(const std::string& bag, const std::string& topic,
                                   std::uint64_t messages) const {
    const auto holds = [&] {
      try {
        return messages_of(dds::Bag(path(bag)), topic) >= messages;
      } catch (const DatasetError&) {
        return false;  // Not made yet.
      }
    };
    return eventually(holds, patience, 100ms);
  }

  /// Begins when the server and, where there is one, the recorder listen.
  [[nodiscard]] nlohmann::json replay(const std::string& source, int subscribers,
                                      const std::string& out) const {
    const ProcessResult result =
        run("replay " + source + " --lossless --json" + patiently() + " --subscribers " +
            std::to_string(subscribers) + on_domain() + " --out " + path(out));
    EXPECT_EQ(result.exit_code, 0) << result.err << content("server.log");
    return nlohmann::json::parse(result.out, nullptr, false);
  }

  [[nodiscard]] std::string server_command() const {
    write("server.yaml", "sensor: vlp_16\ninput: {delivery: every}\n");
    return stillmap_server_program() + " --config " + path("server.yaml") + on_domain();
  }

  int domain_ = free_domain();
};

TEST_F(RecordTest, ARecordedReplayIsTheRecordingAgain) {
  constexpr int scans = 8;
  simulate("city", scans, " --imu");
  {
    BackgroundProcess server(server_command(), folder_ / "server.log");
    ASSERT_EQ(run("status" + patiently() + on_domain()).exit_code, 0) << content("server.log");
    BackgroundProcess record(stillmap_program() + " record " + path("bag") + on_domain(),
                             folder_ / "record.log");
    // The recorder has discovered the server, which publishes its status each second.
    ASSERT_TRUE(comes_to_hold("bag", "/stillmap/status", 1)) << content("record.log");
    EXPECT_EQ(replay(path("city"), 2, "first.txt").at("mapped"), scans);
    for (const char* topic : {"/tf", "/stillmap/path", "/stillmap/tiles", "/stillmap/tile_index",
                              "/stillmap/static_cloud", "/stillmap/status"}) {
      EXPECT_TRUE(comes_to_hold("bag", topic, 1)) << topic << content("record.log");
    }
    EXPECT_TRUE(comes_to_hold("bag", "/stillmap/odometry", scans)) << content("record.log");
    EXPECT_EQ(record.stop(), 0) << content("record.log");
  }
  EXPECT_EQ(messages_of(dds::Bag(path("bag")), "/stillmap/odometry"),
            static_cast<std::uint64_t>(scans));
  EXPECT_THAT(content("record.log"), testing::Not(HasSubstr("lost")));

  const ScanDataset original(path("city"));
  const ScanDataset recorded = dds::open_sequence(path("bag"), "points");
  const std::vector<ImuSample> sent = original.imu(), received = recorded.imu();
  ASSERT_EQ(received.size(), sent.size());
  for (std::size_t k = 0; k < sent.size(); ++k) {
    EXPECT_EQ(received[k].stamp_ns, sent[k].stamp_ns);
    EXPECT_EQ(received[k].angular_velocity_imu, sent[k].angular_velocity_imu);
  }
  ASSERT_EQ(recorded.size(), original.size());
  for (std::size_t i = 0; i < original.size(); ++i) {
    const Scan a = original.read(i).scan, b = recorded.read(i).scan;
    EXPECT_EQ(b.stamp_ns, a.stamp_ns);
    EXPECT_TRUE(b.points_lidar == a.points_lidar) << i;
    EXPECT_EQ(b.ring, a.ring);
    ASSERT_EQ(b.intensity.size(), a.intensity.size());
    for (std::size_t k = 0; k < a.size(); ++k) ASSERT_NEAR(b.intensity[k], a.intensity[k], 1e-6);
  }

  // A new server makes the same of what was recorded.
  BackgroundProcess server(server_command(), folder_ / "server.log");
  ASSERT_EQ(run("status" + patiently() + on_domain()).exit_code, 0) << content("server.log");
  EXPECT_EQ(replay(path("bag") + " --topic-in points", 1, "second.txt").at("mapped"), scans);
  EXPECT_EQ(content("second.txt"), content("first.txt"));
}

std::vector<std::vector<std::uint8_t>> bytes_of(const dds::Bag& bag, const std::string& topic) {
  std::vector<std::vector<std::uint8_t>> messages;
  for (const dds::BagMessage& message : bag.messages(topic)) messages.push_back(bag.bytes(message));
  return messages;
}

TEST_F(RecordTest, McapHoldsWhatSqliteHolds) {
  constexpr int scans = 6;
  simulate("city", scans, " --imu");
  BackgroundProcess server(server_command(), folder_ / "server.log");
  ASSERT_EQ(run("status" + patiently() + on_domain()).exit_code, 0) << content("server.log");
  BackgroundProcess sqlite(stillmap_program() + " record " + path("sqlite") + on_domain(),
                           folder_ / "sqlite.log");
  BackgroundProcess mcap(
      stillmap_program() + " record " + path("mcap") + " --format mcap" + on_domain(),
      folder_ / "mcap.log");
  for (const char* bag : {"sqlite", "mcap"}) {
    ASSERT_TRUE(comes_to_hold(bag, "/stillmap/status", 1)) << content(std::string(bag) + ".log");
  }
  EXPECT_EQ(replay(path("city"), 3, "poses.txt").at("mapped"), scans);
  for (const char* bag : {"sqlite", "mcap"}) {
    EXPECT_TRUE(comes_to_hold(bag, "/stillmap/odometry", scans));
    EXPECT_TRUE(comes_to_hold(bag, "/points", scans));
  }
  EXPECT_EQ(sqlite.stop(), 0) << content("sqlite.log");
  EXPECT_EQ(mcap.stop(), 0) << content("mcap.log");
  const dds::Bag expected(path("sqlite")), made(path("mcap") + "/mcap_0.mcap");
  EXPECT_THAT(made.faults(), testing::IsEmpty());
  for (const char* topic : {"/points", "/imu/data", "/stillmap/odometry"}) {
    EXPECT_EQ(bytes_of(made, topic), bytes_of(expected, topic)) << topic;
  }
  const ProcessResult mapped = run("map " + path("mcap") + " --topic-in points --labels files" +
                                   " --json --out " + path("out"));
  EXPECT_EQ(mapped.exit_code, 0) << mapped.err;
  EXPECT_EQ(line_count("out/poses_lidar.txt"), static_cast<std::size_t>(scans));
}

TEST_F(RecordTest, CompressionIsOfMcapAlone) {
  const ProcessResult result = run("record " + path("bag") + " --compression zstd" + on_domain());
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--format mcap"));
  EXPECT_FALSE(exists("bag"));
}

TEST_F(RecordTest, WithNothingToRecordItSaysSo) {
  const ProcessResult result = run("record " + path("bag") + " --for 0.5" + on_domain());
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.out, HasSubstr("/stillmap/odometry: 0 (nobody publishes it)"));
  EXPECT_THAT(result.err, HasSubstr(std::to_string(domain_)));
  EXPECT_EQ(run("record " + path("bag") + " --for 0.5" + on_domain()).exit_code, 2);
}

TEST_F(RecordTest, RefusesATopicThatItDoesNotKnow) {
  const ProcessResult result = run("record " + path("bag") + " --topics imu" + on_domain());
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("'imu'"), HasSubstr("/stillmap/tiles")));
  EXPECT_FALSE(exists("bag"));
}

TEST_F(RecordTest, TheSensorOfARecordingIsFoundAndWritten) {
  simulate("city", 1);
  const ProcessResult result =
      run("dataset sensor " + path("city") + " --out " + path("sensor.yaml"));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("VLP-16"));
  EXPECT_EQ(
      run("map " + path("city") + " --sensor " + path("sensor.yaml") + " --out " + path("out"))
          .exit_code,
      0);
}

TEST_F(RecordTest, PacketsOfARealBagAreMapped) {
  const char* recordings = std::getenv("STILLMAP_TEST_DATA");
  if (recordings == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA names no folder of recordings";
  const std::string bag = std::string(recordings) + "/vlp16_packets/1673400471837873222";
  const ProcessResult result = run("map " + bag + " --labels none --json --out " + path("out"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 4U);
}

/// A bag with the scans on /a, and again on /b; the last message of each is damaged.
void write_two_lidars(const std::filesystem::path& folder, const ScanDataset& scans) {
  dds::BagWriter writer(folder, {dds::cloud_topic("/a"), dds::cloud_topic("/b")});
  for (std::size_t i = 0; i < scans.size(); ++i) {
    dds::Bytes message = dds::serialized(wire::to_cloud(scans.read(i).scan, {}, "lidar"));
    if (i + 1 == scans.size()) message.resize(8);
    for (const std::size_t topic : {0U, 1U}) writer.add(topic, scans.stamp_ns(i), message);
  }
  writer.finish();
}

TEST_F(RecordTest, APartOfABagThatCannotBeReadIsReportedAndRefusedWhereStrict) {
  simulate("city", 3);
  const ScanDataset scans(path("city"));
  {
    dds::BagWriter writer(folder_ / "bag", {dds::cloud_topic("/points")});
    for (std::size_t i = 0; i < scans.size(); ++i)
      writer.add(0, scans.stamp_ns(i),
                 dds::serialized(wire::to_cloud(scans.read(i).scan, {}, "lidar")));
    writer.finish();
  }
  std::filesystem::remove(folder_ / "bag/metadata.yaml");
  write("bag/second.db3", "no database");
  const std::string map = "map " + path("bag") + " --labels none --out " + path("out");
  const ProcessResult strict = run(map + " --strict");
  EXPECT_EQ(strict.exit_code, 2);
  EXPECT_THAT(strict.err, AllOf(HasSubstr("--strict"), HasSubstr("second.db3")));
  EXPECT_FALSE(exists("out"));
  const ProcessResult result = run(map + " --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto faults = nlohmann::json::parse(result.out).at("recording_faults");
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_THAT(faults[0].get<std::string>(), HasSubstr("second.db3"));
}

TEST_F(RecordTest, ARunOverOneTopicIsNotResumedOverAnother) {
  simulate("city", 13);
  write_two_lidars(folder_ / "bag", ScanDataset(path("city")));
  const std::string map = "map " + path("bag") + " --labels none --out " + path("out");
  EXPECT_EQ(run(map + " --topic-in /a --strict --save-period 0.0001").exit_code, 2);
  ASSERT_TRUE(exists("out/unfinished/run.stillmap"));
  const ProcessResult other = run(map + " --topic-in /b --resume");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, AllOf(HasSubstr("/a from scan 0"), HasSubstr("/b from scan 0")));
  const ProcessResult same = run(map + " --topic-in a --resume");
  EXPECT_EQ(same.exit_code, 0) << same.err;
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 12U);
}

TEST_F(RecordTest, EveryLidarIsRecordedOnItsOwnTopic) {
  dds::DdsOptions options;
  options.domain_id = static_cast<std::uint32_t>(domain_);
  dds::Participant participant(options);
  const dds::TopicQos qos = dds::points_topic("", DeliveryMode::latest, 5).writer;
  using Lidar = dds::Writer<sensor_msgs::msg::PointCloud2>;
  Lidar front(participant, "rt/front/points", qos), rear(participant, "rt/rear/points", qos);
  for (const std::string format : {"sqlite", "mcap"}) {
    BackgroundProcess record(stillmap_program() + " record " + path(format) + " --format " +
                                 format + " --points front/points /rear/points" + on_domain(),
                             folder_ / "record.log");
    for (Lidar* lidar : {&front, &rear}) {
      ASSERT_TRUE(lidar->readers().wait_for_any(patience)) << content("record.log");
    }
    ASSERT_TRUE(front.write(wire::to_cloud(dds::bag_scan(0), {}, "front")));
    ASSERT_TRUE(front.write(wire::to_cloud(dds::bag_scan(1), {}, "front")));
    ASSERT_TRUE(rear.write(wire::to_cloud(dds::bag_scan(2), {}, "rear")));
    EXPECT_TRUE(comes_to_hold(format, "/front/points", 2)) << content("record.log");
    EXPECT_TRUE(comes_to_hold(format, "/rear/points", 1)) << content("record.log");
    EXPECT_EQ(record.stop(), 0) << content("record.log");
    EXPECT_EQ(dds::open_sequence(path(format), "front/points").stamp_ns(1),
              dds::bag_scan(1).stamp_ns);
    EXPECT_EQ(dds::open_sequence(path(format), "rear/points").stamp_ns(0),
              dds::bag_scan(2).stamp_ns);
    // The next recorder is to be a new reader.
    ASSERT_TRUE(eventually([&] { return front.readers().count() + rear.readers().count() == 0; }));
  }
}

TEST_F(RecordTest, TopicsOfSeveralLidarsCanBeChosenFrom) {
  const std::string record = "record " + path("bag") + " --for 0.1" + on_domain();
  const ProcessResult unknown = run(record + " --topics front/points");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("--points names those of lidars"));
  const ProcessResult twice = run(record + " --points /a a");
  EXPECT_EQ(twice.exit_code, 2);
  EXPECT_THAT(twice.err, HasSubstr("--points names 'a' twice"));
  EXPECT_FALSE(exists("bag"));
  const ProcessResult chosen = run(record + " --points a b c --topics a c tf");
  EXPECT_EQ(chosen.exit_code, 1);
  EXPECT_THAT(chosen.out, AllOf(HasSubstr("/a: 0"), HasSubstr("/c: 0"), HasSubstr("/tf: 0"),
                                testing::Not(HasSubstr("/b: 0"))));
}

}  // namespace
}  // namespace stillmap::test
