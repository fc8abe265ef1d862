#include "server/mapping/map_saver.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "core/map/static_map.hpp"
#include "server/monitoring/metrics.hpp"
#include "tests/scratch_folder.hpp"
#include "tests/server/latest_map_source.hpp"
#include "tests/server/manual_clock.hpp"

namespace stillmap::server {
namespace {

LabelledScan scan_of(float x) {
  LabelledScan labelled;
  labelled.scan.points_lidar.assign(5, Eigen::Vector3f(x, 1.0F, 1.0F));
  labelled.motion.assign(5, Motion::stationary);
  return labelled;
}

class MapSaverTest : public testing::Test {
 protected:
  MapSaverTest() { latest_map_.begin(map_.view(), {}); }

  /// As the mapper's thread does with a scan.
  void map_scan(float x) {
    map_.insert(scan_of(x), Eigen::Isometry3d::Identity());
    latest_map_.publish(map_.view());
    latest_map_.add_pose({.stamp_ns = static_cast<std::int64_t>(x)}, OdometryHealth::good, "none");
  }

  /// As a server takes over a stored map.
  MapSaver::PrepareMap prepare_ = [this](const SavedMap& stored, const auto&) {
    return [this, stored] {
      latest_map_.begin(std::make_shared<const MapSnapshot>(stored.view), stored.trajectory);
    };
  };
  MapSaver::BeginMap begin_ = [this](std::uint64_t map_id, const auto&) {
    map_.reset(map_id);
    latest_map_.begin(map_.view(), {});
  };

  ScratchFolder folder_;
  StaticMap map_{StaticMapConfig()};
  LatestMap latest_map_;
  test::LatestMapSource source_{latest_map_};
  Statistics statistics_;
};

TEST_F(MapSaverTest, SavesTheLatestMap) {
  MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {{"sensor", "vlp_16"}});
  saver.set_source(source_);
  for (const float x : {5.0F, 50.0F}) {
    map_scan(x);
    saver.save_if_changed();
  }
  const SavedMap stored = open_map_file(folder_ / "map.stillmap")->load();
  EXPECT_EQ(stored.view.version, map_.view()->version);
  EXPECT_EQ(stored.view.tiles.size(), 2U);
  EXPECT_EQ(stored.trajectory.size(), 2U);
  EXPECT_EQ(stored.metadata.at("sensor"), "vlp_16");
}

TEST_F(MapSaverTest, AMapThatIsRefusedKeepsItsFileAsItIs) {
  map_.reset(77);
  latest_map_.begin(map_.view(), {});
  map_scan(5.0F);
  {
    MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
    saver.set_source(source_);
    saver.save_at_end();
  }
  const std::uint64_t map_id = open_map_file(folder_ / "map.stillmap")->load().view.map_id;
  {
    MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
    const auto refuse = [](const MapSnapshot&) { throw std::invalid_argument("other voxels"); };
    EXPECT_THROW(static_cast<void>(saver.load(refuse)), std::invalid_argument);
  }
  const SavedMap kept = open_map_file(folder_ / "map.stillmap")->load();
  EXPECT_EQ(kept.view.map_id, map_id);
  EXPECT_TRUE(kept.metadata.contains(map_ended_key)) << "it still says how its last run ended";
}

TEST_F(MapSaverTest, ABackupThatIsCopiedBackIsAnotherMap) {
  const auto file = folder_ / "map.stillmap";
  map_.reset(77);
  latest_map_.begin(map_.view(), {});
  map_scan(5.0F);
  {
    MapSaver saver(latest_map_, statistics_, file, {});
    saver.set_source(source_);
    saver.save_at_end();
  }
  const auto backup = folder_ / "backup.stillmap";
  std::filesystem::copy_file(file, backup);
  // As a server that starts: versions follow those of the backup, and clients see them.
  const auto id_of_run = [&] {
    MapSaver saver(latest_map_, statistics_, file, {});
    const SavedMap stored = saver.load().value();
    return stored.view.map_id;
  };
  const std::uint64_t first = id_of_run();
  std::filesystem::copy_file(backup, file, std::filesystem::copy_options::overwrite_existing);
  ASSERT_TRUE(open_map_file(file)->load().metadata.contains(map_ended_key));
  // They follow them once more, with other content.
  EXPECT_NE(id_of_run(), first);
}

TEST_F(MapSaverTest, LeavesTheFileAloneUntilSomethingWasMapped) {
  map_scan(5.0F);
  {
    MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
    saver.set_source(source_);
    saver.save_as("");
  }
  LatestMap empty;
  empty.begin(StaticMap(StaticMapConfig()).view(), {});
  MapSaver saver(empty, statistics_, folder_ / "map.stillmap", {});
  saver.save_if_changed();
  EXPECT_EQ(saver.load()->view.tiles.size(), 1U);
}

TEST_F(MapSaverTest, SavesUnderAnotherNameBesideTheConfiguredFile) {
  map_scan(5.0F);
  MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
  saver.set_source(source_);
  EXPECT_EQ(saver.save_as("copy.stillmap"), folder_ / "copy.stillmap");
  EXPECT_EQ(open_map_file(folder_ / "copy.stillmap")->load().view.tiles.size(), 1U);
  EXPECT_EQ(saver.save_as(""), folder_ / "map.stillmap");
}

TEST_F(MapSaverTest, RefusesNamesInOtherFolders) {
  MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
  saver.set_source(source_);
  for (const char* name : {"../map", "/etc/passwd", "a/b", ".", ".."}) {
    EXPECT_THROW(saver.save_as(name), std::invalid_argument) << name;
  }
}

/// A map of one other voxel, saved as `file`.
void save_far_map(const std::filesystem::path& file) {
  StaticMap other{StaticMapConfig()};
  other.insert(scan_of(50.0F), Eigen::Isometry3d::Identity());
  SavedMap stored{
      .view = *other.view(), .tile_evidence = {}, .trajectory = {StampedPose{}}, .metadata = {}};
  stored.metadata = {{"sensor", "another"}, {"datum", "48,11"}};
  open_map_file(file)->save(stored);
}

TEST_F(MapSaverTest, GoesOnInAnotherFileAndLeavesTheRunningMapInItsOwn) {
  map_scan(5.0F);
  save_far_map(folder_ / "far.stillmap");
  MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap",
                 {{"sensor", "vlp_16"}, {"datum", "1,2"}});
  saver.set_source(source_);
  const auto file = saver.resume_from("far.stillmap", prepare_);
  EXPECT_EQ(file, folder_ / "far.stillmap");
  latest_map_.add_pose({.stamp_ns = 1}, OdometryHealth::good, "none");
  saver.save_if_changed();
  const SavedMap own = open_map_file(folder_ / "map.stillmap")->load();
  EXPECT_EQ(own.view.tiles[0]->info.id.x, 0);
  const SavedMap far = open_map_file(folder_ / "far.stillmap")->load();
  EXPECT_EQ(far.trajectory.size(), 2U);
  EXPECT_EQ(far.metadata.at("sensor"), "vlp_16");
  EXPECT_EQ(own.metadata.at("datum"), "1,2");
  EXPECT_EQ(far.metadata.at("datum"), "48,11") << "a map stays where it is";
}

