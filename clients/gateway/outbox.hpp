#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <variant>
#include <vector>

#include "clients/gateway/message.hpp"

namespace stillmap::gateway {

struct OutboxLimits {
  /// Messages up to this size overtake larger ones.
  std::size_t small_bytes = 32U << 10U;
  /// Of a subscription; the oldest go first.
  std::size_t max_waiting_bytes = 64U << 20U;
  /// Of texts and answers together: a client with more does not read them.
  std::size_t max_answer_bytes = 64U << 20U;
};

/// What waits to be sent to one client: a queue for each subscription, in which a message replaces
/// an older one of its key, and one for texts and answers, of which none is left out. Memory is
/// bounded whatever the client does. Not thread-safe.
class Outbox {
 public:
  explicit Outbox(const OutboxLimits& limits = {}) : limits_(limits) {}

  struct Counters {
    std::uint64_t sent = 0;
    /// Replaced by newer ones, or too many, before they could be sent.
    std::uint64_t dropped = 0;
  };

  /// `max_waiting`: messages of different keys.
  void open(std::uint32_t subscription, std::size_t max_waiting);
  void close(std::uint32_t subscription);
  /// Of an open subscription.
  void push(std::uint32_t subscription, MessagePtr message);

  /// False when too many bytes wait: the client is to be given up.
  [[nodiscard]] bool push_text(std::string text);
  [[nodiscard]] bool push_answer(std::vector<std::uint8_t> answer);

  struct Data {
    std::uint32_t subscription = 0;
    MessagePtr message;
  };
  using Item = std::variant<std::string, std::vector<std::uint8_t>, Data>;

  /// The next to be sent: texts, then small messages and answers, subscriptions in turn, then, with
  /// `large_too`, large ones. Nothing when nothing of these waits.
  [[nodiscard]] std::optional<Item> next(bool large_too);
  [[nodiscard]] bool is_small(const Item& item) const;
  [[nodiscard]] const std::map<std::uint32_t, Counters>& counters() const { return counters_; }
  [[nodiscard]] std::size_t waiting_bytes() const;

 private:
  struct Queue {
    std::size_t max_waiting = 1;
    std::size_t bytes = 0;
    /// Keys, the oldest first, and their newest messages.
    std::deque<std::string> order;
    std::unordered_map<std::string, MessagePtr> newest;

    [[nodiscard]] const MessagePtr& front() const { return newest.at(order.front()); }
    MessagePtr pop();
  };

  [[nodiscard]] bool fits(std::size_t bytes);
  [[nodiscard]] std::optional<Item> next_data(bool want_small);
  [[nodiscard]] bool is_small_size(std::size_t bytes) const { return bytes <= limits_.small_bytes; }

  OutboxLimits limits_;
  std::map<std::uint32_t, Queue> queues_;
  std::map<std::uint32_t, Counters> counters_;
  std::deque<std::string> texts_;
  std::deque<std::vector<std::uint8_t>> answers_;
  std::size_t answer_bytes_ = 0;
  /// Subscriptions after it come first.
  std::uint32_t last_served_ = 0;
  bool answer_was_last_ = false;
};

}  // namespace stillmap::gateway
