#include "core/map/storage/map_sessions.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "core/map/static_map.hpp"
#include "core/map/tools/map_check.hpp"
#include "core/map/tools/map_info.hpp"
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

  /// The map with one more landmark 5 m above the street, and `poses` of its path.
  [[nodiscard]] SavedMap state_with(std::uint64_t map_id, std::size_t poses, float x_m) {
    LabelledScan landmark;
    for (int i = 0; i < 3; ++i) test::add_point(landmark, {x_m, 0.0F, 5.0F}, SemanticClass::pole);
    map_.insert(landmark, Eigen::Isometry3d::Identity());
    const MapCheckpoint checkpoint = map_.checkpoint();
    SavedMap state = to_saved_map(checkpoint);
    map_.checkpoint_stored(checkpoint.step);
    state.view.map_id = map_id;
    state.trajectory = path_of(poses);
    state.metadata = {{"sensor", "two"}};
    return state;
  }
  /// One more session.
  void add_session(const std::string& source, std::size_t poses, float x_m) {
    SavedMap after = state_with(100 + poses, poses, x_m);
    after.metadata = {{"sensor", source}};
    after.is_partial = true;
    add_map_session(file_, after, {.source = source, .clock_offset_ns = 3, .closures = 4});
  }
  /// A server's run in the file, with a save for each landmark, and two poses more with each.
  void run_server(std::uint64_t map_id, std::size_t withdrawable, std::vector<float> landmarks_x) {
    const auto store = open_map_file(file_);
    std::size_t poses = store->load().trajectory.size();
    store->begin_run(map_id,
                     {.source = "server " + std::to_string(map_id), .withdrawable = withdrawable});
    for (const float x_m : landmarks_x) store->save(state_with(map_id, poses += 2, x_m));
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
              ThrowsMessage<MapFileError>(HasSubstr("mapped on in since session 2")));
}