TEST_F(MapSaverTest, StaysInItsFileWhenAnotherCannotBeLoaded) {
  map_scan(5.0F);
  save_far_map(folder_ / "far.stillmap");
  MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
  saver.set_source(source_);
  const auto refuse = [](const SavedMap&,
                         const std::shared_ptr<TileStore>&) -> std::function<void()> {
    throw std::invalid_argument("another voxel size");
  };
  EXPECT_THROW(saver.resume_from("far.stillmap", refuse), std::invalid_argument);
  std::ofstream(folder_ / "text") << "no database";
  std::ofstream(folder_ / "empty");
  std::filesystem::create_directory(folder_ / "folder");
  for (const char* name : {"text", "empty", "folder", "missing"}) {
    EXPECT_THROW(saver.resume_from(name, refuse), MapFileError) << name;
  }
  EXPECT_EQ(std::filesystem::file_size(folder_ / "empty"), 0U);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "missing"));
  EXPECT_THROW(saver.resume_from("../map", refuse), std::invalid_argument);
  EXPECT_EQ(saver.save_as(""), folder_ / "map.stillmap");
}

TEST_F(MapSaverTest, CountsAndTimesSaves) {
  MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
  saver.set_source(source_);
  Metrics& metrics = statistics_.metrics();
  EXPECT_EQ(metrics.last_checkpoint.Value(), 0.0);
  map_scan(5.0F);
  saver.save_if_changed();
  saver.save_if_changed();
  EXPECT_EQ(metrics.checkpoint_durations.Collect().histogram.sample_count, 1U);
  EXPECT_GT(metrics.last_checkpoint.Value(), 1.6e9);
  EXPECT_EQ(metrics.checkpoint_failures.Value(), 0.0);
}

