#include "core/map/tools/map_check.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include <fstream>
#include <random>

#include "core/map/storage/map_file_copy.hpp"
#include "core/map/storage/map_sessions.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "tests/map/saved_maps.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class MapCheckTest : public testing::Test {
 protected:
  MapCheckTest() { open_map_file(file_)->save(saved_); }

  void write(const std::string& bytes) const {
    std::ofstream(file_, std::ios::binary | std::ios::trunc) << bytes;
  }
  /// Runs SQL on the file, past the store.
  void alter(const std::string& sql) const {
    SQLite::Database(file_.string(), SQLite::OPEN_READWRITE).exec(sql);
  }
  [[nodiscard]] double stored_tile_bytes() const {
    SQLite::Database database(file_.string());
    return database.execAndGet("SELECT sum(length(encoded)) FROM tiles").getDouble();
  }
  /// The check's only fault.
  [[nodiscard]] MapFault only_fault() const {
    const MapCheck check = check_map_file(file_);
    EXPECT_EQ(check.faults.size(), 1U);
    return check.faults.empty() ? MapFault() : check.faults.front();
  }
  [[nodiscard]] std::string refusal() const {
    return message_of<MapFileError>([&] { static_cast<void>(check_map_file(file_)); });
  }
  /// True when the damage was named; false for a file that passes. That must then be as good as
  /// the one that was saved.
  [[nodiscard]] bool is_named(const std::string& what) const {
    const std::string before = content_of(file_);
    bool is_found = true;
    try {
      const MapCheck check = check_map_file(file_);
      is_found = !check.is_sound();
      for (const MapFault& fault : check.faults) EXPECT_FALSE(fault.what.empty()) << what;
      if (!is_found) expect_tiles_as_saved(what);
    } catch (const MapFileError& error) {
      EXPECT_THAT(error.what(), HasSubstr(file_.string())) << what;
    }
    EXPECT_EQ(content_of(file_), before) << what;
    return is_found;
  }
  void expect_tiles_as_saved(const std::string& what) const {
    const MapSnapshot view = read_map_file(file_).view;
    ASSERT_EQ(view.tiles.size(), saved_.view.tiles.size()) << what;
    for (std::size_t i = 0; i < view.tiles.size(); ++i) {
      EXPECT_EQ(view.tiles[i]->info.content_hash, saved_.view.tiles[i]->info.content_hash) << what;
    }
  }

  SavedMap saved_ = test::saved_map(2);
  ScratchFolder folder_;
  fs::path file_ = folder_ / "city.stillmap";
};

TEST_F(MapCheckTest, ASoundFilePassesAndStaysAsItIs) {
  const std::string before = content_of(file_);
  std::size_t last_done = 0;
  const MapCheck check = check_map_file(file_, [&](std::size_t done, std::size_t total) {
    EXPECT_EQ(done, ++last_done);
    EXPECT_EQ(total, saved_.view.tiles.size());
  });
  EXPECT_TRUE(check.is_sound());
  EXPECT_EQ(check.tiles, saved_.view.tiles.size());
  EXPECT_EQ(check.sound_tiles, check.tiles);
  EXPECT_EQ(last_done, check.tiles);
  EXPECT_EQ(check.poses, saved_.trajectory.size());
  EXPECT_EQ(content_of(file_), before);
}

TEST_F(MapCheckTest, NamesTheTileThatDoesNotDecode) {
  const TileId id = saved_.view.tiles[1]->info.id;
  alter("UPDATE tiles SET encoded = x'0102030405' WHERE x = " + std::to_string(id.x) +
        " AND y = " + std::to_string(id.y));
  const MapFault fault = only_fault();
  EXPECT_EQ(fault.place, "tile");
  ASSERT_TRUE(fault.tile);
  EXPECT_EQ(*fault.tile, id);
  EXPECT_EQ(check_map_file(file_).sound_tiles, saved_.view.tiles.size() - 1);
}

TEST_F(MapCheckTest, NamesTilesThatAreNotTheirRows) {
  const TileId first = saved_.view.tiles[0]->info.id;
  const std::string where =
      " WHERE x = " + std::to_string(first.x) + " AND y = " + std::to_string(first.y);
  alter("UPDATE tiles SET content_hash = content_hash + 1" + where);
  EXPECT_THAT(only_fault().what, HasSubstr("row's revision and hash"));
  alter("UPDATE tiles SET content_hash = content_hash - 1, x = 900" + where);
  EXPECT_THAT(only_fault().what, HasSubstr("says that it is tile"));
}

TEST_F(MapCheckTest, NamesRowsByWhichATileIsNotFound) {
  alter("UPDATE tiles SET max_x = min_x - 50 WHERE (x, y) = (SELECT x, y FROM tiles LIMIT 1)");
  EXPECT_THAT(only_fault().what, HasSubstr("number of voxels or bounds"));
  alter("UPDATE tiles SET max_x = min_x + 50, voxel_count = voxel_count + 1");
  EXPECT_EQ(check_map_file(file_).faults.size(), saved_.view.tiles.size());
}

