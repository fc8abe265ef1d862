// The saver of a process that is killed, or stopped, at random moments while its disk fails and its
// map is saved, copied, reset and loaded: STILLMAP_KILLS rounds of each fault. What fault_test.cpp
// does to a whole server, many times as often. disk_faults.cpp is linked in.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <random>
#include <set>

#include "core/map/map_id.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "server/mapping/map_saver.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::server {
namespace {

namespace fs = std::filesystem;

int wanted_rounds() {
  const char* const text = std::getenv("STILLMAP_KILLS");
  return text == nullptr ? 3 : std::atoi(text);
}

volatile std::sig_atomic_t stop_requested = 0;

/// A mapper that adds a voxel and a pose a scan, with a saver: the process that is killed.
class SavingProcess : public CheckpointSource {
 public:
  SavingProcess(const fs::path& file, std::int64_t first_ns, int reports)
      : saver_(latest_map_, statistics_, file, {{"sensor", "test"}},
               {.memory_limit_mib = 64,
                .saved_maps = {.max_maps = 100'000, .max_bytes = std::uintmax_t{1} << 40},
                .session = {.source = "test", .withdrawable = 2}}),
        next_ns_(first_ns),
        reports_(reports),
        random_(std::random_device{}()) {
    auto stored = saver_.load();
    if (stored && !stored->view.tiles.empty()) {
      prepare(*stored, saver_.tile_store())();
    } else {
      begin(new_map_id(), saver_.tile_store());
    }
    saver_.set_source(*this);
  }

  [[noreturn]] void run() {
    while (stop_requested == 0) {
      map_scan();
      attempt([&] { saver_.save_if_changed(); });
      disturb();
    }
    attempt([&] { saver_.save_at_end(); });
    _exit(0);
  }

  RunCheckpoint checkpoint(CheckpointScope scope) override {
    const MapCheckpoint map = map_.checkpoint(scope);
    latest_map_.publish(map.view);
    RunCheckpoint checkpoint{to_saved_map(map), map.step};
    checkpoint.map.trajectory = latest_map_.trajectory();
    return checkpoint;
  }
  void checkpoint_stored(std::uint64_t step) override {
    map_.checkpoint_stored(step);
    // An empty map has no pose.
    const std::int64_t newest_ns = latest_map_.newest_pose().stamp_ns;
    if (newest_ns > 0) stored_ns_ = newest_ns;
  }
  void checkpoint_failed() override {}
  [[nodiscard]] MemoryUse memory_use() override { return map_.memory_use(); }

 private:
  void map_scan() {
    LabelledScan scan;
    scan.scan.stamp_ns = next_ns_++;
    const auto x = static_cast<float>(random_() % 3000) / 10.0F;
    scan.scan.points_lidar.assign(5, Eigen::Vector3f(x, 1.0F, 1.0F));
    scan.motion.assign(5, Motion::stationary);
    map_.insert(scan, Eigen::Translation3d(x, 0.0, 0.0) * Eigen::Isometry3d::Identity());
    latest_map_.publish(map_.view());
    latest_map_.add_pose({.stamp_ns = scan.scan.stamp_ns}, OdometryHealth::good, "none");
  }

  void disturb() {
    switch (random_() % 12) {
      case 0:
        return attempt([&] { saver_.save_as("copy", true); });
      case 1:
        return attempt([&] {
          saver_.begin_anew(false, [this](auto id, const auto& store) { begin(id, store); });
        });
      case 2:
        return attempt([&] {
          saver_.resume_from(
              "", [this](const auto& map, const auto& store) { return prepare(map, store); });
        });
      default:
        return;
    }
  }

  /// The disk may refuse it. What was stored before that is reported.
  template <typename Action>
  void attempt(Action action) {
    try {
      action();
    } catch (const std::exception&) {
      // Only what is on the disk in the end counts.
    }
    if (std::exchange(reported_ns_, stored_ns_) == stored_ns_) return;
    if (write(reports_, &stored_ns_, sizeof stored_ns_) != sizeof stored_ns_) _exit(2);
  }

  void begin(std::uint64_t map_id, const std::shared_ptr<TileStore>& store) {
    map_.use_tile_store(store);
    map_.reset(map_id);
    latest_map_.begin(map_.view(), {});
  }
  std::function<void()> prepare(const SavedMap& stored, const std::shared_ptr<TileStore>& store) {
    auto prepared = std::make_shared<StaticMap>(StaticMapConfig());
    prepared->resume(stored.view, stored.tile_evidence);
    prepared->use_tile_store(store);
    return [this, prepared, path = stored.trajectory] {
      map_ = std::move(*prepared);
      latest_map_.begin(map_.view(), path);
    };
  }

  LatestMap latest_map_;
  Statistics statistics_;
  StaticMap map_{StaticMapConfig()};
  MapSaver saver_;
  std::int64_t next_ns_;
  std::int64_t stored_ns_ = 0;
  std::int64_t reported_ns_ = 0;
  int reports_;
  std::mt19937 random_;
};

enum class Begins { anew, stored };

/// A saver with one voxel mapped, or what the file holds, for one test in this process.
class OneVoxel : public CheckpointSource {
 public:
  explicit OneVoxel(const fs::path& file, Begins begins = Begins::anew)
      : saver_(latest_map_, statistics_, file, {},
               {.memory_limit_mib = 64, .session = {.source = "test", .withdrawable = 2}}) {
    saver_.set_source(*this);
    if (begins == Begins::stored) {
      resume(*saver_.load(), saver_.tile_store());
      return;
    }
    begin(new_map_id(), saver_.tile_store());
    LabelledScan scan;
    scan.scan.points_lidar.assign(5, Eigen::Vector3f(1.0F, 1.0F, 1.0F));
    scan.motion.assign(5, Motion::stationary);
    map_.insert(scan, Eigen::Isometry3d::Identity());
    latest_map_.publish(map_.view());
    latest_map_.add_pose({.stamp_ns = 1}, OdometryHealth::good, "none");
  }
  [[nodiscard]] MapSaver& saver() { return saver_; }
  /// What its map reads tiles from.
  [[nodiscard]] TileStore& tiles() { return *tiles_; }

