#include "server/threads/worker.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>
#include <thread>
#include <vector>

#include "server/threads/periodic_worker.hpp"
#include "server/threads/thread_name.hpp"
#include "tests/server/manual_clock.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;

TEST(BoundedQueue, GivesItemsBackInOrder) {
  BoundedQueue<int> queue(3);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(queue.push_dropping_oldest(i), 0U);
  EXPECT_EQ(queue.waiting(), 3U);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(queue.try_pop(), i);
  EXPECT_FALSE(queue.try_pop());
}

TEST(BoundedQueue, DropsTheOldestAndSaysHowMany) {
  BoundedQueue<int> queue(2);
  EXPECT_EQ(queue.push_dropping_oldest(1), 0U);
  EXPECT_EQ(queue.push_dropping_oldest(2), 0U);
  EXPECT_EQ(queue.push_dropping_oldest(3), 1U);
  EXPECT_EQ(queue.try_pop(), 2);
  EXPECT_EQ(queue.try_pop(), 3);
}

TEST(BoundedQueue, LetsAProducerWaitForRoom) {
  BoundedQueue<int> queue(1);
  constexpr int items = 200;
  const std::jthread producer([&] {
    for (int i = 0; i < items; ++i) EXPECT_TRUE(queue.push_blocking(i, {}));
  });
  for (int i = 0; i < items; ++i) {
    ASSERT_TRUE(queue.wait_for_item({}, 60s));
    EXPECT_EQ(queue.try_pop(), i);
  }
}

TEST(BoundedQueue, StopsWaitingWhenAStopIsRequested) {
  BoundedQueue<int> full(1);
  full.push_dropping_oldest(1);
  BoundedQueue<int> empty(1);
  std::stop_source stop;
  auto pushed =
      std::async(std::launch::async, [&] { return full.push_blocking(2, stop.get_token()); });
  auto has_item =
      std::async(std::launch::async, [&] { return empty.wait_for_item(stop.get_token(), 1h); });
  stop.request_stop();
  EXPECT_FALSE(pushed.get());
  EXPECT_FALSE(has_item.get());
  EXPECT_EQ(full.waiting(), 1U);
}

TEST(Worker, TakesNothingMoreOnceItHasStopped) {
  BoundedQueue<int> queue(10);
  BoundedQueue<int> handled(10);
  Worker<int> worker("worker", queue, [&](int item) { handled.push_dropping_oldest(item); });
  queue.push_dropping_oldest(1);
  ASSERT_TRUE(handled.wait_for_item({}, 60s));
  worker.stop();
  queue.push_dropping_oldest(2);
  EXPECT_EQ(handled.waiting(), 1U);
  EXPECT_EQ(queue.waiting(), 1U);
}

TEST(Worker, FinishesItsQueueWhereThatIsAsked) {
  std::vector<int> handled;
  BoundedQueue<int> queue(10);
  for (int i = 1; i <= 3; ++i) queue.push_dropping_oldest(i);
  {
    const Worker<int> worker("worker", queue, [&](int item) { handled.push_back(item); },
                             {.finishes_queue = true});
  }
  EXPECT_THAT(handled, ElementsAre(1, 2, 3));
}

TEST(Worker, TakesWhatTheQueueHoldsAfterBeforeTake) {
  BoundedQueue<int> queue(1);
  std::promise<int> handled;
  queue.push_dropping_oldest(1);
  const Worker<int> worker("worker", queue, [&](int item) { handled.set_value(item); },
                           {.before_take = [&] { queue.push_dropping_oldest(2); }});
  auto item = handled.get_future();
  ASSERT_EQ(item.wait_for(60s), std::future_status::ready);
  EXPECT_EQ(item.get(), 2);
}

TEST(Worker, SaysWhenItIsIdle) {
  BoundedQueue<int> queue(1);
  BoundedQueue<bool> idle(1);
  const Worker<int> worker(
      "worker", queue, [](int) {},
      {.on_idle = [&] { idle.push_dropping_oldest(true); }, .idle_period = 1ms});
  EXPECT_TRUE(idle.wait_for_item({}, 60s));
}

TEST(Worker, NamesItsThread) {
  BoundedQueue<int> queue(1);
  BoundedQueue<std::string> names(2);
  const Worker<int> worker("a name that is too long", queue,
                           [&](int) { names.push_dropping_oldest(name_of_this_thread()); });
  queue.push_dropping_oldest(1);
  ASSERT_TRUE(names.wait_for_item({}, 60s));
  EXPECT_EQ(names.try_pop(), "a name that is ");
  const PeriodicWorker periodic("periodic", 3600s, [&](const std::stop_token&) {
    names.push_dropping_oldest(name_of_this_thread());
  });
  ASSERT_TRUE(names.wait_for_item({}, 60s));
  EXPECT_EQ(names.try_pop(), "periodic");
}

TEST(PeriodicWorker, PausesAfterEachCall) {
  test::ManualClock clock;
  int calls = 0;
  const PeriodicWorker worker(
      "periodic", 10s,
      [&](const std::stop_token&) {
        clock.advance(3s);
        ++calls;
      },
      clock);
  for (int call = 1; call <= 3; ++call) {
    const auto pause = clock.wait_for_sleeper();
    ASSERT_TRUE(pause);
    EXPECT_EQ(calls, call);
    EXPECT_NEAR(pause->count(), 10.0, 1e-6);
    clock.advance(*pause);
  }
}

TEST(PeriodicWorker, EndsWhileItPauses) {
  std::promise<void> called;
  const PeriodicWorker worker("periodic", 3600s,
                              [&](const std::stop_token&) { called.set_value(); });
  EXPECT_EQ(called.get_future().wait_for(60s), std::future_status::ready);
}

}  // namespace
}  // namespace stillmap::server
