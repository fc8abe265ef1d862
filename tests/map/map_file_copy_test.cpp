#include "core/map/storage/map_file_copy.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include <fstream>

#include "core/map/tools/map_info.hpp"
#include "tests/map/saved_maps.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class MapFileCopyTest : public testing::Test {
 protected:
  std::string refusal() const {
    return message_of<MapFileError>([&] { static_cast<void>(read_map_file(file_)); });
  }
  [[nodiscard]] std::size_t files_in_folder() const {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()));
  }

  ScratchFolder folder_;
  fs::path file_ = folder_ / "city.stillmap";
};

TEST_F(MapFileCopyTest, ReadsWhatWasSavedAndLeavesNothingBehind) {
  const SavedMap saved = test::saved_map(2);
  open_map_file(file_)->save(saved);
  const std::string before = content_of(file_);
  test::expect_equal(read_map_file(file_), saved);
  EXPECT_EQ(content_of(file_), before);
  EXPECT_EQ(files_in_folder(), 1U);
}

TEST_F(MapFileCopyTest, ReadsTheLastSaveOfAFileInUse) {
  const auto store = open_map_file(file_);
  store->save(test::saved_map(1));
  test::expect_equal(read_map_file(file_), test::saved_map(1));
  store->save(test::saved_map(4));
  test::expect_equal(read_map_file(file_), test::saved_map(4));
}

TEST_F(MapFileCopyTest, BringsInTheLogOfACrashInTheCopyOnly) {
  open_map_file(folder_ / "live.stillmap")->save(test::saved_map(1));
  // A connection that is still open leaves its log where it is, as a crash does.
  SQLite::Database live((folder_ / "live.stillmap").string(), SQLite::OPEN_READWRITE);
  live.exec("PRAGMA wal_autocheckpoint = 0; INSERT INTO metadata VALUES ('late', 'yes')");
  fs::copy_file(live.getFilename(), file_);
  const fs::path log = file_.string() + "-wal";
  fs::copy_file(live.getFilename() + "-wal", log);
  const std::string before = content_of(file_);
  const std::string log_before = content_of(log);
  ASSERT_FALSE(log_before.empty());
  EXPECT_EQ(read_map_file(file_).metadata.at("late"), "yes");
  EXPECT_EQ(content_of(file_), before);
  EXPECT_EQ(content_of(log), log_before);
}

TEST_F(MapFileCopyTest, NamesWhatCannotBeRead) {
  EXPECT_THAT(refusal(), testing::AllOf(HasSubstr(file_.string()), HasSubstr("is not there")));
  EXPECT_FALSE(fs::exists(file_));
  std::ofstream(file_).close();
  EXPECT_THAT(refusal(), HasSubstr("is empty"));
  EXPECT_EQ(fs::file_size(file_), 0U);
  std::ofstream(file_) << "some text";
  EXPECT_THAT(refusal(), testing::StartsWith(file_.string() + ": is not a map file"));
  fs::remove(file_);
  fs::create_directory(file_);
  EXPECT_THAT(refusal(), HasSubstr("is not a file"));
}

TEST_F(MapFileCopyTest, FiguresOfAMapAreThoseCountedByHand) {
  const SavedMap saved = test::saved_map(2);
  open_map_file(file_)->save(saved);
  const MapFileInfo info = map_file_info(file_);
  std::uint64_t voxels = 0;
  std::uint64_t poles = 0;
  float highest = -1e9F;
  for (const auto& tile : saved.view.tiles) {
    voxels += tile->voxels.size();
    for (const Voxel& voxel : tile->voxels) {
      poles += voxel.evidence.winner() == SemanticClass::pole ? 1 : 0;
      highest = std::max(highest, voxel.mean_map.z());
    }
  }
  EXPECT_EQ(info.map.voxels, voxels);
  EXPECT_EQ(info.map.voxels_of_class.at(18), poles);
  EXPECT_EQ(info.map.tiles, saved.view.tiles.size());
  EXPECT_FLOAT_EQ(static_cast<float>(info.map.bounds_map.max().z()), highest);
  EXPECT_EQ(info.map.poses, saved.trajectory.size());
  // Poses stand one metre apart.
  EXPECT_NEAR(info.map.path_length_m, static_cast<double>(saved.trajectory.size() - 1), 1e-9);
  EXPECT_EQ(info.map.trajectory_span.last_ns, saved.trajectory.back().stamp_ns);
  EXPECT_EQ(info.map.metadata, saved.metadata);
  EXPECT_EQ(info.bytes, fs::file_size(file_));
  EXPECT_GT(info.schema_version, 0U);
}

TEST_F(MapFileCopyTest, AnEmptyMapHasNoFigures) {
  static_cast<void>(open_map_file(file_));
  const MapFileInfo info = map_file_info(file_);
  EXPECT_EQ(info.map.voxels, 0U);
  EXPECT_TRUE(info.map.bounds_map.isEmpty());
  EXPECT_EQ(info.map.path_length_m, 0.0);
}

}  // namespace
}  // namespace stillmap
