#include "server/threads/request_queue.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>

namespace stillmap::server {
namespace {

TEST(RequestQueue, RunsInTheOneThreadAndTellsWhatWasThrown) {
  RequestQueue requests;
  std::atomic<bool> has_ended = false;
  std::thread::id ran_in;
  std::jthread asks([&] {
    requests.run([&] { ran_in = std::this_thread::get_id(); });
    EXPECT_THROW(requests.run([] { throw std::runtime_error("no"); }), std::runtime_error);
    has_ended = true;
  });
  while (!has_ended) requests.run_waiting();
  EXPECT_EQ(ran_in, std::this_thread::get_id());
}

TEST(RequestQueue, RunsThoseThatWaitAndAllLaterOnesOnceItIsClosed) {
  RequestQueue requests;
  std::string order;
  std::atomic<bool> asks_now = false;
  std::jthread asks([&] {
    asks_now = true;
    requests.run([&] { order += 'b'; });
  });
  while (!asks_now) std::this_thread::yield();
  requests.close([&] { order += 'a'; });
  asks.join();
  requests.close([&] { order += 'x'; });
  requests.run([&] { order += 'c'; });
  EXPECT_EQ(order, "abc");
}

TEST(RequestQueue, NobodyIsLeftWaitingWhereClosingFails) {
  RequestQueue requests;
  std::atomic<bool> asks_now = false;
  std::atomic<bool> has_run = false;
  std::jthread asks([&] {
    asks_now = true;
    requests.run([&] { has_run = true; });
  });
  while (!asks_now) std::this_thread::yield();
  EXPECT_THROW(requests.close([] { throw std::runtime_error("full"); }), std::runtime_error);
  asks.join();
  EXPECT_TRUE(has_run);
}

}  // namespace
}  // namespace stillmap::server
