#include "server/threads/thread_failure.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <stdexcept>

#include "server/mapping/mapping_thread.hpp"
#include "server/threads/periodic_worker.hpp"
#include "server/threads/worker.hpp"
#include "tests/server/room_scans.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;

class ThreadFailure : public testing::Test {
 protected:
  ThreadFailure() {
    sigemptyset(&signals_);
    block_thread_failures(signals_);
  }

  /// Whether some thread of the process failed; waits for it.
  [[nodiscard]] bool is_reported() const {
    const timespec minute{.tv_sec = 60, .tv_nsec = 0};
    return sigtimedwait(&signals_, nullptr, &minute) == thread_failure_signal;
  }

 private:
  sigset_t signals_{};
};

TEST_F(ThreadFailure, OfAWorkerIsReportedAndEndsIt) {
  BoundedQueue<int> queue(3);
  std::promise<void> failed;
  const Worker<int> worker("worker", queue, [](int) { throw std::runtime_error("worn out"); },
                           {.on_failure = [&] { failed.set_value(); }});
  queue.push_dropping_oldest(1);
  EXPECT_TRUE(is_reported());
  EXPECT_EQ(failed.get_future().wait_for(60s), std::future_status::ready);
  queue.push_dropping_oldest(2);
  EXPECT_EQ(queue.waiting(), 1U);
}

TEST_F(ThreadFailure, OfAPeriodicWorkerIsReportedWhateverItThrows) {
  const PeriodicWorker worker("periodic", 1ms, [](const std::stop_token&) { throw 42; });
  EXPECT_TRUE(is_reported());
}

TEST_F(ThreadFailure, ThatHappensWhileItIsHandledIsNoMore) {
  run_or_report([] { throw std::runtime_error("first"); },
                [] { throw std::runtime_error("second"); });
  EXPECT_TRUE(is_reported());
}

/// Labels nothing, and throws at its last scan what nobody expects.
class FailingSegmenter final : public Segmenter {
 public:
  explicit FailingSegmenter(int good_scans) : good_scans_(good_scans) {}
  [[nodiscard]] std::string name() const override { return "failing"; }
  [[nodiscard]] PointLabels segment(const Scan& scan) override {
    if (good_scans_-- == 0) throw 42;
    return PassthroughSegmenter().segment(scan);
  }

 private:
  int good_scans_;
};

TEST_F(ThreadFailure, OfTheMapperLeavesAMapThatCanBeSaved) {
  constexpr int good_scans = 5;
  ServerConfig config;
  config.mapper.sensor = vlp_16();
  config.input.delivery = DeliveryMode::every;
  ScanQueue queue(10);
  Statistics statistics;
  LatestMap latest_map;
  MappingThread mapping(config, std::make_unique<FailingSegmenter>(good_scans), std::nullopt,
                        nullptr, queue, statistics, latest_map, {});
  for (int k = 0; k <= good_scans; ++k) {
    queue.push_dropping_oldest({test::room_scan(k), "lidar", std::chrono::steady_clock::now()});
  }
  EXPECT_TRUE(is_reported());
  // What the services still ask is answered, and nothing waits for the thread that has gone.
  auto removed = std::async(std::launch::async, [&] {
    return mapping.removed(Eigen::AlignedBox3d(Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 1, 1)));
  });
  ASSERT_EQ(removed.wait_for(60s), std::future_status::ready);
  mapping.stop();
  const RunCheckpoint saved = mapping.checkpoint(CheckpointScope::everything);
  EXPECT_EQ(saved.map.trajectory.size(), static_cast<std::size_t>(good_scans));
  EXPECT_FALSE(saved.map.view.tiles.empty());
}

}  // namespace
}  // namespace stillmap::server
