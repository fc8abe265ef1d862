#include "clients/gateway/topic_bridge.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <iterator>

#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "tests/domain_lease.hpp"
#include "tests/gateway/posted_work.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::gateway {
namespace {

int thread_count() {
  const std::filesystem::directory_iterator threads("/proc/self/task");
  return static_cast<int>(std::distance(begin(threads), end(threads)));
}

class Listener : public TopicListener {
 public:
  void message_arrived(std::uint32_t /*subscription*/, const MessagePtr& /*message*/) override {
    ++arrived;
  }
  void topic_failed(std::uint32_t /*subscription*/, const std::string& why) override {
    failure = why;
  }
  int arrived = 0;
  std::string failure;
};

class TopicBridgeTest : public testing::Test {
 protected:
  /// Of the server's path, a latched topic.
  [[nodiscard]] std::uint32_t channel() const {
    return std::ranges::find(bridge_.channels(), "/stillmap/path", &ChannelInfo::topic)->id;
  }

  dds::Topics names_ = dds::Topics::in("stillmap");
  dds::Participant server_side_{dds::loopback(true)};
  dds::Writer<nav_msgs::msg::Path> path_{server_side_, names_.path.dds_name, names_.path.writer};
  PostedWork work_;
  dds::Participant participant_{dds::loopback(true)};
  TopicBridge bridge_{participant_, {}, work_.post()};
};

TEST_F(TopicBridgeTest, ComingAndGoingInALoopCostsNoThreads) {
  Listener listener;
  bridge_.listen(channel(), listener, 1);
  const int threads = thread_count();
  for (int i = 0; i < 300; ++i) {
    bridge_.stop_listening(channel(), listener, 1);
    bridge_.listen(channel(), listener, 1);
    EXPECT_LE(thread_count(), threads + 1) << i;
  }
  // Who came last is served.
  ASSERT_TRUE(path_.write(nav_msgs::msg::Path()));
  EXPECT_TRUE(work_.eventually([&] { return listener.arrived > 0; }));
  EXPECT_EQ(listener.failure, "");
}

TEST_F(TopicBridgeTest, WhoListensAgainGetsTheLastSampleOfALatchedTopicOnce) {
  ASSERT_TRUE(path_.write(nav_msgs::msg::Path()));
  Listener first;
  bridge_.listen(channel(), first, 1);
  ASSERT_TRUE(work_.eventually([&] { return first.arrived == 1; }));
  bridge_.stop_listening(channel(), first, 1);
  Listener second;
  bridge_.listen(channel(), second, 2);
  EXPECT_TRUE(work_.eventually([&] { return second.arrived == 1; }));
  Listener third;
  bridge_.listen(channel(), third, 3);
  EXPECT_EQ(third.arrived, 1);
  ASSERT_TRUE(path_.write(nav_msgs::msg::Path()));
  ASSERT_TRUE(work_.eventually([&] { return third.arrived == 2; }));
  EXPECT_EQ(second.arrived, 2);
  EXPECT_EQ(first.arrived, 1);
}

TEST_F(TopicBridgeTest, WhatCameForWhoHasLeftGoesToNobodyTwice) {
  ASSERT_TRUE(path_.write(nav_msgs::msg::Path()));
  Listener first;
  bridge_.listen(channel(), first, 1);
  // Its sample comes, but is not handed on before it leaves.
  ASSERT_TRUE(test::eventually([&] { return work_.has_some(); }));
  bridge_.stop_listening(channel(), first, 1);
  Listener second;
  bridge_.listen(channel(), second, 2);
  ASSERT_TRUE(work_.eventually([&] { return second.arrived > 0; }));
  ASSERT_TRUE(path_.write(nav_msgs::msg::Path()));
  ASSERT_TRUE(work_.eventually([&] { return second.arrived >= 2; }));
  EXPECT_EQ(second.arrived, 2);
  EXPECT_EQ(first.arrived, 0);
}

TEST_F(TopicBridgeTest, ATopicThatCouldNotBeReadIsTriedAgainForWhoListensNext) {
  // Another type under the topic's name: this participant cannot read it.
  const dds::Writer<nav_msgs::msg::Odometry> wrong(participant_,
                                                   dds::Topics::in("stillmap").path.dds_name, {});
  Listener first;
  bridge_.listen(channel(), first, 1);
  ASSERT_TRUE(work_.eventually([&] { return !first.failure.empty(); }));
  Listener second;
  bridge_.listen(channel(), second, 2);
  EXPECT_TRUE(work_.eventually([&] { return !second.failure.empty(); }));
}

}  // namespace
}  // namespace stillmap::gateway
