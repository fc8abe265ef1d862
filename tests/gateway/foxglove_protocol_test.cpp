#include "clients/gateway/foxglove_protocol.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <random>

namespace stillmap::gateway {
namespace {

using ::testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

template <typename T>
T text_as(std::string_view text) {
  return std::get<T>(parse_text(text));
}

std::string refusal_of(std::string_view text) {
  try {
    static_cast<void>(parse_text(text));
  } catch (const ProtocolError& error) {
    return error.what();
  }
  return "";
}

std::string refusal_of(const Bytes& bytes) {
  try {
    static_cast<void>(parse_binary(bytes));
  } catch (const ProtocolError& error) {
    return error.what();
  }
  return "";
}

TEST(FoxgloveProtocol, ReadsSubscriptions) {
  const auto wishes = text_as<Subscribe>(
      R"({"op":"subscribe","subscriptions":[{"id":7,"channelId":2},{"id":4294967295,"channelId":3}]})");
  ASSERT_EQ(wishes.subscriptions.size(), 2U);
  EXPECT_EQ(wishes.subscriptions[0].id, 7U);
  EXPECT_EQ(wishes.subscriptions[0].channel, 2U);
  EXPECT_EQ(wishes.subscriptions[1].id, 4294967295U);
  EXPECT_EQ(text_as<Unsubscribe>(R"({"op":"unsubscribe","subscriptionIds":[7]})").ids,
            std::vector<std::uint32_t>{7});
}

TEST(FoxgloveProtocol, ReadsWhatClientsPublish) {
  const auto offer = text_as<ClientAdvertise>(
      R"({"op":"advertise","channels":[{"id":1,"topic":"/goal_pose","encoding":"cdr",
          "schemaName":"geometry_msgs/PoseStamped","schema":"whatever"}]})");
  ASSERT_EQ(offer.channels.size(), 1U);
  EXPECT_EQ(offer.channels[0].topic, "/goal_pose");
  EXPECT_EQ(offer.channels[0].type, "geometry_msgs/PoseStamped");
  const Bytes bytes{1, 9, 0, 0, 0, 42, 43};
  const auto message = std::get<ClientMessage>(parse_binary(bytes));
  EXPECT_EQ(message.channel, 9U);
  EXPECT_THAT(message.bytes, ::testing::ElementsAre(42, 43));
}

TEST(FoxgloveProtocol, ReadsServiceCalls) {
  const Bytes bytes{2, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 'c', 'd', 'r', 5, 6};
  const auto call = std::get<ServiceCall>(parse_binary(bytes));
  EXPECT_EQ(call.service, 1U);
  EXPECT_EQ(call.call, 2U);
  EXPECT_EQ(call.encoding, "cdr");
  EXPECT_THAT(call.bytes, ::testing::ElementsAre(5, 6));
}

TEST(FoxgloveProtocol, NamesWhatIsWrong) {
  EXPECT_THAT(refusal_of("{"), HasSubstr("no JSON object"));
  EXPECT_THAT(refusal_of("[1]"), HasSubstr("no JSON object"));
  EXPECT_THAT(refusal_of("\xff\xfe"), HasSubstr("no JSON object"));
  EXPECT_THAT(refusal_of("{}"), HasSubstr("'op' is missing"));
  EXPECT_THAT(refusal_of(R"({"op":1})"), HasSubstr("'op' is no text"));
  EXPECT_THAT(refusal_of(R"({"op":"subscribe"})"), HasSubstr("'subscriptions' is missing"));
  EXPECT_THAT(refusal_of(R"({"op":"unsubscribe","subscriptionIds":[-1]})"), HasSubstr("no id"));
  EXPECT_THAT(refusal_of(R"({"op":"unsubscribe","subscriptionIds":[1.5]})"), HasSubstr("no id"));
  EXPECT_THAT(refusal_of(R"({"op":"unsubscribe","subscriptionIds":[4294967296]})"),
              HasSubstr("no id"));
  EXPECT_THAT(refusal_of(R"({"op":"subscribe","subscriptions":[5]})"), HasSubstr("missing"));
  EXPECT_EQ(text_as<NotOffered>(R"({"op":"fetchAsset"})").op, "fetchAsset");
}