  void begin(std::uint64_t map_id, const std::shared_ptr<TileStore>& tiles) {
    tiles_ = tiles;
    map_.use_tile_store(tiles);
    map_.reset(map_id);
    latest_map_.begin(map_.view(), {});
  }
  void resume(const SavedMap& stored, const std::shared_ptr<TileStore>& tiles) {
    tiles_ = tiles;
    map_.resume(stored.view, stored.tile_evidence);
    map_.use_tile_store(tiles);
    latest_map_.begin(map_.view(), stored.trajectory);
  }
  void reset() {
    saver_.begin_anew(false, [&](auto map_id, const auto& tiles) { begin(map_id, tiles); });
  }

  RunCheckpoint checkpoint(CheckpointScope scope) override {
    const MapCheckpoint map = map_.checkpoint(scope);
    RunCheckpoint checkpoint{to_saved_map(map), map.step};
    checkpoint.map.trajectory = latest_map_.trajectory();
    return checkpoint;
  }
  void checkpoint_stored(std::uint64_t step) override { map_.checkpoint_stored(step); }
  void checkpoint_failed() override {}
  [[nodiscard]] MemoryUse memory_use() override { return {}; }

 private:
  LatestMap latest_map_;
  Statistics statistics_;
  StaticMap map_{StaticMapConfig()};
  std::shared_ptr<TileStore> tiles_;
  MapSaver saver_;
};

TEST(MapSaverBusy, ASaveThatReportsSuccessHasSaved) {
  const ScratchFolder folder;
  const fs::path target = folder / "copy.stillmap";
  open_map_file(target)->save(
      {.view = {}, .tile_evidence = {}, .trajectory = {{}}, .metadata = {}});
  // Another program writes there: SQLite is busy.
  SQLite::Database other(target.string(), SQLite::OPEN_READWRITE);
  other.exec("BEGIN IMMEDIATE");
  OneVoxel running(folder / "city.stillmap");
  bool is_reported = true;
  try {
    running.saver().save_as("copy.stillmap", true);
  } catch (const std::exception&) {
    is_reported = false;
  }
  other.exec("ROLLBACK");
  EXPECT_EQ(open_map_file(target)->load().view.tiles.size(), is_reported ? 1U : 0U);
}

struct SaverFault {
  const char* name;
  const char* disk;
  std::vector<int> signals;
};

void PrintTo(const SaverFault& fault, std::ostream* out) { *out << fault.name; }

/// A folder on a disk that fails when it is told to.
class FaultyDisk : public testing::Test {
 protected:
  FaultyDisk() {
    setenv("STILLMAP_FAULT", control_.c_str(), 1);
    setenv("STILLMAP_FAULT_FOLDER", folder_.path().c_str(), 1);
  }
  ~FaultyDisk() override {
    unsetenv("STILLMAP_FAULT");
    unsetenv("STILLMAP_FAULT_FOLDER");
  }

