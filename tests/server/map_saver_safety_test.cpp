// What must never happen to a map file: another map's content, a name that leads elsewhere, a
// failure half-way, two writers.

#include <gmock/gmock.h>
#include <sqlite3.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "core/map/map_id.hpp"
#include "core/map/static_map.hpp"
#include "server/mapping/map_saver.hpp"
#include "tests/map/short_lock_patience.hpp"
#include "tests/scratch_folder.hpp"
#include "tests/server/latest_map_source.hpp"

namespace stillmap::server {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

LabelledScan scan_of_voxel(float x) {
  LabelledScan labelled;
  labelled.scan.points_lidar.assign(5, Eigen::Vector3f(x, 1.0F, 1.0F));
  labelled.motion.assign(5, Motion::stationary);
  return labelled;
}

/// What was wrong, in words.
template <typename Action>
std::string why_refused(Action action) {
  try {
    action();
  } catch (const std::exception& error) {
    return error.what();
  }
  ADD_FAILURE() << "was not refused";
  return {};
}

class MapSaverSafetyTest : public testing::Test {
 protected:
  MapSaverSafetyTest() {
    map_.reset(new_map_id());
    latest_map_.begin(map_.view(), {});
  }

  void map_scan(float x) {
    map_.insert(scan_of_voxel(x), Eigen::Isometry3d::Identity());
    latest_map_.publish(map_.view());
    latest_map_.add_pose({.stamp_ns = static_cast<std::int64_t>(x)}, OdometryHealth::good, "none");
  }
  [[nodiscard]] MapSaver saver(const SavedMapsLimit& limit = {}) {
    return {latest_map_,
            statistics_,
            file_,
            {{"sensor", "vlp_16"}},
            {.saved_maps = limit, .session = {.source = "test", .withdrawable = 2}}};
  }
  /// A map of one voxel 50 m away, as `name` in the folder.
  void save_far_map(const std::string& name) const {
    StaticMap other{StaticMapConfig()};
    other.reset(new_map_id());
    other.insert(scan_of_voxel(50.0F), Eigen::Isometry3d::Identity());
    open_map_file(folder_ / name)
        ->save({.view = *other.view(), .tile_evidence = {}, .trajectory = {{}}, .metadata = {}});
  }
  /// Tile column of the only tile in a map file; -1 without one.
  [[nodiscard]] static int tile_in(const fs::path& file) {
    const SavedMap map = open_map_file(file)->load();
    return map.view.tiles.size() == 1 ? map.view.tiles.front()->info.id.x : -1;
  }

  MapSaver::PrepareMap prepare_ = [this](const SavedMap& stored, const auto&) {
    return [this, stored] {
      map_.resume(stored.view, stored.tile_evidence);
      latest_map_.begin(map_.view(), stored.trajectory);
    };
  };
  MapSaver::BeginMap begin_ = [this](std::uint64_t map_id, const auto&) {
    map_.reset(map_id);
    latest_map_.begin(map_.view(), {});
  };

