// Against @mcap/core, the MCAP library of JavaScript that Foxglove and Lichtblick read with: files
// of ours are read by it, and files of its writer, in all of its variants, by us.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "idl/bag/bag.hpp"
#include "idl/conversions/imu.hpp"
#include "idl/dds/message_definition.hpp"
#include "nav_msgs.h"
#include "octomap_msgs.h"
#include "stillmap_msgs.h"
#include "tests/idl/bag_fixture.hpp"
#include "tests/scratch_folder.hpp"
#include "tf2_msgs.h"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;
using mcap::Compression;
using testing::HasSubstr;

class McapCore : public testing::Test {
 protected:
  void SetUp() override {
    if (!has_modules()) {
      GTEST_SKIP()
          << "@mcap/core is not there: it needs Debian's nodejs and npm, and a network once";
    }
  }

  /// Installs them in the build folder, as package-lock.json has them, unless they are there: npm
  /// writes its own list of them last. Tests run beside each other, and the lock lets one install.
  static bool has_modules() {
    static const bool has = [] {
      const std::string install =
          "cd '" STILLMAP_NODE_FOLDER
          "' && node --version > /dev/null 2>&1 && "
          "flock install.lock sh -c '[ -e node_modules/.package-lock.json ] || "
          "npm ci --ignore-scripts --no-audit --no-fund > /dev/null 2>&1'";
      return std::system(install.c_str()) == 0;
    }();
    return has;
  }

  /// What mcap_core.mjs prints; its last words where it fails.
  [[nodiscard]] std::string node(const std::string& arguments) const {
    const fs::path out = folder_ / "out";
    const std::string command = "STILLMAP_NODE_FOLDER='" STILLMAP_NODE_FOLDER
                                "' node '" STILLMAP_MCAP_CORE "' " +
                                arguments + " > " + out.string() + " 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << command << "\n" << content_of(out);
    return content_of(out);
  }

  ScratchFolder folder_;
};

BagTopic topic_of(const std::string& name, const std::string& type) {
  BagTopic topic = cloud_topic(name);
  topic.type = type;
  topic.definition = message_definition(type);
  EXPECT_FALSE(topic.definition.empty()) << type;
  return topic;
}

/// Messages of several types, of which some have texts, lists and lists of messages.
std::size_t write_messages(const fs::path& folder, Compression compression) {
  nav_msgs::msg::Path path;
  path.header().frame_id("map");
  path.poses().resize(3);
  path.poses()[2].header().frame_id("odd");
  tf2_msgs::msg::TFMessage tf;
  tf.transforms().resize(1);
  tf.transforms()[0].child_frame_id("base_link");
  octomap_msgs::msg::Octomap octomap;
  octomap.id("OcTree");
  octomap.data().assign(1000, 5);
  stillmap_msgs::msg::Status status;
  status.reason("none");
  status.counters().resize(2);
  status.counters()[1].name("scans_mapped");
  const ImuSample sample{1'700'000'000'123'456'789, {0.1, -0.2, 0.3}, {0.5, -9.5, 1.5}};
  const std::vector<std::pair<BagTopic, Bytes>> all{
      {topic_of("/points", "sensor_msgs/msg/PointCloud2"), bag_message(1)},
      {topic_of("/imu/data", "sensor_msgs/msg/Imu"), serialized(wire::to_imu(sample, "imu"))},
      {topic_of("/path", "nav_msgs/msg/Path"), serialized(path)},
      {topic_of("/tf", "tf2_msgs/msg/TFMessage"), serialized(tf)},
      {topic_of("/octomap", "octomap_msgs/msg/Octomap"), serialized(octomap)},
      {topic_of("/status", "stillmap_msgs/msg/Status"), serialized(status)}};
  std::vector<BagTopic> topics;
  for (const auto& [topic, message] : all) topics.push_back(topic);
  BagWriter writer(folder, topics, BagFormat::mcap, compression);
  std::int64_t now_ns = 1'700'000'000'000'000'000;
  for (int round = 0; round < 5; ++round) {
    for (std::size_t i = 0; i < all.size(); ++i) writer.add(i, now_ns += 1'000'000, all[i].second);
    writer.commit();
  }
  writer.finish();
  return 5 * all.size();
}

TEST_F(McapCore, ReadsAndDecodesWhatWeWrite) {
  for (const auto compression : {Compression::none, Compression::lz4, Compression::zstd}) {
    const std::string name = "bag" + std::string(mcap::compression_name(compression));
    const std::size_t messages = write_messages(folder_ / name, compression);
    const auto read =
        nlohmann::json::parse(node("read " + (folder_ / name / (name + "_0.mcap")).string()));
    EXPECT_EQ(read.at("profile"), "ros2");
    EXPECT_EQ(read.at("chunks"), 5);
    EXPECT_EQ(read.at("compressions").at(0), mcap::compression_name(compression));
    EXPECT_EQ(read.at("messages").size(), messages);
    EXPECT_EQ(read.at("decoded"), messages) << "by the definitions beside them";
    const auto& points = read.at("topics").at("/points");
    EXPECT_EQ(points.at("type"), "sensor_msgs/msg/PointCloud2");
    EXPECT_EQ(points.at("messages"), 5);
    EXPECT_EQ(points.at("message_encoding"), "cdr");
    EXPECT_THAT(points.at("qos").get<std::string>(), HasSubstr("reliability: 1"));
  }
}

std::vector<Bytes> messages_of(const Bag& bag, const std::string& topic) {
  std::vector<Bytes> messages;
  for (const BagMessage& message : bag.messages(topic)) messages.push_back(bag.bytes(message));
  return messages;
}

TEST_F(McapCore, WritesWhatWeRead) {
  write_messages(folder_ / "bag", Compression::none);
  const Bag ours(folder_ / "bag");
  for (const char* options :
       {R"({})", R"({"compression": "zstd"})", R"({"compression": "lz4"})",
        R"({"useChunks": false})", R"({"useChunks": false, "useStatistics": false})",
        R"({"useMessageIndex": false})", R"({"useChunkIndex": false})",
        R"({"useStatistics": false, "compression": "zstd"})", R"({"useSummaryOffsets": false})",
        R"({"repeatSchemas": false, "repeatChannels": false})",
        R"({"chunkSize": 10, "compression": "lz4"})"}) {
    SCOPED_TRACE(options);
    const fs::path copy = folder_ / "copy.mcap";
    static_cast<void>(node("copy " + (folder_ / "bag" / "bag_0.mcap").string() + " " +
                           copy.string() + " '" + options + "'"));
    const Bag theirs(copy);
    EXPECT_THAT(theirs.faults(), testing::IsEmpty());
    ASSERT_EQ(theirs.topics().size(), ours.topics().size());
    for (const BagTopic& topic : ours.topics()) {
      const auto found = std::ranges::find(theirs.topics(), topic.name, &BagTopic::name);
      ASSERT_NE(found, theirs.topics().end()) << topic.name;
      EXPECT_EQ(found->type, topic.type);
      EXPECT_EQ(found->messages, topic.messages);
      EXPECT_EQ(messages_of(theirs, topic.name), messages_of(ours, topic.name)) << topic.name;
    }
  }
}

}  // namespace
}  // namespace stillmap::dds
