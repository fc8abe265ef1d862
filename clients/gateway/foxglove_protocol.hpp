#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace stillmap::gateway {

// The Foxglove WebSocket protocol, version 1, as its specification has it (foxglove/ws-protocol):
// control as JSON texts, data as little-endian binary messages.

/// The names under which clients ask for it; both mean the same messages.
inline constexpr std::array<std::string_view, 2> foxglove_subprotocols{"foxglove.sdk.v1",
                                                                       "foxglove.websocket.v1"};

/// A topic that clients may subscribe to.
struct ChannelInfo {
  std::uint32_t id = 0;
  /// ROS 2 name: "/stillmap/odometry".
  std::string topic;
  /// "nav_msgs/msg/Odometry".
  std::string type;
};

/// A service that clients may call.
struct ServiceInfo {
  std::uint32_t id = 0;
  /// "/stillmap/get_status".
  std::string name;
  /// "stillmap_msgs/srv/GetStatus".
  std::string type;
};

/// With the numbers that the protocol has for them.
enum class StatusLevel { info = 0, warning = 1, error = 2 };

// What this side sends.

[[nodiscard]] std::string server_info(const std::string& name, const std::string& session);
[[nodiscard]] std::string advertise(std::span<const ChannelInfo> channels);
[[nodiscard]] std::string advertise_services(std::span<const ServiceInfo> services);
/// A status with an `id` replaces the last one of that id.
[[nodiscard]] std::string status(StatusLevel level, const std::string& text,
                                 const std::string& id = {});
[[nodiscard]] std::string remove_status(const std::string& id);
/// `call` is the client's number of the call.
[[nodiscard]] std::string service_call_failure(std::uint32_t service, std::uint32_t call,
                                               const std::string& why);
/// There are none.
[[nodiscard]] std::string no_parameters(const std::string& request_id);

/// What stands before a message's bytes.
using MessageHeader = std::array<std::uint8_t, 13>;
[[nodiscard]] MessageHeader message_header(std::uint32_t subscription, std::int64_t time_ns);
/// An answer in CDR.
[[nodiscard]] std::vector<std::uint8_t> service_response(std::uint32_t service, std::uint32_t call,
                                                         std::span<const std::uint8_t> reply);

// What clients send.

/// Asks for channels, each under an id that the client chose.
struct Subscribe {
  struct Wish {
    std::uint32_t id = 0;
    std::uint32_t channel = 0;
  };
  std::vector<Wish> subscriptions;
};
/// By the ids of its subscriptions.
struct Unsubscribe {
  std::vector<std::uint32_t> ids;
};
/// Channels that the client will publish on, by ids of its own.
struct ClientAdvertise {
  struct Channel {
    std::uint32_t id = 0;
    std::string topic;
    std::string encoding;
    std::string type;
  };
  std::vector<Channel> channels;
};
/// By the ids of its channels.
struct ClientUnadvertise {
  std::vector<std::uint32_t> ids;
};
/// The answer bears this id, and no parameters.
struct GetParameters {
  std::string id;
};
/// Of the protocol, but not offered here.
struct NotOffered {
  std::string op;
};
/// `bytes` lie in the message that was parsed.
struct ClientMessage {
  std::uint32_t channel = 0;
  std::span<const std::uint8_t> bytes;
};
/// `bytes` lie in the message that was parsed.
struct ServiceCall {
  std::uint32_t service = 0;
  std::uint32_t call = 0;
  std::string_view encoding;
  std::span<const std::uint8_t> bytes;
};

using ClientText = std::variant<Subscribe, Unsubscribe, ClientAdvertise, ClientUnadvertise,
                                GetParameters, NotOffered>;
using ClientBinary = std::variant<ClientMessage, ServiceCall>;

/// A message that is none of the protocol; says what is wrong with it.
class ProtocolError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Both take any bytes, and throw ProtocolError.
[[nodiscard]] ClientText parse_text(std::string_view text);
[[nodiscard]] ClientBinary parse_binary(std::span<const std::uint8_t> bytes);

}  // namespace stillmap::gateway