  void set_fault(const std::string& fault) const {
    const fs::path fresh = control_.string() + ".next";
    std::ofstream(fresh) << fault;
    fs::rename(fresh, control_);
  }

  ScratchFolder folder_;
  // Where the faults do not reach it.
  ScratchFolder control_folder_;
  fs::path control_ = control_folder_ / "fault";
  fs::path file_ = folder_ / "city.stillmap";
};

TEST_F(FaultyDisk, AResetThatFailsHalfWayLeavesOneWholeMap) {
  OneVoxel running(file_);
  running.saver().save_if_changed();
  set_fault("half_reset");
  EXPECT_THROW(running.reset(), MapFileError);
  EXPECT_FALSE(fs::exists(file_));
  EXPECT_THROW(running.saver().save_as("copy"), MapFileError);
  EXPECT_EQ(running.tiles().load({0, 0}).tile->voxels.size(), 1U);
  set_fault("");
  EXPECT_EQ(running.saver().save_as(""), file_);
  EXPECT_EQ(running.tiles().load({0, 0}).tile->voxels.size(), 1U);
  EXPECT_EQ(open_map_file(file_)->load().trajectory.size(), 1U);
  std::size_t maps = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_.path())) {
    maps += entry.path().extension() == ".stillmap" ? 1 : 0;
  }
  EXPECT_EQ(maps, 1U);
  running.reset();
  EXPECT_TRUE(open_map_file(file_)->load().trajectory.empty());
}

TEST_F(FaultyDisk, AResetThatFailsHalfWayLeavesTwoWholeMapsWhereAnotherIsLoaded) {
  OneVoxel(folder_ / "other.stillmap").saver().save_at_end();
  OneVoxel(file_).saver().save_at_end();
  OneVoxel running(file_, Begins::stored);
  set_fault("half_reset");
  EXPECT_THROW(running.reset(), MapFileError);
  const auto load_other = [&] {
    running.saver().resume_from("other.stillmap", [&](const auto& stored, const auto& tiles) {
      return [&running, stored, tiles] { running.resume(stored, tiles); };
    });
  };
  EXPECT_THROW(load_other(), MapFileError);
  set_fault("");
  load_other();
  running.saver().save_at_end();
  const SavedMap other = open_map_file(folder_ / "other.stillmap")->load();
  const SavedMap city = open_map_file(file_)->load();
  EXPECT_NE(other.view.map_id, city.view.map_id);
  EXPECT_EQ(other.view.tiles.size(), 1U);
  EXPECT_EQ(city.view.tiles.size(), 1U);
  EXPECT_EQ(city.trajectory.size(), 1U);
}

TEST_F(FaultyDisk, AResetThatFailsHalfWayIsUndoneAtTheEndWithoutAScan) {
  OneVoxel(file_).saver().save_at_end();
  {
    OneVoxel running(file_, Begins::stored);
    set_fault("half_reset");
    EXPECT_THROW(running.reset(), MapFileError);
    set_fault("");
    running.saver().save_at_end();
  }
  EXPECT_EQ(open_map_file(file_)->load().view.tiles.size(), 1U);
}

TEST_F(FaultyDisk, AFileThatCannotBeReadForAMomentIsNoOtherFile) {
  OneVoxel running(file_);
  running.saver().save_if_changed();
  set_fault("unreadable");
  EXPECT_THROW(running.saver().save_if_changed(), MapFileError);
  EXPECT_THROW(running.saver().save_as(""), MapFileError);
  set_fault("");
  EXPECT_EQ(running.saver().save_as(""), file_);
  EXPECT_EQ(running.tiles().load({0, 0}).tile->voxels.size(), 1U);
}

class MapSaverFaults : public FaultyDisk, public testing::WithParamInterface<SaverFault> {
 protected:
  void wait_up_to(unsigned max_us) { usleep(static_cast<useconds_t>(random_() % max_us)); }