TEST_F(MapSessionsTest, ARunOfAServerIsOneWithAllItsSaves) {
  const std::string before = rows_of(file_);
  run_server(21, 2, {1.0F, 2.0F, 30.0F});
  auto sessions = read_map_sessions(file_);
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_EQ(sessions[0].source, "monday");
  EXPECT_EQ(sessions[1].source, "server 21");
  EXPECT_EQ(sessions[1].first_pose, 5U);
  EXPECT_EQ(sessions[1].poses, 6U);
  EXPECT_NEAR(sessions[1].way_m, 10.0, 1e-9);
  EXPECT_EQ(sessions[1].last_stamp_ns, 10'000'000'000);
  EXPECT_TRUE(check_map_file(file_).is_sound());
  const std::string after_first_run = rows_of(file_);

  run_server(22, 2, {3.0F});
  const fs::path one_run = folder_ / "one_run.stillmap", none = folder_ / "none.stillmap";
  withdraw_newest_session(file_, one_run);
  EXPECT_EQ(rows_of(one_run), after_first_run);
  withdraw_newest_session(one_run, none);
  EXPECT_EQ(rows_of(none), before);
  EXPECT_EQ(read_map_sessions(none).size(), 1U);
}

TEST_F(MapSessionsTest, AsManyAsAreAskedForCanBeWithdrawn) {
  run_server(21, 1, {1.0F});
  const std::string after_first_run = rows_of(file_);
  const auto kept_of = [&](int session) {
    SQLite::Database database(file_.string(), SQLite::OPEN_READONLY);
    return database
        .execAndGet("SELECT count(*) FROM session_tiles WHERE session = " + std::to_string(session))
        .getInt();
  };
  EXPECT_GT(kept_of(2), 0);
  run_server(22, 1, {2.0F});
  EXPECT_EQ(kept_of(2), 0);
  EXPECT_GT(kept_of(3), 0);
  ASSERT_EQ(read_map_sessions(file_).size(), 3U) << "all are listed";
  const fs::path without_third = folder_ / "two.stillmap";
  withdraw_newest_session(file_, without_third);
  EXPECT_EQ(rows_of(without_third), after_first_run);
  EXPECT_THAT([&] { withdraw_newest_session(without_third, folder_ / "one.stillmap"); },
              ThrowsMessage<MapFileError>(HasSubstr("does not keep any more")));
  EXPECT_FALSE(fs::exists(folder_ / "one.stillmap"));
}

TEST_F(MapSessionsTest, ARunThatChangesNothingIsNone) {
  const std::string before = rows_of(file_);
  run_server(21, 1, {1.0F});
  for (std::uint64_t map_id = 22; map_id < 25; ++map_id) {
    const auto store = open_map_file(file_);
    SavedMap same = store->load();
    store->begin_run(map_id, {.source = "idle", .withdrawable = 1});
    same.view.map_id = map_id;
    same.tile_evidence.clear();
    same.is_partial = true;
    store->save(same);
  }
  EXPECT_EQ(read_map_sessions(file_).size(), 2U);
  const fs::path out = folder_ / "out.stillmap";
  withdraw_newest_session(file_, out);
  EXPECT_EQ(rows_of(out), before);
}

TEST_F(MapSessionsTest, ARunWithoutSessionsIsAddedToTheOneBefore) {
  run_server(21, 1, {1.0F});
  run_server(22, 0, {2.0F});
  EXPECT_EQ(read_map_sessions(file_).size(), 2U);
  EXPECT_THAT([&] { withdraw_newest_session(file_, folder_ / "out.stillmap"); },
              ThrowsMessage<MapFileError>(HasSubstr("mapped on in")));
}

TEST_F(MapSessionsTest, TablesThatAreDamagedCostNoMapButTheSession) {
  std::size_t poses = 5;
  for (const char* table : {"session_tiles", "sessions"}) {
    SQLite::Database(file_.string(), SQLite::OPEN_READWRITE)
        .exec(std::string("DROP TABLE IF EXISTS ") + table + "; CREATE TABLE " + table +
              " (other INTEGER)");
    run_server(21, 2, {1.0F, 2.0F});
    EXPECT_EQ(open_map_file(file_)->load().trajectory.size(), poses += 4) << table;
  }
  EXPECT_THROW(add_session("tuesday", 20, 3.0F), MapFileError) << "that is to be withdrawn";
  EXPECT_EQ(open_map_file(file_)->load().trajectory.size(), poses);
}

TEST_F(MapSessionsTest, WhatIsRestoredBeforeTheFirstScanIsWithdrawn) {
  const std::string before = rows_of(file_);
  {
    const auto store = open_map_file(file_);
    static_cast<void>(store->load());
    store->begin_run(21, {.source = "server", .withdrawable = 2});
    store->save(state_with(21, 5, 1.0F));
  }
  const auto sessions = read_map_sessions(file_);
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_EQ(sessions[1].poses, 0U);
  const fs::path out = folder_ / "out.stillmap";
  withdraw_newest_session(file_, out);
  EXPECT_EQ(rows_of(out), before);
}

TEST_F(MapSessionsTest, ASaveThatFailedIsMadeUpForByTheNext) {
  const std::string before = rows_of(file_);
  {
    const auto store = open_map_file(file_);
    static_cast<void>(store->load());
    store->begin_run(21, {.source = "server", .withdrawable = 2});
    const auto fail = [&](const char* sql) {
      SQLite::Database(file_.string(), SQLite::OPEN_READWRITE).exec(sql);
    };
    fail("CREATE TRIGGER full BEFORE INSERT ON trajectory BEGIN SELECT RAISE(ABORT, 'full'); END");
    SavedMap first = state_with(21, 7, 1.0F);
    EXPECT_THROW(store->save(first), MapFileWriteError);
    fail("DROP TRIGGER full");
    store->save(first);
    store->save(state_with(21, 9, 2.0F));
  }
  ASSERT_EQ(read_map_sessions(file_).size(), 2U);
  EXPECT_EQ(read_map_sessions(file_)[1].poses, 4U);
  const fs::path out = folder_ / "out.stillmap";
  withdraw_newest_session(file_, out);
  EXPECT_EQ(rows_of(out), before);
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
  for (const char* fault : {"encoded = x'0102' WHERE encoded IS NOT NULL",
                            "evidence = x'0102' WHERE evidence IS NOT NULL",
                            "min_x = min_x + 15 WHERE encoded IS NOT NULL"}) {
    SQLite::Database database(file_.string(), SQLite::OPEN_READWRITE);
    database.exec("CREATE TABLE kept AS SELECT * FROM session_tiles");
    database.exec(std::string("UPDATE session_tiles SET ") + fault);
    const MapCheck check = check_map_file(file_);
    ASSERT_FALSE(check.faults.empty()) << fault;
    EXPECT_THAT(check.faults.front().what, HasSubstr("before a session"));
    database.exec("DELETE FROM session_tiles");
    database.exec("INSERT INTO session_tiles SELECT * FROM kept");
    database.exec("DROP TABLE kept");
  }
  EXPECT_TRUE(check_map_file(file_).is_sound());
}

TEST_F(MapSessionsTest, TheOnlyOneIsWithdrawnWhereTheMapHadTilesAndNoPath) {
  SavedMap pathless = open_map_file(file_)->load();
  pathless.trajectory = {};
  pathless.view.map_id = 8;
  file_ = folder_ / "pathless.stillmap";
  open_map_file(file_)->save(pathless);
  EXPECT_THAT([&] { withdraw_newest_session(file_, folder_ / "out.stillmap"); },
              ThrowsMessage<MapFileError>(HasSubstr("one session alone")));
  const std::string before = rows_of(file_);
  add_session("tuesday", 9, 1.0F);
  ASSERT_EQ(read_map_sessions(file_).size(), 1U);
  withdraw_newest_session(file_, folder_ / "out.stillmap");
  EXPECT_EQ(rows_of(folder_ / "out.stillmap"), before);
}

TEST_F(MapSessionsTest, WhatBeganAnEmptyFileIsNotWithdrawn) {
  file_ = folder_ / "server.stillmap";
  open_map_file(file_)->save(SavedMap{});
  map_.reset(9);
  run_server(9, 5, {1.0F, 5.0F});
  ASSERT_EQ(read_map_sessions(file_).size(), 1U);
  EXPECT_THAT([&] { withdraw_newest_session(file_, folder_ / "out.stillmap"); },
              ThrowsMessage<MapFileError>(HasSubstr("one session alone")));
}

TEST_F(MapSessionsTest, NobodyDroveFromTheEndOfOneToTheBeginningOfTheNext) {
  add_session("tuesday", 9, 1.0F);
  // Poses 2 m apart, 8 steps of which one lies between the sessions.
  EXPECT_NEAR(map_file_info(file_).map.path_length_m, 14.0, 1e-9);
}

TEST_F(MapSessionsTest, AreWithdrawnFromAFileWhateverItsName) {
  add_session("tuesday", 9, 1.0F);
  for (const char* name : {"out.stillmap.new", "out.stillmap.new-journal"}) {
    const fs::path file = folder_ / name, out = folder_ / "out.stillmap";
    fs::copy_file(file_, file);
    withdraw_newest_session(file, out);
    ASSERT_TRUE(fs::exists(file)) << name;
    EXPECT_EQ(bytes_of(file), bytes_of(file_)) << name;
    EXPECT_EQ(read_map_sessions(out).size(), 1U) << name;
  }
}

}  // namespace
}  // namespace stillmap
