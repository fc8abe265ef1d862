#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "idl/dds/service_client.hpp"
#include "idl/dds/service_server.hpp"
#include "idl/dds/writer.hpp"
#include "stillmap_msgs.h"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using stillmap_msgs::srv::SaveMap_Request;
using stillmap_msgs::srv::SaveMap_Response;
using Server = ServiceServer<SaveMap_Request, SaveMap_Response>;
using Client = ServiceClient<SaveMap_Request, SaveMap_Response>;

SaveMap_Response echo(const SaveMap_Request& request) {
  SaveMap_Response reply;
  reply.file("saved " + request.file());
  return reply;
}

SaveMap_Request request_for(const std::string& file) {
  SaveMap_Request request;
  request.file(file);
  return request;
}

TEST(Service, AnswersEachClientWithItsOwnReply) {
  Participant server_side(loopback(true));
  const Server server(server_side, "stillmap/save_map", echo);
  std::atomic<int> right = 0;
  {
    std::vector<std::jthread> clients;
    for (int c = 0; c < 3; ++c) {
      clients.emplace_back([&right, c] {
        Participant client_side(loopback(true));
        Client client(client_side, "stillmap/save_map");
        for (int i = 0; i < 20; ++i) {
          const std::string file = std::to_string(c) + "_" + std::to_string(i);
          const auto reply = client.call(request_for(file), discovery_timeout);
          if (reply && reply->file() == "saved " + file) ++right;
        }
      });
    }
  }
  EXPECT_EQ(right, 60);
}

TEST(Service, CountsRequestsThatItHadNoRoomFor) {
  Participant server_side(loopback(false));
  std::promise<void> all_arrived;
  std::atomic<bool> is_answering = false;
  const Server server(
      server_side, "stillmap/save_map",
      [&is_answering, arrived = all_arrived.get_future().share()](const SaveMap_Request& request) {
        is_answering = true;
        arrived.wait();
        return echo(request);
      });
  // Also where the test ends early: the server waits for its handler.
  std::shared_ptr<void> arrival(nullptr, [&](void*) { all_arrived.set_value(); });
  Participant client_side(loopback(false));
  Writer<SaveMap_Request> requests(client_side, "rq/stillmap/save_mapRequest", {.depth = 500});
  ASSERT_TRUE(requests.readers().wait_for_any(discovery_timeout));
  ASSERT_TRUE(requests.write(request_for("")));
  ASSERT_TRUE(test::eventually([&] { return is_answering.load(); }, discovery_timeout, 5ms));
  for (int i = 0; i < 300; ++i) ASSERT_TRUE(requests.write(request_for("")));
  ASSERT_TRUE(requests.wait_for_acknowledgements(discovery_timeout));
  arrival.reset();
  const auto lost = [&] {
    return server_side.service_faults().count("lost_request", "stillmap/save_map");
  };
  EXPECT_TRUE(test::eventually([&] { return lost() == 200; }, discovery_timeout, 5ms)) << lost();
}

TEST(Service, CarriesAReplyOfMegabytes) {
  Participant server_side(loopback(false));
  const Server server(server_side, "stillmap/save_map", [](const SaveMap_Request&) {
    SaveMap_Response reply;
    reply.file(std::string(5'000'000, 'x'));
    return reply;
  });
  Participant client_side(loopback(false));
  Client client(client_side, "stillmap/save_map");
  const auto reply = client.call(request_for(""), discovery_timeout);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->file().size(), 5'000'000U);
}

