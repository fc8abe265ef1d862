#include <gmock/gmock.h>

#include <atomic>
#include <set>
#include <thread>

#include "idl/dds/service_client.hpp"
#include "idl/dds/service_server.hpp"
#include "stillmap_msgs.h"
#include "tests/idl/dds_fixture.hpp"
#include "tests/idl/vendor_participant.hpp"

// Services, asked by processes of other vendors.

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using stillmap_msgs::srv::SaveMap_Request;
using stillmap_msgs::srv::SaveMap_Response;
using ::testing::HasSubstr;

constexpr auto service = "stillmap/save_map";
constexpr auto type_stem = "stillmap_msgs::srv::dds_::SaveMap";

SaveMap_Response saved(const SaveMap_Request& request) {
  SaveMap_Response reply;
  reply.file("saved " + request.file());
  return reply;
}

SerializedSample request_for(const std::string& file, std::size_t gap_bytes) {
  SaveMap_Request request;
  request.file(file);
  return to_bytes(type_support<SaveMap_Request>(), &request, gap_bytes);
}

CorrelationHeader header_of(std::uint8_t client, std::uint8_t number) {
  return {client, 2, 3, 4, 5, 6, 7, 8, number, 0, 0, 0, 0, 0, 0, 0};
}

SerializedSample cyclone_request(const CorrelationHeader& header, const std::string& file) {
  SerializedSample bytes = request_for(file, header.size());
  put_correlation_header(header, bytes);
  return bytes;
}

std::optional<SaveMap_Response> read_reply(SerializedSample bytes) {
  SaveMap_Response reply;
  if (!from_bytes(type_support<SaveMap_Response>(), bytes, &reply)) return std::nullopt;
  return reply;
}

class ForeignService : public testing::Test {
 protected:
  [[nodiscard]] std::uint64_t faults(const std::string& kind) const {
    return server_side_.service_faults().count(kind, service);
  }

  Participant server_side_{loopback(false)};
  ServiceServer<SaveMap_Request, SaveMap_Response> server_{server_side_, service, saved};
};

/// The reply to the request with this header, among replies to all.
std::optional<SaveMap_Response> reply_to(ByteClient& client, const CorrelationHeader& header) {
  const auto deadline = std::chrono::steady_clock::now() + discovery_timeout;
  while (std::chrono::steady_clock::now() < deadline) {
    auto reply = client.receive(discovery_timeout);
    if (!reply) return std::nullopt;
    if (take_correlation_header(reply->bytes) == header) return read_reply(reply->bytes);
  }
  return std::nullopt;
}

TEST_F(ForeignService, AnswersCycloneWithTheHeaderOfItsRequest) {
  VendorParticipant peer(eclipse_cyclone);
  ByteClient client(peer, service, type_stem);
  ASSERT_TRUE(client.wait_for_server());
  const auto header = header_of(1, 77);
  client.call(cyclone_request(header, "x"));
  const auto reply = reply_to(client, header);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->file(), "saved x");
}

TEST_F(ForeignService, AnswersCycloneOnABigEndianMachine) {
  VendorParticipant peer(eclipse_cyclone);
  ByteClient client(peer, service, type_stem);
  ASSERT_TRUE(client.wait_for_server());
  // Client 0x0102030405060708, request 9, format version 0, string of 2 bytes "x".
  client.call({0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 0,   0, 0, 0,
               0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 2, 'x', 0, 0, 0});
  const auto reply = reply_to(client, {8, 7, 6, 5, 4, 3, 2, 1, 9, 0, 0, 0, 0, 0, 0, 0});
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->file(), "saved x");
}

TEST_F(ForeignService, AnswersOtherVendorsByTheIdentityOfTheirRequest) {
  VendorParticipant peer(rti_connext);
  ByteClient client(peer, service, type_stem);
  ASSERT_TRUE(client.wait_for_server());
  const auto identity = client.call(request_for("y", 0));
  auto reply = client.receive(discovery_timeout);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->answered, identity);
  const auto read = read_reply(reply->bytes);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->file(), "saved y");
}

TEST_F(ForeignService, AnswersEveryClientOfOneProcess) {
  VendorParticipant peer(eclipse_cyclone);
  ByteClient first(peer, service, type_stem);
  ByteClient second(peer, service, type_stem);
  ASSERT_TRUE(first.wait_for_server() && second.wait_for_server());
  first.call(cyclone_request(header_of(1, 1), "first"));
  second.call(cyclone_request(header_of(2, 1), "second"));
  const auto to_first = reply_to(first, header_of(1, 1));
  const auto to_second = reply_to(second, header_of(2, 1));
  ASSERT_TRUE(to_first && to_second);
  EXPECT_EQ(to_first->file(), "saved first");
  EXPECT_EQ(to_second->file(), "saved second");
}