  /// Runs and ends a process; the stamps that it said were stored.
  std::vector<std::int64_t> run_process(std::int64_t first_ns) {
    int ends[2] = {};
    EXPECT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    if (child == 0) {
      // A forked process has lost TBB's workers.
      const tbb::global_control alone(tbb::global_control::max_allowed_parallelism, 1);
      for (const int signal : {SIGTERM, SIGHUP, SIGINT}) {
        std::signal(signal, [](int) { stop_requested = 1; });
      }
      try {
        SavingProcess(file_, first_ns, ends[1]).run();
      } catch (const std::exception& error) {
        std::cerr << error.what() << "\n";
        _exit(3);
      }
    }
    close(ends[1]);
    // Most often it has saved once before its disk fails.
    pollfd first_report{.fd = ends[0], .events = POLLIN, .revents = 0};
    if (random_() % 5 != 0) poll(&first_report, 1, 60'000);
    wait_up_to(150'000);
    set_fault(GetParam().disk);
    wait_up_to(150'000);
    if (random_() % 3 == 0) set_fault("");
    wait_up_to(80'000);
    const auto& signals = GetParam().signals;
    kill(child, signals[random_() % signals.size()]);
    int how = 0;
    EXPECT_EQ(waitpid(child, &how, 0), child);
    EXPECT_TRUE(WIFSIGNALED(how) || WEXITSTATUS(how) == 0 || WEXITSTATUS(how) == 3);
    set_fault("");
    std::vector<std::int64_t> stored;
    for (std::int64_t ns = 0; read(ends[0], &ns, sizeof ns) == sizeof ns;) stored.push_back(ns);
    close(ends[0]);
    return stored;
  }

  /// Every map file opens, and no two maps have anything in common; all stamps in them.
  [[nodiscard]] std::set<std::int64_t> check_files() const {
    std::set<std::int64_t> stamps;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_.path())) {
      const fs::path& file = entry.path();
      if (file.extension() != ".stillmap") continue;
      const SavedMap map = open_map_file(file)->load();
      std::set<std::int64_t> own;
      for (const StampedPose& pose : map.trajectory) own.insert(pose.stamp_ns);
      for (const auto& tile : map.view.tiles) {
        for (const Voxel& voxel : tile->voxels) {
          EXPECT_TRUE(own.contains(voxel.first_seen_ns)) << file << " has another map's voxel";
          EXPECT_TRUE(own.contains(voxel.last_seen_ns)) << file << " has another map's voxel";
        }
      }
      for (const std::int64_t ns : own) {
        EXPECT_TRUE(stamps.insert(ns).second) << file << " has another map's pose";
      }
    }
    return stamps;
  }

  std::mt19937 random_{std::random_device{}()};
};

TEST_P(MapSaverFaults, NothingThatWasStoredIsLostAndNoFileHoldsAnotherMap) {
  std::size_t saves = 0;
  for (int round = 0; round < wanted_rounds(); ++round) {
    const std::vector<std::int64_t> stored = run_process((round + 1) * std::int64_t{1'000'000});
    const std::set<std::int64_t> found = check_files();
    for (const std::int64_t ns : stored) EXPECT_TRUE(found.contains(ns)) << ns << " is lost";
    if (HasFailure()) FAIL() << "round " << round;
    saves += stored.size();
    // So that the folder does not fill with maps that resets kept.
    if (round % 10 == 9) {
      for (const fs::directory_entry& entry : fs::directory_iterator(folder_.path())) {
        if (entry.path().filename().string().starts_with("city.20")) fs::remove(entry.path());
      }
    }
  }
  if (wanted_rounds() >= 20) {
    EXPECT_GT(saves, 10U);
  }
  std::cout << GetParam().name << ": " << wanted_rounds() << " rounds, " << saves << " saves\n";
}

INSTANTIATE_TEST_SUITE_P(
    Faults, MapSaverFaults,
    testing::Values(SaverFault{"killed", "", {SIGKILL}}, SaverFault{"terminated", "", {SIGTERM}},
                    SaverFault{"hung_up", "", {SIGHUP}},
                    SaverFault{"full", "full", {SIGKILL, SIGTERM, SIGHUP}},
                    SaverFault{"read_only", "read_only", {SIGKILL, SIGTERM, SIGHUP}},
                    SaverFault{"fsync", "fsync", {SIGKILL, SIGTERM, SIGHUP}}),
    [](const auto& fault) { return fault.param.name; });

}  // namespace
}  // namespace stillmap::server
