#include <gtest/gtest.h>

#include "idl/interface/topics.hpp"
#include "stillmap_msgs.h"
#include "tests/idl/vendor_participant.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

TEST(ForeignRequest, ThatCannotBeReadIsCountedInTheStatus) {
  const ServiceSetup setup("latest");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  EXPECT_EQ(client.status().counter("unreadable_request", "stillmap/save_map"), 0U);

  dds::VendorParticipant peer(dds::rti_connext);
  dds::ByteClient hostile(peer, "stillmap/save_map", "stillmap_msgs::srv::dds_::SaveMap");
  ASSERT_TRUE(hostile.wait_for_server());
  // A string of 2^32 - 1 bytes, of which none follows.
  hostile.call({0, 1, 0, 0, 2, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF});
  EXPECT_TRUE(hostile.receive(patience));
  EXPECT_TRUE(eventually(
      [&] { return client.status().counter("unreadable_request", "stillmap/save_map") == 1; }));
}

TEST(ForeignRequest, ThatChangesTheMapIsCarriedOutOnceHoweverOftenItComes) {
  const ServiceSetup setup("latest");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  dds::VendorParticipant peer(dds::rti_connext);
  dds::ByteClient asker(peer, "stillmap/reset", "stillmap_msgs::srv::dds_::Reset");
  ASSERT_TRUE(asker.wait_for_server());
  stillmap_msgs::srv::Reset_Request request;
  request.format_version(dds::wire_format_version);
  const auto request_type = dds::type_support<stillmap_msgs::srv::Reset_Request>();
  const auto new_map = [&](std::int64_t call_number) {
    asker.call(dds::to_bytes(request_type, &request, 0), call_number);
    stillmap_msgs::srv::Reset_Response reply;
    auto answer = asker.receive(patience);
    const auto reply_type = dds::type_support<stillmap_msgs::srv::Reset_Response>();
    if (!answer || !dds::from_bytes(reply_type, answer->bytes, &reply)) return std::uint64_t{0};
    return reply.status().map_id();
  };
  const std::uint64_t first = new_map(1);
  EXPECT_NE(first, 0U);
  EXPECT_EQ(new_map(1), first);
  EXPECT_NE(new_map(2), first);
  // Clients that name no call are answered each time.
  EXPECT_NE(new_map(0), new_map(0));
}

}  // namespace
}  // namespace stillmap::test
