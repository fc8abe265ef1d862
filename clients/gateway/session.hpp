#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "clients/gateway/operator_topics.hpp"
#include "clients/gateway/outbox.hpp"
#include "clients/gateway/service_bridge.hpp"
#include "clients/gateway/topic_bridge.hpp"

namespace stillmap::gateway {

/// What all clients share.
struct Bridges {
  TopicBridge& topics;
  ServiceBridge& services;
  OperatorTopics& operator_topics;
};

/// What a client got so far.
struct TopicTraffic {
  std::string topic;
  std::uint64_t sent = 0;
  std::uint64_t dropped = 0;
};

/// The protocol with one client, without its connection: messages in, an outbox to be sent. One
/// thread uses it.
class Session : private TopicListener, public std::enable_shared_from_this<Session> {
 public:
  struct Events {
    /// There is something new in the outbox.
    std::function<void()> has_output;
    /// The client is to be given up, and why.
    std::function<void(const std::string&)> failed;
  };

  Session(Bridges bridges, Events events, const OutboxLimits& limits = {});
  ~Session() override;
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Says what there is. `id` is that of this session.
  void begin(const std::string& server, const std::string& id);
  /// Anything that came from the client.
  void take_text(std::string_view text);
  void take_binary(std::span<const std::uint8_t> bytes);

  [[nodiscard]] Outbox& outbox() { return outbox_; }
  [[nodiscard]] const Outbox& outbox() const { return outbox_; }
  /// Tells the client which topics came faster than it took them since the last call.
  void report_dropped();
  [[nodiscard]] std::vector<TopicTraffic> traffic() const;
  /// The connection is gone: nothing is called any more.
  void end();

 private:
  struct Subscription {
    std::uint32_t channel = 0;
    Outbox::Counters reported;
    bool is_warned = false;
  };

  /// Of a topic that the client wants to publish.
  struct Offer {
    std::string topic;
    /// Why what is sent is not published; empty where it is.
    std::string refusal;
  };

  void message_arrived(std::uint32_t subscription, const MessagePtr& message) override;
  void topic_failed(std::uint32_t subscription, const std::string& why) override;

  void handle(const Subscribe& wishes);
  void handle(const Unsubscribe& ending);
  void handle(const ClientAdvertise& offer);
  void handle(const ClientUnadvertise& ending);
  void handle(const GetParameters& request);
  void handle(const NotOffered& message);
  void handle(const ClientMessage& message);
  void handle(const ServiceCall& call);

  void subscribe(const Subscribe::Wish& wish);
  void offer(const ClientAdvertise::Channel& channel);
  void answer(std::uint32_t service, std::uint32_t call, const ServiceBridge::Answer& answer);
  void report_dropped(std::uint32_t id, Subscription& subscription);
  void refuse(const std::string& why);
  void send(std::string text);
  void give_up(const std::string& why);

  Bridges bridges_;
  Events events_;
  Outbox outbox_;
  std::map<std::uint32_t, Subscription> subscriptions_;
  /// Topics by the client's numbers.
  std::map<std::uint32_t, Offer> offered_;
  int calls_under_way_ = 0;
  int refused_ = 0;
  bool has_ended_ = false;
};

/// Makes the session of a client that connected.
using MakeSession = std::function<std::shared_ptr<Session>(Session::Events)>;

}  // namespace stillmap::gateway
