#include "clients/gateway/outbox.hpp"

#include <gmock/gmock.h>

#include <random>

namespace stillmap::gateway {
namespace {

constexpr OutboxLimits limits{
    .small_bytes = 100, .max_waiting_bytes = 1000, .max_answer_bytes = 1000};

MessagePtr message(std::size_t bytes, std::int64_t number = 0, const std::string& key = "") {
  return std::make_shared<Message>(
      Message{.received_ns = number, .key = key, .bytes = dds::SerializedSample(bytes)});
}

/// The message's number; -1 for none, -2 for a text, -3 for an answer.
std::int64_t next(Outbox& outbox, bool large_too = true) {
  const auto item = outbox.next(large_too);
  if (!item) return -1;
  if (std::holds_alternative<std::string>(*item)) return -2;
  const auto* const data = std::get_if<Outbox::Data>(&*item);
  return data == nullptr ? -3 : data->message->received_ns;
}

TEST(Outbox, KeepsTheNewestAndCountsTheRest) {
  Outbox outbox(limits);
  outbox.open(1, 1);
  for (int i = 0; i < 5; ++i) outbox.push(1, message(10, i));
  EXPECT_EQ(next(outbox), 4);
  EXPECT_EQ(next(outbox), -1);
  EXPECT_EQ(outbox.counters().at(1).sent, 1U);
  EXPECT_EQ(outbox.counters().at(1).dropped, 4U);
  EXPECT_EQ(outbox.waiting_bytes(), 0U);
}

TEST(Outbox, KeepsTheNewestOfEachKeyInTheOrderOfTheirFirst) {
  Outbox outbox(limits);
  outbox.open(1, 10);
  outbox.push(1, message(10, 1, "a"));
  outbox.push(1, message(10, 2, "b"));
  outbox.push(1, message(10, 3, "a"));
  EXPECT_EQ(next(outbox), 3);
  EXPECT_EQ(next(outbox), 2);
  EXPECT_EQ(outbox.counters().at(1).dropped, 1U);
}

TEST(Outbox, DropsTheOldestKeysWhereThereAreTooManyOrTooLarge) {
  Outbox outbox(limits);
  outbox.open(1, 3);
  for (int i = 0; i < 5; ++i) outbox.push(1, message(10, i, std::to_string(i)));
  EXPECT_EQ(next(outbox), 2);
  Outbox of_large(limits);
  of_large.open(1, 100);
  for (int i = 0; i < 5; ++i) of_large.push(1, message(400, i, std::to_string(i)));
  EXPECT_LE(of_large.waiting_bytes(), limits.max_waiting_bytes);
  EXPECT_EQ(next(of_large), 3);
}

TEST(Outbox, SmallOvertakesLarge) {
  Outbox outbox(limits);
  outbox.open(1, 1);
  outbox.open(2, 1);
  outbox.push(1, message(500, 1));
  outbox.push(2, message(50, 2));
  EXPECT_EQ(next(outbox), 2);
  EXPECT_EQ(next(outbox, false), -1);
  EXPECT_EQ(next(outbox), 1);
}

TEST(Outbox, ServesSubscriptionsInTurn) {
  Outbox outbox(limits);
  for (const std::uint32_t id : {1U, 2U, 3U}) outbox.open(id, 10);
  for (int round = 0; round < 2; ++round) {
    for (const std::uint32_t id : {1U, 2U, 3U}) {
      outbox.push(id, message(10, id, std::to_string(round)));
    }
  }
  std::vector<std::int64_t> order;
  for (int i = 0; i < 6; ++i) order.push_back(next(outbox));
  EXPECT_THAT(order, ::testing::ElementsAre(1, 2, 3, 1, 2, 3));
}

TEST(Outbox, LargeAnswersAndLargeMessagesTakeTurns) {
  Outbox outbox(limits);
  outbox.open(1, 10);
  for (int i = 0; i < 2; ++i) {
    outbox.push(1, message(200, i, std::to_string(i)));
    ASSERT_TRUE(outbox.push_answer(std::vector<std::uint8_t>(200)));
  }
  std::vector<std::int64_t> order;
  for (int i = 0; i < 4; ++i) order.push_back(next(outbox));
  EXPECT_THAT(order, ::testing::ElementsAre(-3, 0, -3, 1));
}

TEST(Outbox, GivesUpWhoDoesNotTakeAnswers) {
  Outbox outbox(limits);
  EXPECT_TRUE(outbox.push_text(std::string(600, 'a')));
  EXPECT_FALSE(outbox.push_answer(std::vector<std::uint8_t>(600)));
  EXPECT_EQ(next(outbox), -2);
  EXPECT_TRUE(outbox.push_answer(std::vector<std::uint8_t>(600)));
}

TEST(Outbox, MemoryIsBoundedWhateverComes) {
  std::mt19937 random(3);
  Outbox outbox(limits);
  for (const std::uint32_t id : {1U, 2U, 3U}) outbox.open(id, 5);
  std::uint64_t pushed = 0;
  std::uint64_t taken = 0;
  for (int i = 0; i < 20000; ++i) {
    outbox.push(static_cast<std::uint32_t>(1 + random() % 3),
                message(random() % 600, i, std::to_string(random() % 9)));
    ++pushed;
    if (random() % 4 == 0 && next(outbox, random() % 2 == 0) >= 0) ++taken;
    ASSERT_LE(outbox.waiting_bytes(), 3 * limits.max_waiting_bytes);
  }
  while (next(outbox) >= 0) ++taken;
  std::uint64_t dropped = 0;
  for (const auto& [id, counters] : outbox.counters()) dropped += counters.dropped;
  EXPECT_EQ(taken + dropped, pushed);
  EXPECT_EQ(outbox.waiting_bytes(), 0U);
}

}  // namespace
}  // namespace stillmap::gateway
