#include "clients/gateway/session.hpp"

#include <utility>

namespace stillmap::gateway {
namespace {

/// Of one client.
constexpr std::size_t max_subscriptions = 256;
constexpr std::size_t max_offered = 16;
constexpr int max_calls_under_way = 32;
/// Messages that are none of the protocol, before a client is given up.
constexpr int max_refused = 100;

std::string name_of_warning(const std::string& topic) { return "slow " + topic; }

}  // namespace

Session::Session(Bridges bridges, Events events, const OutboxLimits& limits)
    : bridges_(bridges), events_(std::move(events)), outbox_(limits) {}

Session::~Session() { end(); }

void Session::begin(const std::string& server, const std::string& id) {
  send(server_info(server, id));
  send(advertise(bridges_.topics.channels()));
  send(advertise_services(bridges_.services.services()));
}

void Session::take_text(std::string_view text) {
  try {
    std::visit([this](const auto& message) { handle(message); }, parse_text(text));
  } catch (const std::exception& error) {
    // Whatever it is: one client's message ends nothing of the others'.
    refuse(error.what());
  }
}

void Session::take_binary(std::span<const std::uint8_t> bytes) {
  try {
    std::visit([this](const auto& message) { handle(message); }, parse_binary(bytes));
  } catch (const std::exception& error) {
    // Whatever it is: one client's message ends nothing of the others'.
    refuse(error.what());
  }
}

void Session::handle(const Subscribe& wishes) {
  for (const Subscribe::Wish& wish : wishes.subscriptions) subscribe(wish);
}

void Session::subscribe(const Subscribe::Wish& wish) {
  if (!bridges_.topics.has(wish.channel)) {
    return refuse("there is no channel " + std::to_string(wish.channel));
  }
  if (subscriptions_.contains(wish.id)) {
    return refuse("subscription " + std::to_string(wish.id) + " exists already");
  }
  if (subscriptions_.size() >= max_subscriptions) return refuse("too many subscriptions");
  subscriptions_[wish.id].channel = wish.channel;
  outbox_.open(wish.id, bridges_.topics.topic(wish.channel).max_waiting);
  bridges_.topics.listen(wish.channel, *this, wish.id);
}

void Session::handle(const Unsubscribe& ending) {
  for (const std::uint32_t id : ending.ids) {
    const auto found = subscriptions_.find(id);
    if (found == subscriptions_.end()) {
      refuse("there is no subscription " + std::to_string(id));
      continue;
    }
    bridges_.topics.stop_listening(found->second.channel, *this, id);
    outbox_.close(id);
    subscriptions_.erase(found);
  }
}

void Session::handle(const ClientAdvertise& offer_list) {
  for (const ClientAdvertise::Channel& channel : offer_list.channels) offer(channel);
}

void Session::offer(const ClientAdvertise::Channel& channel) {
  if (offered_.size() >= max_offered) return refuse("too many published topics");
  // Viewers offer more than they ever publish: who is refused hears of it with the first message.
  offered_[channel.id] = {
      channel.topic,
      channel.encoding != "cdr"
          ? "messages in '" + channel.encoding + "' are not published; in cdr they are"
          : bridges_.operator_topics.refusal(channel.topic, channel.type)};
}

void Session::handle(const ClientUnadvertise& ending) {
  for (const std::uint32_t id : ending.ids) offered_.erase(id);
}

void Session::handle(const GetParameters& request) { send(no_parameters(request.id)); }

void Session::handle(const NotOffered& message) { refuse("'" + message.op + "' is not offered"); }

void Session::handle(const ClientMessage& message) {
  const auto found = offered_.find(message.channel);
  if (found == offered_.end()) {
    return refuse("channel " + std::to_string(message.channel) + " was not advertised");
  }
  if (!found->second.refusal.empty()) return refuse(found->second.refusal);
  const std::string fault = bridges_.operator_topics.publish(found->second.topic, message.bytes);
  if (!fault.empty()) refuse(fault);
}

void Session::handle(const ServiceCall& call) {
  const auto fail = [&](const std::string& why) {
    send(service_call_failure(call.service, call.call, why));
  };
  if (!bridges_.services.has(call.service)) return fail("there is no such service");
  if (call.encoding != "cdr") return fail("requests are taken in cdr");
  if (calls_under_way_ >= max_calls_under_way) return fail("too many calls wait for an answer");
  ++calls_under_way_;
  bridges_.services.call(call.service, weak_from_this(), {call.bytes.begin(), call.bytes.end()},
                         [self = weak_from_this(), service = call.service,
                          number = call.call](const ServiceBridge::Answer& reply) {
                           if (const auto session = self.lock())
                             session->answer(service, number, reply);
                         });
}

void Session::answer(std::uint32_t service, std::uint32_t call,
                     const ServiceBridge::Answer& answer) {
  --calls_under_way_;
  if (has_ended_) return;
  if (const auto* const why = std::get_if<std::string>(&answer)) {
    return send(service_call_failure(service, call, *why));
  }
  const bool fits =
      outbox_.push_answer(service_response(service, call, std::get<dds::SerializedSample>(answer)));
  fits ? events_.has_output() : give_up("it does not take its answers");
}

void Session::message_arrived(std::uint32_t subscription, const MessagePtr& message) {
  outbox_.push(subscription, message);
  events_.has_output();
}

void Session::topic_failed(std::uint32_t subscription, const std::string& why) {
  const std::uint32_t channel = subscriptions_.at(subscription).channel;
  send(status(StatusLevel::error,
              bridges_.topics.channels()[channel - 1].topic + " cannot be read: " + why));
}

void Session::report_dropped() {
  for (auto& [id, subscription] : subscriptions_) report_dropped(id, subscription);
}

void Session::report_dropped(std::uint32_t id, Subscription& subscription) {
  const Outbox::Counters now = outbox_.counters().at(id);
  const std::uint64_t dropped = now.dropped - subscription.reported.dropped;
  const std::uint64_t all = dropped + now.sent - subscription.reported.sent;
  subscription.reported = now;
  const std::string& topic = bridges_.topics.channels()[subscription.channel - 1].topic;
  if (dropped > 0) {
    send(status(StatusLevel::warning,
                std::to_string(dropped) + " of " + std::to_string(all) + " messages of " + topic +
                    " were left out for newer ones: they come faster than this connection or this "
                    "client takes them",
                name_of_warning(topic)));
  } else if (subscription.is_warned) {
    send(remove_status(name_of_warning(topic)));
  }
  subscription.is_warned = dropped > 0;
}

std::vector<TopicTraffic> Session::traffic() const {
  std::vector<TopicTraffic> traffic;
  for (const auto& [id, subscription] : subscriptions_) {
    const Outbox::Counters& counters = outbox_.counters().at(id);
    traffic.push_back({.topic = bridges_.topics.channels()[subscription.channel - 1].topic,
                       .sent = counters.sent,
                       .dropped = counters.dropped});
  }
  return traffic;
}

void Session::end() {
  has_ended_ = true;
  for (const auto& [id, subscription] : subscriptions_) {
    bridges_.topics.stop_listening(subscription.channel, *this, id);
  }
  subscriptions_.clear();
}

void Session::refuse(const std::string& why) {
  if (++refused_ > max_refused) return give_up("it sent too much that is not understood");
  send(status(StatusLevel::error, why));
}

void Session::send(std::string text) {
  if (!outbox_.push_text(std::move(text))) return give_up("it does not read");
  events_.has_output();
}

void Session::give_up(const std::string& why) { events_.failed(why); }

}  // namespace stillmap::gateway
