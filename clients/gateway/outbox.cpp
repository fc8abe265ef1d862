#include "clients/gateway/outbox.hpp"

#include <algorithm>
#include <utility>

namespace stillmap::gateway {

MessagePtr Outbox::Queue::pop() {
  const auto found = newest.find(order.front());
  MessagePtr message = std::move(found->second);
  newest.erase(found);
  order.pop_front();
  bytes -= message->bytes.size();
  return message;
}

void Outbox::open(std::uint32_t subscription, std::size_t max_waiting) {
  queues_[subscription].max_waiting = max_waiting;
  counters_.try_emplace(subscription);
}

void Outbox::close(std::uint32_t subscription) {
  queues_.erase(subscription);
  counters_.erase(subscription);
}

void Outbox::push(std::uint32_t subscription, MessagePtr message) {
  Queue& queue = queues_.at(subscription);
  Counters& counters = counters_.at(subscription);
  queue.bytes += message->bytes.size();
  const auto [place, is_new] = queue.newest.try_emplace(message->key, message);
  if (is_new) {
    queue.order.push_back(message->key);
  } else {
    queue.bytes -= place->second->bytes.size();
    place->second = std::move(message);
    ++counters.dropped;
  }
  while (queue.order.size() > 1 &&
         (queue.order.size() > queue.max_waiting || queue.bytes > limits_.max_waiting_bytes)) {
    static_cast<void>(queue.pop());
    ++counters.dropped;
  }
}

bool Outbox::fits(std::size_t bytes) {
  if (answer_bytes_ + bytes > limits_.max_answer_bytes) return false;
  answer_bytes_ += bytes;
  return true;
}

bool Outbox::push_text(std::string text) {
  if (!fits(text.size())) return false;
  texts_.push_back(std::move(text));
  return true;
}

bool Outbox::push_answer(std::vector<std::uint8_t> answer) {
  if (!fits(answer.size())) return false;
  answers_.push_back(std::move(answer));
  return true;
}

std::optional<Outbox::Item> Outbox::next_data(bool want_small) {
  const auto serve = [&](auto from, auto to) -> std::optional<Item> {
    for (auto at = from; at != to; ++at) {
      auto& [subscription, queue] = *at;
      if (queue.order.empty()) continue;
      if (is_small_size(queue.front()->bytes.size()) != want_small) continue;
      last_served_ = subscription;
      ++counters_.at(subscription).sent;
      return Data{subscription, queue.pop()};
    }
    return std::nullopt;
  };
  const auto after_last = queues_.upper_bound(last_served_);
  if (auto item = serve(after_last, queues_.end())) return item;
  return serve(queues_.begin(), after_last);
}

std::optional<Outbox::Item> Outbox::next(bool large_too) {
  if (!texts_.empty()) {
    Item item = std::move(texts_.front());
    texts_.pop_front();
    answer_bytes_ -= std::get<std::string>(item).size();
    return item;
  }
  const auto next_answer = [&]() -> std::optional<Item> {
    Item item = std::move(answers_.front());
    answers_.pop_front();
    answer_bytes_ -= std::get<std::vector<std::uint8_t>>(item).size();
    return item;
  };
  if (!answers_.empty() && is_small_size(answers_.front().size())) return next_answer();
  if (auto item = next_data(true)) return item;
  if (!large_too) return std::nullopt;
  // In turn: neither keeps the other waiting for ever.
  answer_was_last_ = !answer_was_last_ && !answers_.empty();
  if (answer_was_last_) return next_answer();
  if (auto item = next_data(false)) return item;
  return answers_.empty() ? std::nullopt : next_answer();
}

bool Outbox::is_small(const Item& item) const {
  if (const auto* const data = std::get_if<Data>(&item)) {
    return is_small_size(data->message->bytes.size());
  }
  const auto* const answer = std::get_if<std::vector<std::uint8_t>>(&item);
  return answer == nullptr || is_small_size(answer->size());
}

std::size_t Outbox::waiting_bytes() const {
  std::size_t bytes = answer_bytes_;
  for (const auto& [subscription, queue] : queues_) bytes += queue.bytes;
  return bytes;
}

}  // namespace stillmap::gateway