TEST_F(ForeignService, AnswersManyClientsOfBothKindsAtOnce) {
  constexpr int requests = 20;
  std::atomic<int> fast_right = 0;
  std::atomic<int> cyclone_right = 0;
  {
    std::vector<std::jthread> clients;
    for (int c = 0; c < 3; ++c) {
      clients.emplace_back([&fast_right, c] {
        Participant side(loopback(false));
        ServiceClient<SaveMap_Request, SaveMap_Response> client(side, service);
        for (int i = 0; i < requests; ++i) {
          SaveMap_Request request;
          request.file(std::to_string(100 * c + i));
          const auto reply = client.call(request, discovery_timeout);
          if (reply && reply->file() == "saved " + request.file()) ++fast_right;
        }
      });
      clients.emplace_back([&cyclone_right, c] {
        VendorParticipant peer(eclipse_cyclone);
        ByteClient client(peer, service, type_stem);
        if (!client.wait_for_server()) return;
        for (int i = 0; i < requests; ++i) {
          const auto header = header_of(static_cast<std::uint8_t>(c), static_cast<std::uint8_t>(i));
          const std::string file = std::to_string(1000 * c + i);
          client.call(cyclone_request(header, file));
          const auto reply = reply_to(client, header);
          if (reply && reply->file() == "saved " + file) ++cyclone_right;
        }
      });
    }
  }
  EXPECT_EQ(fast_right, 3 * requests);
  EXPECT_EQ(cyclone_right, 3 * requests);
  EXPECT_EQ(faults("undelivered_reply"), 0U);
}

struct HostileBytes {
  std::string name;
  SerializedSample bytes;
};

std::vector<HostileBytes> hostile_requests(std::size_t header_bytes) {
  const SerializedSample good = request_for("file", header_bytes);
  std::vector<HostileBytes> all;
  for (std::size_t length = encapsulation_bytes; length < good.size(); length += 5) {
    all.push_back(
        {"cut at " + std::to_string(length),
         SerializedSample(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length))});
  }
  // PL_CDR and XCDR2's, and what is none at all.
  for (const int kind : {2, 3, 6, 7, 10, 200}) {
    all.push_back({"encapsulation " + std::to_string(kind), good});
    all.back().bytes[1] = static_cast<std::uint8_t>(kind);
  }
  all.push_back({"endless string", good});
  std::fill_n(all.back().bytes.begin() + static_cast<std::ptrdiff_t>(8 + header_bytes), 4, 0xFF);
  return all;
}

TEST_F(ForeignService, OutlivesHostileRequestsAndCountsThem) {
  VendorParticipant cyclone(eclipse_cyclone);
  ByteClient cyclone_client(cyclone, service, type_stem);
  VendorParticipant other(rti_connext);
  ByteClient other_client(other, service, type_stem);
  ASSERT_TRUE(cyclone_client.wait_for_server() && other_client.wait_for_server());
  std::uint64_t sent = 0;
  for (const auto& [name, bytes] : hostile_requests(sizeof(CorrelationHeader))) {
    cyclone_client.call(bytes);
    ++sent;
  }
  for (const auto& [name, bytes] : hostile_requests(0)) {
    other_client.call(bytes);
    ++sent;
  }
  const auto header = header_of(9, 9);
  cyclone_client.call(cyclone_request(header, "still here"));
  const auto reply = reply_to(cyclone_client, header);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->file(), "saved still here");
  // PL_CDR differs from CDR in its parameter lists alone, and Fast CDR reads it as CDR.
  EXPECT_GE(faults("unreadable_request"), sent - 4);
  EXPECT_LE(faults("unreadable_request"), sent);
}

TEST_F(ForeignService, RefusesARequestThatItCannotReadInWords) {
  VendorParticipant peer(eclipse_cyclone);
  ByteClient client(peer, service, type_stem);
  ASSERT_TRUE(client.wait_for_server());
  const auto header = header_of(3, 4);
  SerializedSample request = cyclone_request(header, "file");
  request.resize(request.size() - 3);
  client.call(request);
  const auto reply = reply_to(client, header);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status().code(), 1);
  EXPECT_THAT(reply->status().reason(), HasSubstr("SaveMap_Request_"));
  EXPECT_THAT(reply->status().reason(), HasSubstr("same version"));
}

TEST_F(ForeignService, IsNotHeldUpByClientsThatNeverListen) {
  VendorParticipant deaf(eclipse_cyclone);
  ByteClient deaf_client(deaf, service, type_stem, false);
  Participant side(loopback(false));
  ServiceClient<SaveMap_Request, SaveMap_Response> client(side, service);
  ASSERT_TRUE(deaf_client.wait_for_server() && client.wait_for_server(discovery_timeout));
  constexpr int deaf_requests = 20;
  for (int i = 0; i < deaf_requests; ++i)
    deaf_client.call(cyclone_request(header_of(1, 1), "deaf"));
  const auto began = std::chrono::steady_clock::now();
  SaveMap_Request request;
  request.file("quick");
  EXPECT_TRUE(client.call(request, discovery_timeout));
  // One after the other, the deaf ones would take 10 s.
  EXPECT_LT(std::chrono::steady_clock::now() - began, 7s);
  EXPECT_TRUE(test::eventually([&] { return faults("undelivered_reply") >= deaf_requests; },
                               discovery_timeout));
  EXPECT_EQ(faults("undelivered_reply"), deaf_requests);
}

}  // namespace
}  // namespace stillmap::dds