TEST(Service, ReadsAnAnswerIntoTheMemoryOfOneThatIsHandedBack) {
  using stillmap_msgs::srv::GetStaticMap_Request;
  using stillmap_msgs::srv::GetStaticMap_Response;
  Participant server_side(loopback(false));
  const ServiceServer<GetStaticMap_Request, GetStaticMap_Response> server(
      server_side, "stillmap/get_static_map", [](const GetStaticMap_Request& request) {
        GetStaticMap_Response reply;
        reply.voxels().x().resize(request.max_bytes(), request.resolution_m() > 1.0 ? 2.0F : 1.0F);
        return reply;
      });
  Participant client_side(loopback(false));
  ServiceClient<GetStaticMap_Request, GetStaticMap_Response> client(client_side,
                                                                    "stillmap/get_static_map");
  const auto answer = [&](std::uint32_t voxels, double resolution_m) {
    GetStaticMap_Request request;
    request.max_bytes(voxels);
    request.resolution_m(resolution_m);
    return client.call(request, discovery_timeout);
  };
  auto first = answer(100'000, 0.5);
  ASSERT_TRUE(first);
  const float* const memory = first->voxels().x().data();
  client.reuse(*std::move(first));
  const auto second = answer(50'000, 2.0);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->voxels().x().data(), memory);
  EXPECT_EQ(second->voxels().x(), std::vector<float>(50'000, 2.0F));
  const auto third = answer(60'000, 0.5);
  ASSERT_TRUE(third);
  EXPECT_NE(third->voxels().x().data(), memory) << "is the second one's";
}

TEST(Service, WaitsForAServerThatComesLater) {
  Participant client_side(loopback(false));
  Client client(client_side, "stillmap/save_map");
  std::optional<SaveMap_Response> reply;
  std::jthread asker([&] { reply = client.call(request_for("late"), discovery_timeout); });
  std::this_thread::sleep_for(300ms);
  Participant server_side(loopback(false));
  const Server server(server_side, "stillmap/save_map", echo);
  asker.join();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->file(), "saved late");
}

TEST(Service, GivesUpWithoutAServer) {
  Participant client_side(loopback(false));
  Client client(client_side, "stillmap/save_map");
  const auto began = std::chrono::steady_clock::now();
  EXPECT_FALSE(client.call(request_for(""), 300ms));
  EXPECT_LT(std::chrono::steady_clock::now() - began, 5s);
  EXPECT_FALSE(client.wait_for_server(0ms));
}

TEST(Service, CallsThatWaitForEachOtherKeepTheirTimes) {
  Participant client_side(loopback(false));
  Client client(client_side, "stillmap/save_map");
  const auto began = std::chrono::steady_clock::now();
  {
    std::vector<std::jthread> callers;
    for (int i = 0; i < 20; ++i)
      callers.emplace_back([&client] { EXPECT_FALSE(client.call(request_for(""), 500ms)); });
  }
  EXPECT_LT(std::chrono::steady_clock::now() - began, 8s) << "not 20 times as long";
}

TEST(Service, NoAnswerIsWaitedForAfterAStop) {
  Participant server_side(loopback(false));
  std::promise<void> end;
  const Server server(server_side, "stillmap/save_map",
                      [ended = end.get_future().share()](const SaveMap_Request& request) {
                        ended.wait();
                        return echo(request);
                      });
  Participant client_side(loopback(false));
  Client client(client_side, "stillmap/save_map");
  ASSERT_TRUE(client.wait_for_server(discovery_timeout));
  std::stop_source stop;
  auto answered = std::async(std::launch::async, [&] {
    return client.who_answers(request_for(""), 60s, stop.get_token());
  });
  EXPECT_EQ(answered.wait_for(100ms), std::future_status::timeout);
  stop.request_stop();
  EXPECT_EQ(answered.wait_for(10s), std::future_status::ready);
  end.set_value();
}

TEST(Service, WhoseThreadFailsLeavesItToWhoRunsIt) {
  Participant server_side(loopback(false));
  std::promise<std::string> failure;
  const Server server(server_side, "stillmap/save_map", echo,
                      {.idle = [] { throw std::runtime_error("out of memory"); },
                       .run =
                           [&](const std::function<void()>& work) {
                             try {
                               work();
                             } catch (const std::runtime_error& error) {
                               failure.set_value(error.what());
                             }
                           }});
  std::future<std::string> said = failure.get_future();
  ASSERT_EQ(said.wait_for(discovery_timeout), std::future_status::ready);
  EXPECT_EQ(said.get(), "out of memory");
}

/// A server that counts what it carries out, and answers a request for "late" only when it was
/// asked again.
class LateServer {
 public:
  explicit LateServer(bool carries_out_once)
      : server_(side_, "stillmap/save_map",
                [this](const SaveMap_Request& request) {
                  if (request.file() == "late" && carried_out_++ == 0) {
                    was_asked_again_ = hear() && hear();
                  }
                  return echo(request);
                },
                {.carries_out_once = carries_out_once}) {}

  /// How often it was carried out in the end, when one call waits longer than half its time.
  int after_one_call() {
    Participant client_side(loopback(false));
    Client client(client_side, "stillmap/save_map");
    EXPECT_TRUE(test::eventually([&] { return is_heard(client); }, discovery_timeout));
    const auto reply = client.call(request_for("late"), 2s * test::slowdown);
    EXPECT_TRUE(reply && reply->file() == "saved late");
    // The repeated request is still on its way through the server.
    EXPECT_TRUE(client.call(request_for("another"), discovery_timeout));
    EXPECT_TRUE(was_asked_again_);
    return carried_out_;
  }

 private:
  /// Takes a request off the topic, beside the server.
  bool hear(std::chrono::milliseconds timeout = discovery_timeout) {
    SerializedSample request;
    eprosima::fastdds::dds::SampleInfo info;
    return requests_.take(request, info, {}, timeout);
  }
  /// Whether a request of this client's, and so all later ones, can be heard.
  bool is_heard(Client& client) {
    const bool is_answered = client.call(request_for("early"), discovery_timeout).has_value();
    bool is_heard = false;
    while (hear(100ms)) is_heard = true;
    return is_answered && is_heard;
  }

  Participant side_{loopback(false)};
  SerializedSampleReader requests_{side_, request_topic("stillmap/save_map"),
                                   type_support<SaveMap_Request>().get_type_name(), service_qos()};
  std::atomic<int> carried_out_ = 0;
  std::atomic<bool> was_asked_again_ = false;
  Server server_;
};

TEST(Service, CarriesOutOnceWhatIsAskedAgain) { EXPECT_EQ(LateServer(true).after_one_call(), 1); }

TEST(Service, MayAnswerAnewWhereNothingChanges) {
  EXPECT_EQ(LateServer(false).after_one_call(), 2);
}

TEST(Service, SaysWhyAnAnswerFailed) {
  Participant server_side(loopback(false));
  const Server server(server_side, "stillmap/save_map",
                      [](const SaveMap_Request&) -> SaveMap_Response {
                        throw std::runtime_error("out of memory");
                      });
  Participant client_side(loopback(false));
  Client client(client_side, "stillmap/save_map");
  for (int i = 0; i < 2; ++i) {
    const auto reply = client.call(request_for(""), discovery_timeout);
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status().code(), 3);
    EXPECT_EQ(reply->status().reason(), "out of memory");
  }
}

RequestId call_number(std::int64_t number) { return {.client = {}, .number = number}; }

TEST(AnsweredRequests, AreFoundByTheirCall) {
  AnsweredRequests answers;
  const AnsweredRequests::Clock::time_point now;
  answers.add(call_number(7), {1, 2}, now);
  ASSERT_NE(answers.find(call_number(7), now), nullptr);
  EXPECT_EQ(*answers.find(call_number(7), now), SerializedSample({1, 2}));
  EXPECT_EQ(answers.find(call_number(8), now), nullptr);
  EXPECT_EQ(answers.find(call_number(7), now + AnsweredRequests::max_age + 1s), nullptr);
}

TEST(AnsweredRequests, AreBoundedInCountBytesAndAge) {
  AnsweredRequests many;
  AnsweredRequests large;
  const AnsweredRequests::Clock::time_point now;
  for (std::int64_t i = 1; i <= 3000; ++i) {
    many.add(call_number(i), {0}, now);
    large.add(call_number(i), SerializedSample(AnsweredRequests::max_bytes / 8), now);
  }
  EXPECT_EQ(many.count(), AnsweredRequests::max_count);
  EXPECT_NE(many.find(call_number(3000), now), nullptr);
  EXPECT_EQ(large.count(), 8U);
  large.add(call_number(4000), {0}, now + AnsweredRequests::max_age + 1s);
  EXPECT_EQ(large.count(), 1U);
}

}  // namespace
}  // namespace stillmap::dds
