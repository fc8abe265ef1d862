#include <gtest/gtest.h>

#include <algorithm>

#include "idl/dds/reader.hpp"
#include "idl/dds/writer.hpp"
#include "rmw_dds_common.h"
#include "sensor_msgs.h"
#include "tests/idl/dds_fixture.hpp"

// ros_discovery_info while endpoints come and go.

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using rmw_dds_common::msg::ParticipantEntitiesInfo;
using sensor_msgs::msg::PointCloud2;

class RosGraphOfANode : public testing::Test {
 protected:
  static DdsOptions node_options() {
    DdsOptions options = loopback(false);
    options.node_name = "mapper";
    return options;
  }

  /// Takes announcements until one has so many readers and writers.
  bool announces(std::size_t readers, std::size_t writers) {
    while (announcements_.take(newest_, {}, discovery_timeout)) {
      const auto& node = newest_.node_entities_info_seq().at(0);
      if (node.reader_gid_seq().size() == readers && node.writer_gid_seq().size() == writers) {
        return true;
      }
    }
    return false;
  }

  Participant node_{node_options()};
  Participant watcher_{loopback(false)};
  Reader<ParticipantEntitiesInfo> announcements_{
      watcher_, "ros_discovery_info", {.transient_local = true, .depth = 1}};
  ParticipantEntitiesInfo newest_;
};

TEST_F(RosGraphOfANode, AnnouncesEndpointsAsTheyComeAndGo) {
  EXPECT_TRUE(announces(0, 0));
  {
    const Reader<PointCloud2> reader(node_, "rt/points", {});
    EXPECT_TRUE(announces(1, 0));
    const auto& gid = newest_.node_entities_info_seq()[0].reader_gid_seq()[0].data();
    const auto guid = reader.guid();
    EXPECT_TRUE(std::equal(gid.begin(), gid.begin() + 12, guid.guidPrefix.value));
    EXPECT_TRUE(std::equal(gid.begin() + 12, gid.begin() + 16, guid.entityId.value));
    EXPECT_TRUE(std::all_of(gid.begin() + 16, gid.end(), [](int byte) { return byte == 0; }));
    const Writer<PointCloud2> writer(node_, "rt/map", {});
    EXPECT_TRUE(announces(1, 1));
  }
  EXPECT_TRUE(announces(0, 0));
}

}  // namespace
}  // namespace stillmap::dds