TEST_F(MapSaverTest, CountsSavesThatFail) {
  class FailingSource : public test::LatestMapSource {
   public:
    using LatestMapSource::LatestMapSource;
    void checkpoint_stored(std::uint64_t) override { throw MapFileError("map", "no space left"); }
  };
  FailingSource source(latest_map_);
  MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
  saver.set_source(source);
  map_scan(5.0F);
  EXPECT_THROW(saver.save_if_changed(), MapFileError);
  EXPECT_EQ(statistics_.metrics().checkpoint_failures.Value(), 1.0);
  EXPECT_EQ(statistics_.metrics().last_checkpoint.Value(), 0.0);
}

TEST_F(MapSaverTest, NeedsAFileToSaveTo) {
  MapSaver saver(latest_map_, statistics_, {}, {});
  saver.set_source(source_);
  EXPECT_FALSE(saver.load());
  EXPECT_NO_THROW(saver.save_if_changed());
  EXPECT_THROW(saver.save_as(""), RefusedNow);
}

TEST_F(MapSaverTest, NamesOfOtherFilesAreRefused) {
  map_scan(5.0F);
  MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
  saver.set_source(source_);
  // With a NUL inside, two names mean one file.
  const std::string cut_off("map.stillmap\0.other", 19);
  for (const std::string& name :
       {std::string("../other.stillmap"), std::string("map.stillmap-wal"),
        std::string("map.stillmap-shm"), std::string("map.stillmap-journal"), cut_off}) {
    EXPECT_THROW(saver.save_as(name), std::invalid_argument) << name;
  }
  map_scan(50.0F);
  saver.save_if_changed();
  EXPECT_EQ(open_map_file(folder_ / "map.stillmap")->load().view.tiles.size(), 2U);
}

TEST_F(MapSaverTest, SavesWhatChangedBeforeTheFirstScan) {
  map_scan(5.0F);
  {
    MapSaver saver(latest_map_, statistics_, folder_ / "map.stillmap", {});
    saver.set_source(source_);
    saver.save_as("");
  }
  LatestMap resumed;
  test::LatestMapSource source(resumed);
  MapSaver saver(resumed, statistics_, folder_ / "map.stillmap", {});
  saver.set_source(source);
  const SavedMap stored = *saver.load();
  map_.reset(stored.view.map_id);
  map_.resume(stored.view, stored.tile_evidence);
  resumed.begin(map_.view(), stored.trajectory);
  // As removed voxels that an operator restores.
  map_.insert(scan_of(50.0F), Eigen::Isometry3d::Identity());
  resumed.publish(map_.view());
  EXPECT_EQ(resumed.poses_added(), 0U);
  saver.save_as("");
  EXPECT_EQ(open_map_file(folder_ / "map.stillmap")->load().view.tiles.size(), 2U);
}

/// A map whose tiles are stored as the mapping thread has them stored.
class StaticMapSource : public CheckpointSource {
 public:
  StaticMapSource(StaticMap& map, LatestMap& latest_map) : map_(map), latest_map_(latest_map) {}
  [[nodiscard]] RunCheckpoint checkpoint(CheckpointScope scope) override {
    const MapCheckpoint checkpoint = map_.checkpoint(scope);
    latest_map_.publish(checkpoint.view);
    RunCheckpoint run{to_saved_map(checkpoint), checkpoint.step};
    run.map.trajectory = latest_map_.trajectory();
    return run;
  }
  void checkpoint_stored(std::uint64_t step) override { map_.checkpoint_stored(step); }
  void checkpoint_failed() override {}
  [[nodiscard]] MemoryUse memory_use() override {
    return use_bytes_ > 0 ? MemoryUse{.bytes = use_bytes_} : map_.memory_use();
  }
  /// Says from now on that the map takes so much.
  void use(std::size_t bytes) { use_bytes_ = bytes; }

 private:
  std::size_t use_bytes_ = 0;
  StaticMap& map_;
  LatestMap& latest_map_;
};

/// A robot that stands, and its map file.
class StandingRobot : public MapSaverTest {
 protected:
  static constexpr std::uint32_t mib_per_hour = 1;
  static constexpr std::uint32_t paged_limit_mib = 512;

  StandingRobot() { saver_.set_source(static_source_); }

