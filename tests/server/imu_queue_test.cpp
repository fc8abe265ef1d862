#include <gtest/gtest.h>

#include <thread>

#include "server/mapping/imu_receiver.hpp"
#include "tests/eventually.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;

ImuSample sample_at_ms(std::int64_t stamp_ms) { return {.stamp_ns = 1'000'000 * stamp_ms}; }

TEST(ImuQueue, WaitsForTheSampleThatEndsTheSweep) {
  ImuQueue queue;
  queue.push(sample_at_ms(90));
  std::jthread late([&] {
    std::this_thread::sleep_for(20ms);
    queue.push(sample_at_ms(95));
    queue.push(sample_at_ms(100));
  });
  EXPECT_EQ(queue.take(100 * 1'000'000LL, test::patience).size(), 3U);
  EXPECT_TRUE(queue.take(100 * 1'000'000LL, 0ms).empty());
}

TEST(ImuQueue, DoesNotWaitLongForAnImuThatStopped) {
  ImuQueue queue;
  queue.push(sample_at_ms(10));
  const auto began = std::chrono::steady_clock::now();
  // Waits of 20 s in all, if it went on waiting.
  for (int k = 0; k < 1000; ++k) (void)queue.take(1000 * 1'000'000LL, 20ms);
  EXPECT_LT(std::chrono::steady_clock::now() - began, 10s);
  // It comes back: worth waiting for again.
  queue.push(sample_at_ms(1000));
  EXPECT_EQ(queue.take(1000 * 1'000'000LL, 20ms).size(), 1U);
  std::jthread late([&] {
    std::this_thread::sleep_for(20ms);
    queue.push(sample_at_ms(1100));
  });
  EXPECT_EQ(queue.take(1100 * 1'000'000LL, test::patience).size(), 1U);
}

TEST(ImuQueue, KeepsTheNewestWhenNobodyTakes) {
  ImuQueue queue;
  for (int k = 0; k < 20'000; ++k) queue.push(sample_at_ms(k));
  const auto samples = queue.take(0, 0ms);
  EXPECT_LE(samples.size(), 8000U);
  ASSERT_FALSE(samples.empty());
  EXPECT_EQ(samples.back().stamp_ns, 19'999 * 1'000'000LL);
}

TEST(ImuQueue, WaitsForAnImuThatBeginsAfterTheLidar) {
  ImuQueue queue;
  // Nobody publishes yet: these do not wait.
  for (int k = 0; k < 100; ++k) EXPECT_TRUE(queue.take(k * 1'000'000LL, 0ms).empty());
  std::jthread late([&] {
    std::this_thread::sleep_for(20ms);
    queue.push(sample_at_ms(1100));
  });
  EXPECT_EQ(queue.take(1100 * 1'000'000LL, test::patience).size(), 1U);
}

TEST(ImuQueue, WaitsAgainAfterAnOutage) {
  ImuQueue queue;
  for (int k = 0; k < 10; ++k) (void)queue.take(1000 * 1'000'000LL, 1ms);
  // Samples are back, each a little after the scan that asks for it.
  EXPECT_TRUE(queue.take(2000 * 1'000'000LL, test::patience).empty());
  queue.push(sample_at_ms(2000));
  std::jthread late([&] {
    std::this_thread::sleep_for(20ms);
    queue.push(sample_at_ms(2100));
  });
  EXPECT_EQ(queue.take(2100 * 1'000'000LL, test::patience).size(), 2U);
}

TEST(ImuQueue, GivesUpASampleThatComesTooLate) {
  ImuQueue queue;
  for (int k = 0; k < 10; ++k) (void)queue.take(1000 * 1'000'000LL, 1ms);
  const auto began = std::chrono::steady_clock::now();
  for (std::int64_t k = 0; k < 20; ++k) {
    (void)queue.take((2000 + k) * 1'000'000LL, 1ms);
    std::this_thread::sleep_for(3ms);
    queue.push(sample_at_ms(2000 + k));
  }
  // A wait of 10 s would have begun.
  (void)queue.take(3000 * 1'000'000LL, 10s);
  EXPECT_LT(std::chrono::steady_clock::now() - began, 8s);
}

}  // namespace
}  // namespace stillmap::server
