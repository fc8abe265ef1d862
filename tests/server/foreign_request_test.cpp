#include <gtest/gtest.h>

#include "tests/idl/vendor_participant.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

TEST(ForeignRequest, ThatCannotBeReadIsCountedInTheStatus) {
  const ServiceSetup setup("latest");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  EXPECT_EQ(client.status().counter("unreadable_request_stillmap/save_map"), 0U);

  dds::VendorParticipant peer(dds::rti_connext);
  dds::ByteClient hostile(peer, "stillmap/save_map", "stillmap_msgs::srv::dds_::SaveMap");
  ASSERT_TRUE(hostile.wait_for_server());
  // A string of 2^32 - 1 bytes, of which none follows.
  hostile.call({0, 1, 0, 0, 2, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF});
  EXPECT_TRUE(hostile.receive(patience));
  EXPECT_TRUE(eventually(
      [&] { return client.status().counter("unreadable_request_stillmap/save_map") == 1; }));
}

}  // namespace
}  // namespace stillmap::test