TEST_F(MapCheckTest, NamesSizesAndVersionsThatCannotBe) {
  alter("UPDATE map SET version = 0");
  EXPECT_THAT(check_map_file(file_).faults.at(0).what, HasSubstr("the map is at version 0"));
  alter("UPDATE map SET voxel_size_m = 0");
  EXPECT_THAT(only_fault().what, HasSubstr("voxels of 0"));
  alter("DELETE FROM map");
  EXPECT_EQ(only_fault().place, "map");
}

TEST_F(MapCheckTest, NamesTilesOfOtherSizesThanTheMaps) {
  alter("UPDATE map SET voxel_size_m = voxel_size_m / 2, tile_size_m = tile_size_m / 2");
  const MapCheck check = check_map_file(file_);
  EXPECT_EQ(check.sound_tiles, 0U);
  EXPECT_THAT(check.faults.at(0).what, HasSubstr("its map has"));
}

TEST_F(MapCheckTest, AClockThatWasSetBackBeginsNoSession) {
  EXPECT_EQ(check_map_file(file_).sessions, 1U);
  alter("UPDATE trajectory SET stamp_ns = 0 WHERE position = 4");
  const MapCheck check = check_map_file(file_);
  EXPECT_TRUE(check.is_sound());
  EXPECT_EQ(check.sessions, 1U);
}

TEST_F(MapCheckTest, CountsTheSessionsThatAreListed) {
  SavedMap after = saved_;
  after.trajectory.push_back({after.trajectory.back().stamp_ns - 1, Eigen::Isometry3d::Identity()});
  after.trajectory.push_back({after.trajectory.back().stamp_ns - 1, Eigen::Isometry3d::Identity()});
  after.view.map_id += 1;
  after.view.version += 1;
  add_map_session(file_, after, {.source = "tuesday"});
  EXPECT_EQ(check_map_file(file_).sessions, 2U);
  EXPECT_EQ(read_map_sessions(file_).size(), 2U);
}

TEST_F(MapCheckTest, NamesPosesThatCannotBe) {
  alter("UPDATE trajectory SET qw = 3 WHERE position = 1");
  EXPECT_THAT(only_fault().what, AllOf(HasSubstr("pose 1"), HasSubstr("quaternion")));
  alter(
      "DELETE FROM trajectory WHERE position = 1; UPDATE trajectory SET x = 1e300 WHERE position = "
      "2");
  EXPECT_THAT(only_fault().what, HasSubstr("farther from the origin"));
  alter(
      "DELETE FROM trajectory WHERE position = 2; UPDATE trajectory SET z = 9e999 WHERE position = "
      "3");
  EXPECT_THAT(only_fault().what, HasSubstr("not finite"));
}

TEST_F(MapCheckTest, NeverPassesASingleFlippedBitThatMatters) {
  const std::string sound = content_of(file_);
  const double tile_share = stored_tile_bytes() / static_cast<double>(sound.size());
  std::mt19937 random(7);
  std::uniform_int_distribution<std::size_t> place(0, sound.size() - 1);
  std::uniform_int_distribution<int> bit(0, 7);
  int named = 0;
  for (int i = 0; i < 200; ++i) {
    std::string bytes = sound;
    const std::size_t at = place(random);
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << bit(random)));
    write(bytes);
    named += is_named("byte " + std::to_string(at)) ? 1 : 0;
  }
  // The rest of the file is mostly room that SQLite has not used yet.
  EXPECT_GT(named, 200.0 * 0.8 * tile_share);
}

TEST_F(MapCheckTest, NamesEveryTruncation) {
  const std::string sound = content_of(file_);
  for (int i = 0; i < 40; ++i) {
    write(sound.substr(0, sound.size() * static_cast<std::size_t>(i) / 40));
    EXPECT_TRUE(is_named("part " + std::to_string(i)));
  }
}

TEST_F(MapCheckTest, ReadsWhatIsLeftOfADamagedFile) {
  const std::string sound = content_of(file_);
  std::string bytes = sound;
  // A part of one tile's bytes, within a page.
  const auto blob = encode_tile(*saved_.view.tiles.front());
  const std::size_t at = bytes.find(std::string(blob.begin() + 200, blob.begin() + 400));
  ASSERT_NE(at, std::string::npos);
  bytes.replace(at, 200, std::string(200, '\x55'));
  write(bytes);
  const MapCheck check = check_map_file(file_);
  EXPECT_FALSE(check.is_sound());
  EXPECT_GT(check.sound_tiles, 0U);
  EXPECT_LT(check.sound_tiles, saved_.view.tiles.size());
}

TEST_F(MapCheckTest, RefusesWhatIsNoMapFileOfThisVersion) {
  alter("PRAGMA user_version = 1000");
  EXPECT_THAT(refusal(), AllOf(HasSubstr("newer"), HasSubstr(file_.string())));
  alter("PRAGMA application_id = 1");
  EXPECT_THAT(refusal(), HasSubstr("another program"));
  write(std::string(300, '.'));
  EXPECT_THAT(refusal(), HasSubstr("not a map file"));
  write("");
  EXPECT_THAT(refusal(), HasSubstr("is empty"));
  fs::remove(file_);
  EXPECT_THAT(refusal(), HasSubstr("is not there"));
  EXPECT_FALSE(fs::exists(file_));
  fs::create_directory(file_);
  EXPECT_THAT(refusal(), HasSubstr("is not a file"));
}

}  // namespace
}  // namespace stillmap
