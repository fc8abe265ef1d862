#include "clients/gateway/foxglove_protocol.hpp"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>

#include "idl/dds/message_definition.hpp"

namespace stillmap::gateway {
namespace {

using Json = nlohmann::json;

constexpr std::uint8_t message_data_op = 1;
constexpr std::uint8_t service_response_op = 3;
constexpr std::uint8_t client_message_op = 1;
constexpr std::uint8_t service_request_op = 2;
/// Channels, subscriptions or ids in one message.
constexpr std::size_t max_listed = 1000;

/// What it quotes of a client or a server may be cut within a character.
std::string text_of_message(const Json& message) {
  return message.dump(-1, ' ', false, Json::error_handler_t::replace);
}

template <typename T>
void put(T value, std::uint8_t* to) {
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    to[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i));
  }
}

/// Takes a number from the front. Throws ProtocolError when there are too few bytes.
std::uint32_t take_uint32(std::span<const std::uint8_t>& bytes) {
  if (bytes.size() < 4) throw ProtocolError("a binary message ends too early");
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value |= static_cast<std::uint32_t>(bytes[i]) << (8 * i);
  bytes = bytes.subspan(4);
  return value;
}

const Json& member(const Json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) throw ProtocolError(std::string("field '") + key + "' is missing");
  return *found;
}

std::string text_of(const Json& object, const char* key) {
  const Json& value = member(object, key);
  if (!value.is_string()) throw ProtocolError(std::string("field '") + key + "' is no text");
  return value.get<std::string>();
}

std::uint32_t id_of(const Json& value, const char* key) {
  const bool is_id = value.is_number_unsigned() &&
                     value.get<std::uint64_t>() <= std::numeric_limits<std::uint32_t>::max();
  if (!is_id) throw ProtocolError(std::string("'") + key + "' is no id (0..4294967295)");
  return value.get<std::uint32_t>();
}

const Json& list_of(const Json& object, const char* key) {
  const Json& list = member(object, key);
  if (!list.is_array()) throw ProtocolError(std::string("field '") + key + "' is no list");
  if (list.size() > max_listed) throw ProtocolError(std::string("list '") + key + "' is too long");
  return list;
}

std::vector<std::uint32_t> ids_of(const Json& object, const char* key) {
  std::vector<std::uint32_t> ids;
  for (const Json& value : list_of(object, key)) ids.push_back(id_of(value, key));
  return ids;
}

Subscribe subscribe_of(const Json& message) {
  Subscribe wishes;
  for (const Json& entry : list_of(message, "subscriptions")) {
    wishes.subscriptions.push_back({.id = id_of(member(entry, "id"), "id"),
                                    .channel = id_of(member(entry, "channelId"), "channelId")});
  }
  return wishes;
}

ClientAdvertise advertise_of(const Json& message) {
  ClientAdvertise offer;
  for (const Json& entry : list_of(message, "channels")) {
    offer.channels.push_back({.id = id_of(member(entry, "id"), "id"),
                              .topic = text_of(entry, "topic"),
                              .encoding = text_of(entry, "encoding"),
                              .type = text_of(entry, "schemaName")});
  }
  return offer;
}

Json half_of_service(const std::string& type, const char* half) {
  const std::string name = type + half;
  return {{"encoding", "cdr"},
          {"schemaName", name},
          {"schemaEncoding", "ros2msg"},
          {"schema", dds::message_definition(name)}};
}

}  // namespace

std::string server_info(const std::string& name, const std::string& session) {
  return text_of_message({{"op", "serverInfo"},
                          {"name", name},
                          {"capabilities", {"clientPublish", "services"}},
                          {"supportedEncodings", {"cdr"}},
                          // Lichtblick and Foxglove look for it to tell ROS 1 from ROS 2.
                          {"metadata", {{"ROS_DISTRO", "humble"}}},
                          {"sessionId", session}});
}

std::string advertise(std::span<const ChannelInfo> channels) {
  Json list = Json::array();
  for (const ChannelInfo& channel : channels) {
    list.push_back({{"id", channel.id},
                    {"topic", channel.topic},
                    {"encoding", "cdr"},
                    {"schemaName", channel.type},
                    {"schemaEncoding", "ros2msg"},
                    {"schema", dds::message_definition(channel.type)}});
  }
  return text_of_message({{"op", "advertise"}, {"channels", list}});
}

