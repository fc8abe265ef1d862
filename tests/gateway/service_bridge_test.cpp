#include "clients/gateway/service_bridge.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <mutex>
#include <semaphore>

#include "idl/dds/service_server.hpp"
#include "idl/interface/services.hpp"
#include "stillmap_msgs.h"
#include "tests/gateway/posted_work.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::gateway {
namespace {

using namespace std::chrono_literals;
using stillmap_msgs::srv::SaveMap_Request;
using stillmap_msgs::srv::SaveMap_Response;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

dds::SerializedSample request_for(const std::string& file) {
  SaveMap_Request request;
  request.file(file);
  return dds::to_bytes(dds::type_support<SaveMap_Request>(), &request, 0);
}

class ServiceBridgeTest : public testing::Test {
 protected:
  ~ServiceBridgeTest() override { go_on_.release(500); }

  void begin(std::chrono::milliseconds timeout) {
    bridge_.emplace(client_side_, ServiceChoice{.with_control = true, .timeout = timeout},
                    work_.post());
    for (const ServiceInfo& service : bridge_->services()) {
      if (service.name == "/stillmap/save_map") service_ = service.id;
    }
    ASSERT_NE(service_, 0U);
  }

  void call(const std::shared_ptr<int>& client, const std::string& file) {
    bridge_->call(service_, client, request_for(file), [this](const ServiceBridge::Answer& answer) {
      ++answered_;
      if (const auto* const why = std::get_if<std::string>(&answer)) failures_.push_back(*why);
    });
  }

  [[nodiscard]] std::vector<std::string> carried_out() {
    const std::scoped_lock lock(mutex_);
    return carried_out_;
  }

  SaveMap_Response save(const SaveMap_Request& request) {
    {
      const std::scoped_lock lock(mutex_);
      carried_out_.push_back(request.file());
    }
    go_on_.acquire();
    return {};
  }

  std::mutex mutex_;
  std::vector<std::string> carried_out_;
  std::counting_semaphore<10000> go_on_{0};
  dds::Participant server_side_{dds::loopback(true)};
  dds::ServiceServer<SaveMap_Request, SaveMap_Response> server_{
      server_side_,
      dds::services::save_map.in("stillmap"),
      [this](const SaveMap_Request& request) { return save(request); },
      {.carries_out_once = true}};
  PostedWork work_;
  dds::Participant client_side_{dds::loopback(true)};
  std::optional<ServiceBridge> bridge_;
  std::uint32_t service_ = 0;
  int answered_ = 0;
  std::vector<std::string> failures_;
};

TEST_F(ServiceBridgeTest, ClientsTakeTurns) {
  begin(dds::discovery_timeout);
  const auto greedy = std::make_shared<int>();
  const auto modest = std::make_shared<int>();
  call(greedy, "greedy 0");
  ASSERT_TRUE(work_.eventually([&] { return carried_out().size() == 1; }));
  for (int i = 1; i < 100; ++i) call(greedy, "greedy " + std::to_string(i));
  EXPECT_EQ(failures_.size(), 83U);
  EXPECT_THAT(failures_.front(), HasSubstr("too many calls"));
  call(modest, "modest");
  go_on_.release(3);
  ASSERT_TRUE(work_.eventually([&] { return carried_out().size() == 4; }));
  EXPECT_THAT(carried_out(), ElementsAre("greedy 0", "greedy 1", "modest", "greedy 2"));
}

TEST_F(ServiceBridgeTest, WhatAClientThatIsGoneAskedForIsNotCarriedOut) {
  begin(dds::discovery_timeout);
  const auto here = std::make_shared<int>();
  auto gone = std::make_shared<int>();
  call(here, "first");
  ASSERT_TRUE(work_.eventually([&] { return carried_out().size() == 1; }));
  call(gone, "gone");
  call(here, "last");
  gone = nullptr;
  go_on_.release(2);
  ASSERT_TRUE(work_.eventually([&] { return answered_ == 2; }));
  EXPECT_THAT(carried_out(), ElementsAre("first", "last"));
  EXPECT_THAT(failures_, ElementsAre());
}

TEST_F(ServiceBridgeTest, ACallWhoseTimeIsUpBeforeItsTurnIsNotCarriedOut) {
  begin(std::chrono::seconds(3 * test::slowdown));
  const auto client = std::make_shared<int>();
  go_on_.release();
  // Discovery may take longer than a call may.
  int calls = 0;
  do {
    failures_.clear();
    call(client, "discovered");
    ++calls;
    ASSERT_TRUE(work_.eventually([&] { return answered_ == calls; }));
  } while (!failures_.empty() && calls < 20);
  ASSERT_THAT(failures_, ElementsAre());
  answered_ = 1;
  call(client, "first");
  ASSERT_TRUE(work_.eventually([&] { return carried_out().size() == 2; }));
  // They wait for the first, which is given up before them, and have hardly longer than it.
  constexpr int waiting = 12;
  for (int i = 0; i < waiting; ++i) call(client, "late");
  ASSERT_TRUE(work_.eventually([&] { return answered_ == 2 + waiting; }));
  ASSERT_THAT(failures_, testing::SizeIs(1 + waiting));
  const auto waited = std::ranges::count_if(
      failures_, [](const std::string& why) { return why.find("waited for other") != why.npos; });
  EXPECT_GT(waited, 0);
  go_on_.release(1000);
  call(client, "last");
  ASSERT_TRUE(work_.eventually([&] { return answered_ == 3 + waiting; }));
  EXPECT_EQ(carried_out().back(), "last");
  // Those that were sent, and come again, are carried out once.
  EXPECT_LE(std::ssize(carried_out()), 3 + waiting - waited);
}

}  // namespace
}  // namespace stillmap::gateway
