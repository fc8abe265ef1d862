// The map of a real server whose file somebody removes or replaces.

#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>

#include "core/map/storage/map_file.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

namespace fs = std::filesystem;

class DisplacedMapService : public testing::Test {
 protected:
  DisplacedMapService()
      : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    client_.wait_for_server(patience);
    map_scans(0, 8);
    client_.save_map("backup.stillmap");
    map_scans(8, 12);
    client_.save_map();
  }
  void map_scans(int first, int last) {
    drive(publisher_, first, last);
    mapped_ += static_cast<std::uint64_t>(last - first);
    ASSERT_TRUE(wait_for_scans(client_, mapped_));
  }
  void terminate() {
    server_.send(SIGTERM);
    ASSERT_EQ(server_.wait_for_exit(patience), 0);
  }
  [[nodiscard]] fs::path backup() const {
    return setup_.map_file().parent_path() / "backup.stillmap";
  }
  [[nodiscard]] static std::size_t poses_in(const fs::path& file) {
    return open_map_file(file)->load().trajectory.size();
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
  ScanPublisher publisher_{setup_.publisher(true)};
  std::uint64_t mapped_ = 0;
};

TEST_F(DisplacedMapService, SavesAMapWhoseFileWasRemoved) {
  fs::remove(setup_.map_file());
  EXPECT_EQ(client_.save_map(), setup_.map_file());
  EXPECT_EQ(client_.status().counter("map_files_displaced"), 1U);
  fs::remove(setup_.map_file());
  map_scans(12, 14);
  terminate();
  EXPECT_EQ(poses_in(setup_.map_file()), 14U);
}

TEST_F(DisplacedMapService, LoadsABackupThatWasPutInTheFilesPlaceAndKeepsTheRunningMap) {
  for (const bool is_copied : {false, true}) {
    if (is_copied) {
      fs::copy_file(backup(), setup_.map_file(), fs::copy_options::overwrite_existing);
    } else {
      fs::copy_file(backup(), backup().string() + ".2");
      fs::rename(backup().string() + ".2", setup_.map_file());
    }
    const std::string saved = client_.save_map();
    EXPECT_NE(saved, setup_.map_file());
    EXPECT_EQ(content_of(setup_.map_file()), content_of(backup()));
    EXPECT_THAT(client_.status().reason,
                testing::AllOf(testing::HasSubstr("saved to " + saved),
                               testing::Not(testing::HasSubstr("in memory alone"))));
    EXPECT_EQ(poses_in(saved), is_copied ? 8U : 12U);
    EXPECT_EQ(client_.load_map("map.stillmap").pose_count, 8U);
  }
  map_scans(8, 10);
  terminate();
  EXPECT_EQ(poses_in(setup_.map_file()), 10U);
}

TEST_F(DisplacedMapService, ResumesWhatAKilledServerWasWritingInPlaceOfItsFile) {
  server_.send(SIGKILL);
  ASSERT_NE(server_.wait_for_exit(patience), 0);
  const std::string file = setup_.map_file();
  const fs::path whole = file + ".new-1aB2cD/unfinished.stillmap";
  const fs::path part = setup_.map_file().parent_path() /
                        "map.2026-05-31_142500.stillmap.new-3cD4eF/unfinished.stillmap";
  for (const fs::path& left : {whole, part}) fs::create_directory(left.parent_path());
  fs::copy_file(file, part);
  fs::resize_file(part, fs::file_size(part) / 2);
  fs::rename(file, whole);
  {
    ServerProcess next(setup_.server_arguments());
    Client client(setup_.client());
    client.wait_for_server(patience);
    EXPECT_THAT(client.status().reason, testing::HasSubstr(part.string() + " is a part of a map"));
    next.send(SIGTERM);
    ASSERT_EQ(next.wait_for_exit(patience), 0);
  }
  EXPECT_EQ(poses_in(file), 12U);
  EXPECT_FALSE(fs::exists(whole.parent_path()));
  EXPECT_TRUE(fs::exists(part));
  EXPECT_FALSE(fs::exists(file + "-wal")) << "a clean stop leaves the file alone";
}

TEST(LinkedMapFile, IsMadeWhereTheLinkLeads) {
  const ScratchFolder disk;
  const ServiceSetup setup("every");
  fs::create_symlink(disk / "city.stillmap", setup.map_file());
  {
    ServerProcess server(setup.server_arguments());
    Client client(setup.client());
    client.wait_for_server(patience);
    ScanPublisher publisher(setup.publisher(true));
    drive(publisher, 0, 4);
    ASSERT_TRUE(wait_for_scans(client, 4));
    server.send(SIGTERM);
    ASSERT_EQ(server.wait_for_exit(patience), 0);
  }
  EXPECT_TRUE(fs::is_symlink(setup.map_file()));
  EXPECT_EQ(open_map_file(disk / "city.stillmap")->load().trajectory.size(), 4U);
}

}  // namespace
}  // namespace stillmap::test
