#include <gmock/gmock.h>

#include <algorithm>

#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

/// The room with cars that stand where its pillars are.
Scan room_with_cars(int index) {
  Scan scan = room_scan(index);
  std::ranges::replace(scan.labels, SemanticClass::pole, SemanticClass::car);
  return scan;
}

class RemovedService : public testing::Test {
 protected:
  RemovedService() : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    client_.wait_for_server(patience);
    ScanPublisher publisher(setup_.publisher(true));
    EXPECT_TRUE(publisher.wait_for_subscriber(patience));
    for (int i = 0; i < 10; ++i) {
      EXPECT_TRUE(publisher.publish(room_with_cars(i), {}, patience));
    }
    EXPECT_TRUE(wait_for_scans(client_, 10));
  }
  /// What the server says to a request that it refuses.
  template <typename Ask>
  [[nodiscard]] static std::string refusal(Ask ask) {
    try {
      ask();
    } catch (const ServiceError& error) {
      return error.what();
    }
    return "not refused";
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
};

TEST_F(RemovedService, ParkedCarsAreRememberedAndCanBeBroughtBack) {
  const RemovedVoxels removed = client_.get_removed(BoxRegion{});
  ASSERT_GT(removed.total, 20U);
  EXPECT_EQ(removed.voxels.size(), removed.total);
  for (const RemovedVoxel& voxel : removed.voxels) EXPECT_EQ(voxel.label, SemanticClass::car);
  EXPECT_EQ(client_.get_removed(BoxRegion{}, 3).voxels.size(), 3U);

  MapQuery cars;
  cars.classes.set(static_cast<std::size_t>(SemanticClass::car));
  EXPECT_EQ(client_.get_whole_static_map(cars).voxels.size(), 0U);
  const auto reason = removed.voxels.front().reason;
  EXPECT_GT(client_.restore_removed(reason, BoxRegion{}), 20U);
  EXPECT_GT(client_.get_whole_static_map(cars).voxels.size(), 20U);
  EXPECT_LT(client_.get_removed(BoxRegion{}).total, removed.total);
}

TEST_F(RemovedService, RefusesWhatMakesNoSenseAndGoesOn) {
  const PolygonRegion crossed{.corners_map = {{0, 0}, {9, 9}, {9, 0}, {0, 9}}, .heights = {}};
  EXPECT_THAT(refusal([&] { static_cast<void>(client_.get_removed(crossed)); }),
              HasSubstr("cross"));
  EXPECT_THAT(refusal([&] { client_.restore_removed(static_cast<RemovalReason>(9), BoxRegion{}); }),
              HasSubstr("reason is 9"));
  BoxRegion upside_down;
  upside_down.box_map.min().z() = 5.0;
  upside_down.box_map.max().z() = -5.0;
  EXPECT_THAT(refusal([&] { client_.restore_removed(RemovalReason::moving, upside_down); }),
              HasSubstr("box z"));
  EXPECT_GT(client_.get_removed(BoxRegion{}).total, 0U);
}

}  // namespace
}  // namespace stillmap::test
