#include "clients/gateway/tile_source.hpp"

#include <gmock/gmock.h>

#include <map>
#include <mutex>
#include <semaphore>
#include <span>

#include "core/map/voxel_grid.hpp"
#include "idl/conversions/tile.hpp"
#include "idl/dds/service_server.hpp"
#include "idl/interface/services.hpp"
#include "stillmap_msgs.h"
#include "tests/gateway/posted_work.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::gateway {
namespace {

using stillmap_msgs::srv::GetTiles_Request;
using stillmap_msgs::srv::GetTiles_Response;
using ::testing::HasSubstr;

const VoxelGrid grid(0.2, 20.0);

/// With one voxel, by whose number of points its states differ.
Tile tile_of(TileId id, std::uint32_t points) {
  Voxel voxel;
  voxel.index = {1, 1, 1};
  voxel.point_count = points;
  voxel.mean_map = (grid.corner_map(id, voxel.index).array() + 0.1).cast<float>();
  voxel.evidence.add(SemanticClass::road, 0.5F);
  return make_tile(id, points, std::span<const Voxel>(&voxel, 1), grid);
}

class TileSourceTest : public testing::Test {
 protected:
  ~TileSourceTest() override { go_on_.release(1000); }

  void set(TileId id, std::uint32_t points) {
    const std::scoped_lock lock(mutex_);
    tiles_.insert_or_assign(id, tile_of(id, points));
  }
  /// The server leaves it out of its answers.
  void damage(TileId id) {
    const std::scoped_lock lock(mutex_);
    tiles_.erase(id);
    damaged_ = id;
  }
  [[nodiscard]] int requests() {
    const std::scoped_lock lock(mutex_);
    return requests_;
  }

  GetTiles_Response answer(const GetTiles_Request& request) {
    GetTiles_Response response;
    response.identity(wire::to_wire(identity_));
    {
      const std::scoped_lock lock(mutex_);
      ++requests_;
      for (const auto& id : request.ids()) {
        const auto found = tiles_.find({id.x(), id.y()});
        if (found != tiles_.end()) {
          response.tiles().push_back(wire::to_wire(found->second, identity_));
        } else if (TileId{id.x(), id.y()} != damaged_) {
          response.missing().push_back(id);
        }
      }
    }
    // What is in the answer was so before it is on its way.
    go_on_.acquire();
    return response;
  }

  dds::MapIdentity identity_{.version = 1, .map_id = 3, .tile_size_m = 20.0, .voxel_size_m = 0.2};
  std::mutex mutex_;
  std::map<TileId, Tile> tiles_;
  TileId damaged_{-1000, -1000};
  int requests_ = 0;
  std::counting_semaphore<10000> go_on_{0};
  dds::Participant server_side_{dds::loopback(true)};
  dds::ServiceServer<GetTiles_Request, GetTiles_Response> server_{
      server_side_, dds::services::get_tiles.in("stillmap"),
      [this](const GetTiles_Request& request) { return answer(request); }};
  PostedWork work_;
  dds::Participant client_side_{dds::loopback(true)};
  TileSource source_{client_side_, "stillmap", dds::discovery_timeout, work_.post()};
};

TEST_F(TileSourceTest, ATileThatTheServerCannotReadKeepsNobodyWaiting) {
  set({0, 0}, 5);
  damage({1, 0});
  go_on_.release(100);
  for (int round = 0; round < 2; ++round) {
    int answered = 0;
    std::string fault;
    source_.get({0, 0}, tile_of({0, 0}, 5).info.content_hash,
                [&](const TileSource::Answer& got) { answered += got.tile != nullptr ? 1 : 0; });
    source_.get({1, 0}, 7, [&](const TileSource::Answer& got) {
      ++answered;
      fault = got.fault;
      EXPECT_EQ(got.tile, nullptr);
    });
    source_.get({2, 0}, 7, [&](const TileSource::Answer& got) {
      ++answered;
      EXPECT_TRUE(got.fault.empty() && got.tile == nullptr) << "there is none";
    });
    ASSERT_TRUE(work_.eventually([&] { return answered == 3; })) << round;
    EXPECT_THAT(fault, HasSubstr("ask again"));
  }
}

TEST_F(TileSourceTest, ANewerStateIsNotAnsweredByAnOlderOneThatIsOnItsWay) {
  set({0, 0}, 5);
  std::vector<std::uint64_t> got;
  const auto remember = [&](const TileSource::Answer& answer) {
    ASSERT_NE(answer.tile, nullptr);
    got.push_back(answer.tile->content_hash);
  };
  const std::uint64_t old_hash = tile_of({0, 0}, 5).info.content_hash;
  const std::uint64_t new_hash = tile_of({0, 0}, 9).info.content_hash;
  source_.get({0, 0}, old_hash, remember);
  ASSERT_TRUE(work_.eventually([&] { return requests() == 1; }));
  set({0, 0}, 9);
  source_.get({0, 0}, new_hash, remember);
  go_on_.release(100);
  ASSERT_TRUE(work_.eventually([&] { return got.size() == 2; }));
  EXPECT_THAT(got, testing::ElementsAre(old_hash, new_hash));
  // A state that is no more does not ask for ever.
  got.clear();
  source_.get({0, 0}, old_hash + 1, remember);
  ASSERT_TRUE(work_.eventually([&] { return got.size() == 1; }));
  EXPECT_EQ(got.front(), new_hash);
}

TEST_F(TileSourceTest, EndsAtOnceWhateverItStillWaitsFor) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::seconds timeout(60);
  // One server does not answer, and one is not there.
  for (const char* const server : {"stillmap", "nobody"}) {
    auto source = std::make_unique<TileSource>(client_side_, server, timeout, work_.post());
    int answered = 0;
    for (int x = 0; x < 200; ++x)
      source->get({x, 0}, 7, [&](const TileSource::Answer&) { ++answered; });
    if (server == std::string("stillmap")) {
      ASSERT_TRUE(work_.eventually([&] { return requests() == 1; }));
    }
    source->forget_waiting();
    const auto began = Clock::now();
    source = nullptr;
    EXPECT_LT(Clock::now() - began, timeout / 4) << server;
    EXPECT_EQ(answered, 0);
  }
}

}  // namespace
}  // namespace stillmap::gateway
