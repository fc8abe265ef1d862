#include "core/map/storage/map_sessions.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include <fstream>
#include <iterator>
#include <string>

#include "core/map/static_map.hpp"
#include "core/map/tools/map_check.hpp"
#include "tests/map/map_worlds.hpp"
#include "tests/map/saved_maps.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using test::expect_equal;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// A map of `first` poses, one a second.
Trajectory path_of(std::size_t poses) {
  Trajectory path;
  for (std::size_t i = 0; i < poses; ++i) {
    path.push_back({static_cast<std::int64_t>(i) * 1'000'000'000,
                    Eigen::Isometry3d(Eigen::Translation3d(2.0 * static_cast<double>(i), 0, 0))});
  }
  return path;
}

/// A file with a map of one session, and a live one that goes on in it.
class MapSessionsTest : public testing::Test {
 protected:
  MapSessionsTest() : map_(test::street_map(3, 60)) {
    static_cast<void>(map_.checkpoint(CheckpointScope::everything));
    SavedMap first = to_saved_map(map_.checkpoint(CheckpointScope::everything));
    first.view.map_id = 7;
    first.trajectory = path_of(5);
    first.metadata = {{"sensor", "one"}};
    open_map_file(file_)->save(first);
    write_first_session(file_, "monday");
    map_.resume(first.view, first.tile_evidence);
  }

  /// One more session: something new 5 m above the street.
  void add_session(const std::string& source, std::size_t poses, float x_m) {
    LabelledScan landmark;
    for (int i = 0; i < 3; ++i) test::add_point(landmark, {x_m, 0.0F, 5.0F}, SemanticClass::pole);
    map_.insert(landmark, Eigen::Isometry3d::Identity());
    const MapCheckpoint checkpoint = map_.checkpoint();
    SavedMap after = to_saved_map(checkpoint);
    map_.checkpoint_stored(checkpoint.step);
    after.view.map_id = 100 + poses;
    after.trajectory = path_of(poses);
    after.metadata = {{"sensor", source}};
    after.is_partial = true;
    add_map_session(file_, after, {.source = source, .clock_offset_ns = 3, .closures = 4});
  }