  ScratchFolder folder_;
  fs::path file_ = folder_ / "city.stillmap";
  StaticMap map_{StaticMapConfig()};
  LatestMap latest_map_;
  test::LatestMapSource source_{latest_map_};
  Statistics statistics_;
};

TEST_F(MapSaverSafetyTest, ALoadThatCannotBeWrittenChangesNothing) {
  const test::ShortLockPatience patience;
  MapSaver saver = this->saver();
  saver.set_source(source_);
  map_scan(5.0F);
  save_far_map("far.stillmap");
  const std::uint64_t running = latest_map_.view()->map_id;
  // Somebody else holds the write lock longer than SQLite waits.
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open((folder_ / "far.stillmap").c_str(), &other), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(other, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
  EXPECT_THAT(why_refused([&] { saver.resume_from("far.stillmap", prepare_); }),
              HasSubstr("locked"));
  sqlite3_close(other);
  EXPECT_EQ(latest_map_.view()->map_id, running);
  map_scan(6.0F);
  saver.save_if_changed();
  EXPECT_EQ(tile_in(file_), 0);
  EXPECT_EQ(tile_in(folder_ / "far.stillmap"), 2) << "its map is still its own";
}

TEST_F(MapSaverSafetyTest, ALoadWhoseRunningMapCannotBeSavedChangesNothing) {
  class FailingSource : public test::LatestMapSource {
   public:
    using LatestMapSource::LatestMapSource;
    RunCheckpoint checkpoint(CheckpointScope) override {
      throw MapFileError("city", "no space left");
    }
  };
  FailingSource source(latest_map_);
  MapSaver saver = this->saver();
  saver.set_source(source);
  map_scan(5.0F);
  save_far_map("far.stillmap");
  const std::uint64_t running = latest_map_.view()->map_id;
  const std::uint64_t stored = open_map_file(folder_ / "far.stillmap")->load().view.map_id;
  EXPECT_THAT(why_refused([&] { saver.resume_from("far.stillmap", prepare_); }),
              HasSubstr("space"));
  EXPECT_EQ(latest_map_.view()->map_id, running);
  EXPECT_EQ(open_map_file(folder_ / "far.stillmap")->load().view.map_id, stored);
}

TEST_F(MapSaverSafetyTest, AResetKeepsTheMapUntilThen) {
  MapSaver saver = this->saver();
  saver.set_source(source_);
  map_scan(5.0F);
  const NewMap begun = saver.begin_anew(false, begin_);
  EXPECT_EQ(latest_map_.view()->map_id, begun.map_id);
  saver.save_if_changed();
  ASSERT_TRUE(fs::exists(begun.kept_file));
  EXPECT_EQ(begun.kept_file.parent_path(), file_.parent_path());
  EXPECT_EQ(tile_in(begun.kept_file), 0) << "what was mapped since the last save, too";
  map_scan(50.0F);
  saver.save_if_changed();
  EXPECT_EQ(tile_in(file_), 2);
  EXPECT_EQ(tile_in(begun.kept_file), 0);
  // And back.
  saver.resume_from(begun.kept_file.filename().string(), prepare_);
  EXPECT_EQ(latest_map_.view()->tiles[0]->info.id.x, 0);
  EXPECT_EQ(tile_in(file_), 2);
}

TEST_F(MapSaverSafetyTest, AResetThatDiscardsKeepsNothing) {
  MapSaver saver = this->saver();
  saver.set_source(source_);
  map_scan(5.0F);
  saver.save_if_changed();
  EXPECT_TRUE(saver.begin_anew(true, begin_).kept_file.empty());
  EXPECT_EQ(tile_in(file_), -1);
  std::vector<std::string> maps;
  for (const auto& entry : fs::directory_iterator(folder_.path())) {
    if (is_map_file(entry.path())) maps.push_back(entry.path().filename());
  }
  EXPECT_THAT(maps, testing::ElementsAre("city.stillmap"));
}

TEST_F(MapSaverSafetyTest, AMapThatIsNotResumedIsKept) {
  save_far_map("city.stillmap");
  MapSaver saver = this->saver();
  saver.set_source(source_);
  const auto kept = saver.set_saved_map_aside();
  ASSERT_TRUE(kept);
  map_scan(5.0F);
  saver.save_if_changed();
  EXPECT_EQ(tile_in(*kept), 2);
  EXPECT_EQ(tile_in(file_), 0);
}

TEST_F(MapSaverSafetyTest, TheFileOfAnotherProcessIsRefusedAndItsHolderNamed) {
  MapSaver first = this->saver();
  const std::string why = why_refused([&] { static_cast<void>(this->saver()); });
  EXPECT_THAT(why, HasSubstr("in use by process " + std::to_string(getpid())));
  // And so is a load of it by a server of another file.
  LatestMap latest_map;
  latest_map.begin(map_.view(), {});
  MapSaver second(latest_map, statistics_, folder_ / "other.stillmap", {});
  EXPECT_THAT(why_refused([&] { second.resume_from("city.stillmap", prepare_); }),
              HasSubstr("in use"));
}

TEST_F(MapSaverSafetyTest, AFileHasOneLockWhateverItsNames) {
  save_far_map("real.stillmap");
  fs::create_symlink("real.stillmap", file_);
  MapSaver first = this->saver();
  first.set_source(source_);
  const auto expect_locked = [&](const char* name) {
    EXPECT_THAT(why_refused([&] {
                  const MapSaver second(latest_map_, statistics_, folder_ / name, {}, {});
                }),
                HasSubstr("in use by process"))
        << name;
  };
  expect_locked("real.stillmap");
  expect_locked("city.stillmap");
  map_scan(5.0F);
  first.begin_anew(false, begin_);
  map_scan(30.0F);
  first.save_if_changed();
  expect_locked("real.stillmap");
  expect_locked("city.stillmap");
  EXPECT_TRUE(fs::is_symlink(file_));
  EXPECT_EQ(tile_in(file_), 1);
}

TEST_F(MapSaverSafetyTest, TheLockOfTheDeadIsTakenOver) {
  std::ofstream(folder_ / "city.stillmap.lock") << "elsewhere 4711\n";
  MapSaver saver = this->saver();
  std::ifstream lock(folder_ / "city.stillmap.lock");
  std::string host;
  int pid = 0;
  lock >> host >> pid;
  EXPECT_EQ(pid, getpid());
}

TEST_F(MapSaverSafetyTest, AnEmptyMapIsNotSavedOverAFile) {
  save_far_map("city.stillmap");
  MapSaver saver = this->saver();
  saver.set_source(source_);
  EXPECT_THAT(why_refused([&] { saver.save_as(""); }), HasSubstr("no scan was mapped"));
  EXPECT_THAT(why_refused([&] { saver.save_as("new.stillmap"); }), HasSubstr("no scan was mapped"));
  EXPECT_EQ(tile_in(file_), 2);
  EXPECT_FALSE(fs::exists(folder_ / "new.stillmap"));
}

TEST_F(MapSaverSafetyTest, ACopyThatCannotBeMadeIsNoSuccess) {
  MapSaver saver = this->saver();
  saver.set_source(source_);
  map_scan(5.0F);
  // SQLite's name for what it has in memory.
  fs::create_directory(folder_ / "copy.stillmap-shm");
  std::ofstream(folder_ / "copy.stillmap-shm" / "in_the_way");
  EXPECT_THAT(why_refused([&] { saver.save_as("copy.stillmap"); }), HasSubstr("cannot be written"));
  EXPECT_FALSE(fs::exists(folder_ / "copy.stillmap"));
}

TEST_F(MapSaverSafetyTest, AnotherMapIsOverwrittenOnlyWhenAsked) {
  MapSaver saver = this->saver();
  saver.set_source(source_);
  map_scan(5.0F);
  save_far_map("far.stillmap");
  EXPECT_THAT(why_refused([&] { saver.save_as("far.stillmap"); }), HasSubstr("--overwrite"));
  EXPECT_EQ(tile_in(folder_ / "far.stillmap"), 2);
  saver.save_as("far.stillmap", true);
  EXPECT_EQ(tile_in(folder_ / "far.stillmap"), 0);
  std::ofstream(folder_ / "notes.txt") << "not a map";
  EXPECT_THAT(why_refused([&] { saver.save_as("notes.txt", true); }), HasSubstr("no map file"));
}

TEST_F(MapSaverSafetyTest, NamesMeanFilesInTheFolderAndNoOthers) {
  const fs::path here = fs::current_path();
  fs::create_directory(folder_ / "maps");
  fs::current_path(folder_ / "maps");
  file_ = "city.stillmap";
  MapSaver saver = this->saver();
  fs::current_path(here);
  saver.set_source(source_);
  map_scan(5.0F);
  const fs::path outside = folder_ / "outside.stillmap";
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open(outside.c_str(), &other), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(other, "CREATE TABLE theirs (x)", nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(other);
  std::string uri = "file:";
  for (const char c : outside.string()) uri += c == '/' ? std::string("%2F") : std::string(1, c);
  for (const std::string& name : {uri, uri + "?x=1", outside.string(), std::string("a/b"),
                                  std::string("a\\b"), std::string(".hidden"), std::string("-x"),
                                  std::string(" "), std::string("x.lock"), std::string(300, 'x')}) {
    EXPECT_THAT(why_refused([&] { saver.save_as(name); }), HasSubstr("plain name")) << name;
    EXPECT_THAT(why_refused([&] { saver.resume_from(name, prepare_); }), HasSubstr("plain name"));
  }
  fs::create_symlink(outside, folder_ / "maps" / "link.stillmap");
  EXPECT_THAT(why_refused([&] { saver.save_as("link.stillmap", true); }), HasSubstr("leads out"));
  EXPECT_EQ(saver.save_as("copy.stillmap"), folder_ / "maps" / "copy.stillmap");
}

TEST_F(MapSaverSafetyTest, SavedMapsHaveALimit) {
  MapSaver saver = this->saver({.max_maps = 2, .max_bytes = 1U << 30});
  saver.set_source(source_);
  map_scan(5.0F);
  saver.save_if_changed();
  ASSERT_TRUE(fs::exists(file_));
  // The running map by another name is not one more.
  fs::create_symlink(file_, folder_ / "current.stillmap");
  saver.save_as("one.stillmap");
  saver.save_as("two.stillmap");
  EXPECT_THAT(why_refused([&] { saver.save_as("three.stillmap"); }), HasSubstr("map.saved_maps"));
  EXPECT_FALSE(fs::exists(folder_ / "three.stillmap"));
  saver.save_as("two.stillmap", true);
  EXPECT_THAT(why_refused([&] { saver.begin_anew(false, begin_); }), HasSubstr("map.saved_maps"));
  EXPECT_EQ(latest_map_.view()->tiles.size(), 1U) << "the running map goes on";
  EXPECT_TRUE(saver.begin_anew(true, begin_).kept_file.empty());
}

TEST_F(MapSaverSafetyTest, FilesOfOthersBesideAMapStay) {
  const std::vector<std::string> names{"city.stillmap.new", "city.stillmap.empty",
                                       "before.stillmap.new"};
  for (const std::string& name : names) std::ofstream(folder_ / name) << "mine";
  {
    MapSaver saver = this->saver();
    saver.set_source(source_);
    map_scan(5.0F);
    saver.save_as("before.stillmap");
    saver.begin_anew(true, begin_);
  }
  for (const std::string& name : names) EXPECT_EQ(content_of(folder_ / name), "mine") << name;
  EXPECT_EQ(tile_in(folder_ / "before.stillmap"), 0);
  EXPECT_EQ(tile_in(file_), -1);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 5)
      << "these three and two maps";
}

TEST_F(MapSaverSafetyTest, SaysWhyANameIsNone) {
  MapSaver saver = this->saver();
  saver.set_source(source_);
  map_scan(5.0F);
  for (const auto& [name, why] : {std::pair(std::string("city.lock"), "ends in .lock"),
                                  std::pair(std::string(300, 'x'), "has 300 bytes"),
                                  std::pair(std::string("a:b"), "without any of")}) {
    EXPECT_THAT(why_refused([&] { saver.save_as(name); }), HasSubstr(why)) << name;
  }
}

TEST_F(MapSaverSafetyTest, AMapWithoutAFileIsNotLostByAReset) {
  MapSaver saver(latest_map_, statistics_, "", {});
  saver.set_source(source_);
  saver.begin_anew(false, begin_);
  map_scan(5.0F);
  EXPECT_THAT(why_refused([&] { saver.begin_anew(false, begin_); }), HasSubstr("save NAME"));
  EXPECT_EQ(latest_map_.view()->tiles.size(), 1U);
  saver.begin_anew(true, begin_);
  EXPECT_TRUE(latest_map_.view()->tiles.empty());
}

}  // namespace
}  // namespace stillmap::server
