#include "server/services/paged_snapshots.hpp"

#include <gtest/gtest.h>

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;

PagedSnapshots::Snapshot view_of(std::uint64_t version) {
  MapSnapshot view;
  view.map_id = 3;
  view.version = version;
  return std::make_shared<const MapSnapshot>(std::move(view));
}

const PagedSnapshots::Clock::time_point begin{};

TEST(PagedSnapshots, LastUntilSoonAfterTheLastPage) {
  PagedSnapshots views;
  PagedSnapshots::Snapshot view = view_of(7);
  const std::weak_ptr<const MapSnapshot> watched = view;
  views.keep(view, begin);
  EXPECT_EQ(views.find({.map_id = 3, .version = 7}), view);
  EXPECT_EQ(views.find({.map_id = 3, .version = 8}), nullptr);
  EXPECT_EQ(views.find({.map_id = 4, .version = 7}), nullptr) << "of a map that was loaded since";
  views.end(view, begin);
  views.drop_expired(begin + PagedSnapshots::last_page_grace);
  EXPECT_EQ(views.find({.map_id = 3, .version = 7}), view)
      << "the last page may be asked for again";
  views.drop_expired(begin + PagedSnapshots::last_page_grace + 1s);
  view.reset();
  EXPECT_TRUE(watched.expired());
}

TEST(PagedSnapshots, LastWhileAnotherClientGoesOnPaging) {
  PagedSnapshots views;
  const auto view = view_of(7);
  views.keep(view, begin);
  views.end(view, begin);
  views.keep(view, begin + 1s);
  views.drop_expired(begin + PagedSnapshots::max_page_interval);
  EXPECT_EQ(views.find({.map_id = 3, .version = 7}), view);
  EXPECT_EQ(views.size(), 1U);
}

TEST(PagedSnapshots, GoWhenTheirClientAsksNoMore) {
  PagedSnapshots views;
  const auto slow = view_of(1);
  const auto gone = view_of(2);
  views.keep(slow, begin);
  views.keep(gone, begin);
  views.keep(slow, begin + PagedSnapshots::max_page_interval);
  views.drop_expired(begin + PagedSnapshots::max_page_interval + 1s);
  EXPECT_EQ(views.find({.map_id = 3, .version = 1}), slow);
  EXPECT_EQ(views.find({.map_id = 3, .version = 2}), nullptr);
}

/// A view with one tile of this many bytes of voxels, and one that all views share.
PagedSnapshots::Snapshot view_with_tile(std::uint64_t version, std::size_t bytes) {
  static const auto shared = std::make_shared<const Tile>();
  MapSnapshot view;
  view.map_id = 3;
  view.version = version;
  Tile tile;
  tile.info.id = {1, 0};
  tile.voxels =
      PackedVoxels(tile.info.id, {0.2, 20.0}, std::vector<Voxel>(bytes / sizeof(PackedVoxel)));
  tile.info.voxel_count = static_cast<std::uint32_t>(tile.voxels.size());
  view.tiles = {shared, std::make_shared<const Tile>(std::move(tile))};
  return std::make_shared<const MapSnapshot>(std::move(view));
}

TEST(PagedSnapshots, OfManyClientsAreKeptWhileTheyTakeLittle) {
  PagedSnapshots views;
  for (std::uint64_t version = 0; version < 200; ++version) {
    views.keep(view_with_tile(version, 1000), begin);
  }
  EXPECT_EQ(views.size(), 200U);
  EXPECT_NE(views.find({.map_id = 3, .version = 0}), nullptr);
}

TEST(PagedSnapshots, AreLimitedInBytes) {
  PagedSnapshots views(1'000'000);
  const auto first = view_with_tile(0, 100'000);
  views.keep(first, begin);
  for (std::uint64_t version = 1; version <= 20; ++version) {
    if (version == 5) views.keep(first, begin + 1s);
    views.keep(view_with_tile(version, 100'000), begin);
    EXPECT_LE(views.bytes(), 1'000'000U);
  }
  EXPECT_GT(views.size(), 5U);
  EXPECT_EQ(views.find({.map_id = 3, .version = 0}), first);
  EXPECT_EQ(views.find({.map_id = 3, .version = 1}), nullptr)
      << "one of those that were asked for longest ago";
  EXPECT_NE(views.find({.map_id = 3, .version = 20}), nullptr);
}

TEST(PagedSnapshots, DoNotMindTheEndOfWhatIsGone) {
  PagedSnapshots views;
  views.end(view_of(3), begin);
  EXPECT_EQ(views.size(), 0U);
}

}  // namespace
}  // namespace stillmap::server
