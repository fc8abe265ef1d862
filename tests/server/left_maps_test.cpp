// What a server that was killed leaves of a map that it was writing, and the next start.

#include "server/mapping/left_maps.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "core/map/storage/fresh_map_file.hpp"
#include "core/map/storage/map_lock.hpp"
#include "tests/server/displaced_map_file.hpp"

namespace stillmap::server {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

/// A map of one tile, and processes that are killed while they write a copy of it.
class LeftMapsTest : public testing::Test {
 protected:
  LeftMapsTest() {
    StaticMap map{StaticMapConfig()};
    map.reset(new_map_id());
    LabelledScan labelled;
    labelled.scan.points_lidar.assign(5, Eigen::Vector3f(50.0F, 1.0F, 1.0F));
    labelled.motion.assign(5, Motion::stationary);
    map.insert(labelled, Eigen::Isometry3d::Identity());
    open_map_file(folder_ / "source")
        ->save({.view = *map.view(), .tile_evidence = {}, .trajectory = {{}}, .metadata = {}});
  }
  void die_while_writing(const fs::path& name, std::uintmax_t bytes = UINTMAX_MAX) const {
    const pid_t child = fork();
    if (child == 0) {
      const FreshMapFile fresh(name);
      fs::copy_file(folder_ / "source", fresh.path());
      if (bytes < fs::file_size(fresh.path())) fs::resize_file(fresh.path(), bytes);
      _exit(0);
    }
    waitpid(child, nullptr, 0);
  }
  /// Tiles that a server resumes with.
  std::size_t tiles_at_start() {
    MapSaver saver(latest_map_, statistics_, file_, {});
    const auto stored = saver.load();
    return stored ? stored->view.tiles.size() : 0;
  }
  [[nodiscard]] static std::size_t poses_in(const fs::path& file) {
    return open_map_file(file)->load().trajectory.size();
  }
  [[nodiscard]] std::vector<fs::path> left() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path())) {
      if (entry.path().filename() == "unfinished.stillmap") files.push_back(entry.path());
    }
    return files;
  }
  [[nodiscard]] std::vector<fs::path> maps() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      if (is_map_file(entry.path()) && entry.path().filename() != "source")
        files.push_back(entry.path());
    }
    return files;
  }

  ScratchFolder folder_;
  fs::path file_ = folder_ / "city.stillmap";
  LatestMap latest_map_;
  Statistics statistics_;
};

TEST_F(LeftMapsTest, AWholeOneIsResumedWhereNoFileHasTheName) {
  die_while_writing(file_);
  EXPECT_EQ(tiles_at_start(), 1U);
  EXPECT_EQ(poses_in(file_), 1U);
  EXPECT_TRUE(left().empty());
  EXPECT_EQ(statistics_.maps_left(), "");
}

TEST_F(LeftMapsTest, AWholeOneIsKeptBesideAFileThatHasTheName) {
  static_cast<void>(open_map_file(file_));
  die_while_writing(file_);
  EXPECT_EQ(tiles_at_start(), 0U);
  ASSERT_EQ(maps().size(), 2U);
  const fs::path kept = maps()[0] == file_ ? maps()[1] : maps()[0];
  EXPECT_EQ(poses_in(kept), 1U);
  EXPECT_TRUE(left().empty());
  EXPECT_THAT(statistics_.maps_left(), HasSubstr(kept.string() + ", which is whole"));
}

TEST_F(LeftMapsTest, OneThatIsKeptBesideIsToldUntilItIsLoaded) {
  const fs::path dated = folder_ / "city.2026-05-31_142500.stillmap";
  die_while_writing(dated);
  MapSaver saver(latest_map_, statistics_, file_, {});
  static_cast<void>(saver.load());
  latest_map_.begin(StaticMap(StaticMapConfig()).view(), {});
  ASSERT_THAT(statistics_.maps_left(), HasSubstr(dated.string()));
  static_cast<void>(saver.resume_from(
      dated.filename(),
      [](const SavedMap&, const auto&) -> std::function<void()> { return [] {}; }));
  EXPECT_EQ(statistics_.maps_left(), "");
}

TEST_F(LeftMapsTest, OneThatCannotBeReadIsToldAndStays) {
  const fs::path fresh = folder_ / "city.stillmap.new-1aB2cD/unfinished.stillmap";
  fs::create_directory(fresh.parent_path());
  fs::create_symlink(fresh, fresh);
  static_cast<void>(tiles_at_start());
  EXPECT_TRUE(fs::is_symlink(fresh));
  EXPECT_THAT(statistics_.maps_left(), HasSubstr(fresh.string() + " is what a killed server"));
}

TEST_F(LeftMapsTest, AMapThatAnotherServerWasWritingBesideIsItsOwn) {
  const fs::path of_another = folder_ / "city.north.stillmap";
  die_while_writing(of_another);
  static_cast<void>(tiles_at_start());
  EXPECT_FALSE(fs::exists(of_another));
  EXPECT_EQ(left().size(), 1U);
  EXPECT_EQ(statistics_.maps_left(), "");
}

TEST_F(LeftMapsTest, OneThatWasToLieBesideTheNameIsGivenItsOwn) {
  static_cast<void>(open_map_file(file_));
  const fs::path dated = folder_ / "city.2026-05-31_142500.stillmap";
  die_while_writing(dated);
  static_cast<void>(tiles_at_start());
  EXPECT_EQ(poses_in(dated), 1U);
  EXPECT_THAT(statistics_.maps_left(), HasSubstr(dated.string()));
  EXPECT_FALSE(fs::exists(dated.string() + ".lock"));
}

TEST_F(LeftMapsTest, APartStaysAsItIsAndIsToldUntilItIsGone) {
  die_while_writing(file_, fs::file_size(folder_ / "source") / 2);
  ASSERT_EQ(left().size(), 1U);
  const fs::path part = left().front();
  const std::string content = content_of(part);
  MapSaver saver(latest_map_, statistics_, file_, {});
  EXPECT_EQ(saver.load()->view.tiles.size(), 0U);
  EXPECT_EQ(content_of(part), content);
  EXPECT_THAT(statistics_.maps_left(), HasSubstr(part.string() + " is a part of a map"));
  fs::remove_all(part.parent_path());
  latest_map_.begin(StaticMap(StaticMapConfig()).view(), {});
  saver.save_if_changed();
  EXPECT_EQ(statistics_.maps_left(), "");
}

TEST_F(LeftMapsTest, OneThatAnotherServerIsWritingIsLeftAlone) {
  const fs::path dated = folder_ / "city.2026-05-31_142500.stillmap";
  const MapLock of_another(dated);
  die_while_writing(dated);
  static_cast<void>(tiles_at_start());
  EXPECT_FALSE(fs::exists(dated));
  EXPECT_EQ(left().size(), 1U);
}

TEST_F(DisplacedMapFile, PartsOfAMapThatIsSavedAnewUnderTheirNameGo) {
  const fs::path part = folder_ / "backup.stillmap.new-1aB2cD/unfinished.stillmap";
  static_cast<void>(
      folder_.file("backup.stillmap.new-1aB2cD/unfinished.stillmap", "half of a map"));
  {
    const MapLock taken(folder_ / "backup.stillmap");
    EXPECT_THROW(saver_.save_as("backup.stillmap", true), MapFileError);
  }
  EXPECT_TRUE(fs::exists(part)) << "another process may have been writing it";
  saver_.save_as("backup.stillmap", true);
  EXPECT_FALSE(fs::exists(part));
}

}  // namespace
}  // namespace stillmap::server