std::string advertise_services(std::span<const ServiceInfo> services) {
  Json list = Json::array();
  for (const ServiceInfo& service : services) {
    // Without requestSchema and responseSchema of the clients before 2024: Lichtblick warns of
    // each.
    list.push_back({{"id", service.id},
                    {"name", service.name},
                    {"type", service.type},
                    {"request", half_of_service(service.type, "_Request")},
                    {"response", half_of_service(service.type, "_Response")}});
  }
  return text_of_message({{"op", "advertiseServices"}, {"services", list}});
}

std::string status(StatusLevel level, const std::string& text, const std::string& id) {
  Json message{{"op", "status"}, {"level", static_cast<int>(level)}, {"message", text}};
  if (!id.empty()) message["id"] = id;
  return text_of_message(message);
}

std::string remove_status(const std::string& id) {
  return text_of_message({{"op", "removeStatus"}, {"statusIds", Json::array({id})}});
}

std::string service_call_failure(std::uint32_t service, std::uint32_t call,
                                 const std::string& why) {
  return text_of_message(
      {{"op", "serviceCallFailure"}, {"serviceId", service}, {"callId", call}, {"message", why}});
}

std::string no_parameters(const std::string& request_id) {
  Json message{{"op", "parameterValues"}, {"parameters", Json::array()}};
  if (!request_id.empty()) message["id"] = request_id;
  return text_of_message(message);
}

MessageHeader message_header(std::uint32_t subscription, std::int64_t time_ns) {
  MessageHeader header{message_data_op};
  put(subscription, &header[1]);
  put(time_ns, &header[5]);
  return header;
}

std::vector<std::uint8_t> service_response(std::uint32_t service, std::uint32_t call,
                                           std::span<const std::uint8_t> reply) {
  constexpr std::string_view encoding = "cdr";
  constexpr std::size_t numbers_bytes = 13;
  std::vector<std::uint8_t> bytes(numbers_bytes + encoding.size() + reply.size());
  bytes[0] = service_response_op;
  put(service, &bytes[1]);
  put(call, &bytes[5]);
  put(static_cast<std::uint32_t>(encoding.size()), &bytes[9]);
  const auto place = std::ranges::copy(encoding, &bytes[numbers_bytes]).out;
  std::ranges::copy(reply, place);
  return bytes;
}

ClientText parse_text(std::string_view text) {
  const Json message = Json::parse(text, nullptr, false);
  if (!message.is_object()) throw ProtocolError("a text message is no JSON object");
  const std::string op = text_of(message, "op");
  if (op == "subscribe") return subscribe_of(message);
  if (op == "unsubscribe") return Unsubscribe{ids_of(message, "subscriptionIds")};
  if (op == "advertise") return advertise_of(message);
  if (op == "unadvertise") return ClientUnadvertise{ids_of(message, "channelIds")};
  if (op == "getParameters") {
    return GetParameters{message.contains("id") ? text_of(message, "id") : std::string()};
  }
  constexpr std::size_t longest_op = 64;
  return NotOffered{op.substr(0, longest_op)};
}

ClientBinary parse_binary(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) throw ProtocolError("a binary message is empty");
  const std::uint8_t op = bytes.front();
  bytes = bytes.subspan(1);
  if (op == client_message_op) {
    const std::uint32_t channel = take_uint32(bytes);
    return ClientMessage{.channel = channel, .bytes = bytes};
  }
  if (op != service_request_op) {
    throw ProtocolError("binary messages of kind " + std::to_string(op) + " are not known");
  }
  ServiceCall call;
  call.service = take_uint32(bytes);
  call.call = take_uint32(bytes);
  const std::uint32_t length = take_uint32(bytes);
  if (length > bytes.size()) throw ProtocolError("a service call ends within its encoding");
  call.encoding = {reinterpret_cast<const char*>(bytes.data()), length};
  call.bytes = bytes.subspan(length);
  return call;
}

}  // namespace stillmap::gateway