TEST(FoxgloveProtocol, SaysAgainWhatIsCutWithinACharacter) {
  const std::string op = std::string(63, 'a') + "\u00e9";
  const auto refused = text_as<NotOffered>(R"({"op":")" + op + R"("})");
  const std::string text = status(StatusLevel::error, "no '" + refused.op + "' here", refused.op);
  EXPECT_TRUE(nlohmann::json::accept(text)) << text;
  EXPECT_TRUE(nlohmann::json::accept(service_call_failure(1, 2, "\xc3\x28\xff")));
}

TEST(FoxgloveProtocol, RefusesListsWithoutAnEnd) {
  std::string text = R"({"op":"unsubscribe","subscriptionIds":[0)";
  for (int i = 0; i < 5000; ++i) text += ",1";
  EXPECT_THAT(refusal_of(text + "]}"), HasSubstr("too long"));
}

TEST(FoxgloveProtocol, RefusesBinaryMessagesThatEndTooEarly) {
  const Bytes call{2, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 'c', 'd', 'r'};
  for (std::size_t length = 0; length < call.size(); ++length) {
    const Bytes cut(call.begin(), call.begin() + static_cast<std::ptrdiff_t>(length));
    EXPECT_NE(refusal_of(cut), "") << length;
  }
  EXPECT_THAT(refusal_of(Bytes{2, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255, 'c'}),
              HasSubstr("within its encoding"));
  EXPECT_THAT(refusal_of(Bytes{77, 0}), HasSubstr("kind 77"));
}

TEST(FoxgloveProtocol, TakesAnyBytes) {
  std::mt19937 random(7);
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes(random() % 40);
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    if (!bytes.empty()) bytes[0] = static_cast<std::uint8_t>(random() % 3);
    static_cast<void>(refusal_of(bytes));
    static_cast<void>(
        refusal_of(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size())));
  }
}

TEST(FoxgloveProtocol, AdvertisesTopicsWithTheirDefinitions) {
  const std::vector<ChannelInfo> channels{
      {.id = 3, .topic = "/stillmap/odometry", .type = "nav_msgs/msg/Odometry"}};
  const auto message = nlohmann::json::parse(advertise(channels));
  EXPECT_EQ(message["op"], "advertise");
  const auto& channel = message["channels"][0];
  EXPECT_EQ(channel["id"], 3);
  EXPECT_EQ(channel["encoding"], "cdr");
  EXPECT_EQ(channel["schemaEncoding"], "ros2msg");
  EXPECT_THAT(channel["schema"].get<std::string>(), HasSubstr("MSG: geometry_msgs/Pose\n"));
}

TEST(FoxgloveProtocol, AdvertisesBothHalvesOfServices) {
  const std::vector<ServiceInfo> services{
      {.id = 1, .name = "/stillmap/get_map", .type = "nav_msgs/srv/GetMap"}};
  const auto service = nlohmann::json::parse(advertise_services(services))["services"][0];
  EXPECT_EQ(service["type"], "nav_msgs/srv/GetMap");
  EXPECT_EQ(service["request"]["schemaName"], "nav_msgs/srv/GetMap_Request");
  EXPECT_THAT(service["response"]["schema"].get<std::string>(), HasSubstr("OccupancyGrid map"));
  EXPECT_FALSE(service.contains("responseSchema")) << "Lichtblick warns of it";
}

TEST(FoxgloveProtocol, WritesNumbersLittleEndian) {
  EXPECT_EQ(message_header(0x01020304, 0x1112131415161718),
            (MessageHeader{1, 4, 3, 2, 1, 0x18, 0x17, 0x16, 0x15, 0x14, 0x13, 0x12, 0x11}));
  EXPECT_EQ(service_response(1, 2, Bytes{9}),
            (Bytes{3, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 'c', 'd', 'r', 9}));
}

}  // namespace
}  // namespace stillmap::gateway