  /// A scan of a wall of 0.2 m voxels, this many of them, and a save.
  void scan_and_save(int voxels, double robot_x_m = 0.0) {
    LabelledScan labelled;
    for (int i = 0; i < 2 * voxels; ++i) {
      const float along = 0.1F + 0.2F * static_cast<float>(i / 2);
      labelled.scan.points_lidar.emplace_back(5.0F, along, 1.0F);
    }
    labelled.motion.assign(labelled.scan.points_lidar.size(), Motion::stationary);
    map_.insert(labelled, Eigen::Isometry3d::Identity());
    latest_map_.publish(map_.view());
    latest_map_.add_pose(
        {++stamp_ns_, Eigen::Isometry3d(Eigen::Translation3d(robot_x_m, 0.0, 0.0))},
        OdometryHealth::good, "none");
    saver_.save_if_changed();
  }
  [[nodiscard]] SavedMap stored() { return open_map_file(file_)->load(); }
  /// Until nothing more is written of it.
  void stand() {
    std::size_t poses = 0;
    do {
      poses = stored().trajectory.size();
      for (int i = 0; i < 10; ++i) scan_and_save(20);
    } while (poses != stored().trajectory.size());
  }

  std::int64_t stamp_ns_ = 0;
  std::filesystem::path file_ = folder_ / "map.stillmap";
  test::ManualClock clock_;
  StaticMapSource static_source_{map_, latest_map_};
  MapSaver saver_{latest_map_,
                  statistics_,
                  file_,
                  {},
                  {.memory_limit_mib = paged_limit_mib,
                   .standing_mib_per_hour = mib_per_hour,
                   .session = {.source = "test", .withdrawable = 2}},
                  clock_};
};

TEST_F(StandingRobot, WritesNoMoreThanItsAllowance) {
  stand();
  const SavedMap quiet = stored();
  for (int i = 0; i < 50; ++i) scan_and_save(20);
  EXPECT_EQ(stored().trajectory.size(), quiet.trajectory.size());
  EXPECT_EQ(stored().view.tiles[0]->voxels[0].point_count,
            quiet.view.tiles[0]->voxels[0].point_count);
  clock_.advance(std::chrono::hours(1));
  scan_and_save(20);
  EXPECT_GT(stored().trajectory.size(), quiet.trajectory.size() + 50);
}

TEST_F(StandingRobot, KeepsToItsAllowanceWithAMapThatIsLargerThanItsMemory) {
  // Eviction keeps such a map between these shares of the limit.
  const std::size_t limit_bytes = std::size_t{paged_limit_mib} << 20;
  for (const double share : {0.57, 0.65}) {
    static_source_.use(static_cast<std::size_t>(share * static_cast<double>(limit_bytes)));
    stand();
    const std::size_t quiet = stored().trajectory.size();
    for (int i = 0; i < 50; ++i) scan_and_save(20);
    EXPECT_EQ(stored().trajectory.size(), quiet) << share;
  }
  // What is not stored is in eviction's way.
  static_source_.use(limit_bytes * 7 / 10);
  scan_and_save(20);
  EXPECT_EQ(stored().trajectory.size(), latest_map_.trajectory().size());
}

TEST_F(StandingRobot, StoresAtOnceWhatItSeesAppear) {
  stand();
  scan_and_save(22);
  EXPECT_EQ(stored().view.tiles.voxel_count(), 20U) << "two voxels wait";
  scan_and_save(60);
  EXPECT_EQ(stored().view.tiles.voxel_count(), 60U);
}

TEST_F(StandingRobot, StoresEverythingWhenItsMapWasCorrected) {
  stand();
  scan_and_save(22);
  ASSERT_EQ(stored().view.tiles.voxel_count(), 20U);
  const MapCorrection nothing_moves({{0, Eigen::Vector3d::Zero(), Eigen::Isometry3d::Identity()}});
  latest_map_.correct(nothing_moves, map_.view());
  saver_.save_if_changed();
  EXPECT_EQ(stored().view.tiles.voxel_count(), 22U);
  EXPECT_EQ(stored().trajectory.size(), latest_map_.trajectory().size());
  scan_and_save(24);
  EXPECT_EQ(stored().view.tiles.voxel_count(), 22U) << "and goes on as before";
}

TEST_F(StandingRobot, StoresEverythingWhenItMovesOnAndAtTheEnd) {
  stand();
  scan_and_save(22);
  scan_and_save(22, 0.4);
  EXPECT_EQ(stored().view.tiles.voxel_count(), 20U);
  scan_and_save(22, 0.7);
  EXPECT_EQ(stored().view.tiles.voxel_count(), 22U);
  EXPECT_EQ(stored().trajectory.size(), latest_map_.trajectory().size());
  stand();
  scan_and_save(24, 0.7);
  saver_.save_at_end();
  EXPECT_EQ(stored().view.tiles.voxel_count(), 24U);
  EXPECT_EQ(stored().trajectory.size(), latest_map_.trajectory().size());
}

}  // namespace
}  // namespace stillmap::server