  /// Everything that a map is, row by row.
  [[nodiscard]] static std::string rows_of(const fs::path& file) {
    SQLite::Database database(file.string(), SQLite::OPEN_READONLY);
    std::string rows;
    for (const char* table : {"map", "tiles", "memories", "trajectory", "metadata"}) {
      SQLite::Statement row(database, std::string("SELECT * FROM ") + table + " ORDER BY 1, 2");
      while (row.executeStep()) {
        for (int c = 0; c < row.getColumnCount(); ++c) {
          const SQLite::Column column = row.getColumn(c);
          rows.append(static_cast<const char*>(column.getBlob()),
                      static_cast<std::size_t>(column.getBytes()));
          rows += '|';
        }
      }
    }
    return rows;
  }
  [[nodiscard]] static std::string bytes_of(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  ScratchFolder folder_;
  fs::path file_ = folder_ / "city.stillmap";
  StaticMap map_;
};

TEST_F(MapSessionsTest, AreListedInTheirOrder) {
  add_session("tuesday", 9, 1.0F);
  const auto sessions = read_map_sessions(file_);
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_EQ(sessions[0].number, 1);
  EXPECT_EQ(sessions[0].source, "monday");
  EXPECT_EQ(sessions[0].poses, 5U);
  EXPECT_NEAR(sessions[0].way_m, 8.0, 1e-9);
  EXPECT_EQ(sessions[1].number, 2);
  EXPECT_EQ(sessions[1].source, "tuesday");
  EXPECT_EQ(sessions[1].first_pose, 5U);
  EXPECT_EQ(sessions[1].poses, 4U);
  EXPECT_NEAR(sessions[1].way_m, 6.0, 1e-9);
  EXPECT_EQ(sessions[1].first_stamp_ns, 5'000'000'000);
  EXPECT_EQ(sessions[1].clock_offset_ns, 3);
  EXPECT_EQ(sessions[1].closures, 4U);
}

TEST_F(MapSessionsTest, MapsThatDoNotSayHaveOne) {
  SQLite::Database(file_.string(), SQLite::OPEN_READWRITE).exec("DROP TABLE sessions");
  const auto sessions = read_map_sessions(file_);
  ASSERT_EQ(sessions.size(), 1U);
  EXPECT_EQ(sessions[0].poses, 5U);
  EXPECT_EQ(sessions[0].source, "");
  add_session("tuesday", 9, 1.0F);
  EXPECT_EQ(read_map_sessions(file_).size(), 2U);
  EXPECT_TRUE(read_map_sessions(folder_.file("empty.stillmap", "x").parent_path() / "city.stillmap")
                  .size() == 2U);
}

TEST_F(MapSessionsTest, NewestIsWithdrawnToTheByte) {
  const std::string one = rows_of(file_);
  add_session("tuesday", 9, 1.0F);
  const std::string two = rows_of(file_);
  EXPECT_NE(one, two);
  add_session("wednesday", 12, 2.0F);
  const std::string file_before = bytes_of(file_);

  const fs::path without_third = folder_ / "two.stillmap";
  withdraw_newest_session(file_, without_third);
  EXPECT_EQ(rows_of(without_third), two);
  EXPECT_EQ(read_map_sessions(without_third).size(), 2U);
  const fs::path without_second = folder_ / "one.stillmap";
  withdraw_newest_session(without_third, without_second);
  EXPECT_EQ(rows_of(without_second), one);
  EXPECT_EQ(bytes_of(file_), file_before);

  EXPECT_THAT(
      [&] { withdraw_newest_session(without_second, folder_ / "none.stillmap"); },
      ThrowsMessage<MapFileError>(AllOf(HasSubstr("one.stillmap"), HasSubstr("one session"))));
  EXPECT_FALSE(fs::exists(folder_ / "none.stillmap"));
}

TEST_F(MapSessionsTest, TilesThatTheSessionDidNotChangeStayAsTheyAre) {
  const auto blobs = [&](const std::string& where) {
    SQLite::Database database(file_.string(), SQLite::OPEN_READONLY);
    return database
        .execAndGet(
            "SELECT coalesce(group_concat(hex(t.encoded) || hex(m.encoded)), '') FROM tiles "
            "t LEFT JOIN memories m ON m.x = t.x AND m.y = t.y WHERE " +
            where)
        .getString();
  };
  const std::string changed = "t.x = 0 AND t.y = 0", others = "NOT (t.x = 0 AND t.y = 0)";
  const std::string changed_before = blobs(changed), others_before = blobs(others);
  ASSERT_FALSE(others_before.empty());
  add_session("tuesday", 9, 1.0F);
  EXPECT_NE(blobs(changed), changed_before);
  EXPECT_EQ(blobs(others), others_before);
}

TEST_F(MapSessionsTest, WhatAServerMappedOnInIsNotWithdrawn) {
  add_session("tuesday", 9, 1.0F);
  const auto store = open_map_file(file_);
  SavedMap more = store->load();
  more.view.version += 1;
  more.trajectory = path_of(10);
  store->save(more);
  EXPECT_EQ(read_map_sessions(file_).size(), 2U);
  EXPECT_THAT([&] { withdraw_newest_session(file_, folder_ / "out.stillmap"); },
              ThrowsMessage<MapFileError>(HasSubstr("mapped on in by a server")));
}

TEST_F(MapSessionsTest, AnotherMapInTheFileHasNoneOfThem) {
  add_session("tuesday", 9, 1.0F);
  SavedMap other = test::saved_map(2);
  open_map_file(file_)->save(other);
  const auto sessions = read_map_sessions(file_);
  ASSERT_EQ(sessions.size(), 1U);
  EXPECT_EQ(sessions[0].poses, other.trajectory.size());
  EXPECT_EQ(sessions[0].source, "");
}

TEST_F(MapSessionsTest, StoresThatDoNotKnowThemLoadTheMap) {
  add_session("tuesday", 9, 1.0F);
  const SavedMap loaded = open_map_file(file_)->load();
  EXPECT_EQ(loaded.trajectory.size(), 9U);
  EXPECT_EQ(loaded.metadata.at("sensor"), "tuesday");
  SavedMap now = to_saved_map(map_.checkpoint(CheckpointScope::everything));
  now.view.map_id = loaded.view.map_id;
  now.trajectory = loaded.trajectory;
  now.metadata = loaded.metadata;
  expect_equal(loaded, now);
  const fs::path copy = folder_ / "copy.stillmap";
  open_map_file(file_)->copy_to(copy);
  EXPECT_EQ(read_map_sessions(copy).size(), 2U);
}

TEST_F(MapSessionsTest, FilesThatAreNoMapsAreNamed) {
  for (const fs::path& file : {folder_ / "none.stillmap", folder_.file("text.stillmap", "a map")}) {
    EXPECT_THAT([&] { static_cast<void>(read_map_sessions(file)); },
                ThrowsMessage<MapFileError>(HasSubstr(file.filename().string())));
    EXPECT_THAT([&] { withdraw_newest_session(file, folder_ / "out.stillmap"); },
                ThrowsMessage<MapFileError>(HasSubstr(file.filename().string())));
  }
}

TEST_F(MapSessionsTest, DamagedRowsAreAnErrorOrNone) {
  add_session("tuesday", 9, 1.0F);
  SQLite::Database(file_.string(), SQLite::OPEN_READWRITE)
      .exec("UPDATE sessions SET first_pose = -4, poses = 9223372036854775807 WHERE number = 2");
  EXPECT_EQ(read_map_sessions(file_).size(), 1U);
  SQLite::Database(file_.string(), SQLite::OPEN_READWRITE)
      .exec("DROP TABLE sessions; CREATE TABLE sessions (other INTEGER)");
  EXPECT_THAT([&] { static_cast<void>(read_map_sessions(file_)); },
              ThrowsMessage<MapFileError>(HasSubstr("sessions cannot be read")));
}

TEST_F(MapSessionsTest, ACheckLooksAtWhatAWithdrawalWouldBringBack) {
  add_session("tuesday", 8, 10.0F);
  EXPECT_TRUE(check_map_file(file_).is_sound());
  for (const char* column : {"encoded", "evidence"}) {
    SQLite::Database database(file_.string(), SQLite::OPEN_READWRITE);
    database.exec("CREATE TABLE kept AS SELECT * FROM session_tiles");
    database.exec(std::string("UPDATE session_tiles SET ") + column + " = x'0102' WHERE " + column +
                  " IS NOT NULL");
    const MapCheck check = check_map_file(file_);
    ASSERT_FALSE(check.faults.empty()) << column;
    EXPECT_THAT(check.faults.front().what, HasSubstr("before the newest session"));
    database.exec("DELETE FROM session_tiles");
    database.exec("INSERT INTO session_tiles SELECT * FROM kept");
    database.exec("DROP TABLE kept");
  }
  EXPECT_TRUE(check_map_file(file_).is_sound());
}

}  // namespace
}  // namespace stillmap
