#include "core/map/storage/shown_map.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "core/map/storage/read_lease.hpp"
#include "tests/map/saved_maps.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

class ShownMapTest : public testing::Test {
 protected:
  void save(int seed) { open_map_file(file_)->save(test::saved_map(seed)); }
  void expect_shown(int seed) const {
    auto [shown, read_evidence] = read_shown_map(file_);
    EXPECT_TRUE(shown.tile_evidence.empty());
    shown.tile_evidence = read_evidence();
    test::expect_equal(shown, test::saved_map(seed));
  }
  [[nodiscard]] std::size_t files_in_folder() const {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()));
  }

  ScratchFolder folder_;
  fs::path file_ = folder_ / "city.stillmap";
};

class OtherTemporaryFolder {
 public:
  explicit OtherTemporaryFolder(const fs::path& folder) {
    if (const char* const before = std::getenv("TMPDIR")) before_ = before;
    ::setenv("TMPDIR", folder.c_str(), 1);
  }
  ~OtherTemporaryFolder() {
    before_ ? ::setenv("TMPDIR", before_->c_str(), 1) : ::unsetenv("TMPDIR");
  }
  OtherTemporaryFolder(const OtherTemporaryFolder&) = delete;
  OtherTemporaryFolder& operator=(const OtherTemporaryFolder&) = delete;

 private:
  std::optional<std::string> before_;
};

/// Without waiting for a lease to end.
[[nodiscard]] bool can_be_written(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor >= 0) ::close(descriptor);
  return descriptor >= 0;
}

TEST_F(ShownMapTest, IsTheMapAndTheFileStaysAsItIs) {
  save(2);
  const std::string before = content_of(file_);
  expect_shown(2);
  EXPECT_EQ(content_of(file_), before);
  EXPECT_EQ(files_in_folder(), 1U);
}

TEST_F(ShownMapTest, NeedsNoCopyOfAFileThatNobodyElseHasOpen) {
  save(2);
  if (!ReadLease::take(file_)) GTEST_SKIP() << "this file system has no leases";
  // Nowhere could it be copied to.
  const OtherTemporaryFolder none(folder_ / "none");
  const auto [shown, read_evidence] = read_shown_map(file_);
  EXPECT_THAT(message_of<MapFileError>([&] { static_cast<void>(read_evidence()); }),
              HasSubstr("TMPDIR"));
  EXPECT_EQ(shown.view.map_id, test::saved_map(2).view.map_id);
}

TEST_F(ShownMapTest, NamesMayHaveAnyLetters) {
  file_ = folder_ / "100% of #4?mode=rw&x [\xC3\xA4].stillmap";
  save(2);
  expect_shown(2);
}

TEST_F(ShownMapTest, OfAFileInUseIsItsLastSave) {
  const auto store = open_map_file(file_);
  store->save(test::saved_map(1));
  auto [shown, read_evidence] = read_shown_map(file_);
  store->save(test::saved_map(4));
  shown.tile_evidence = read_evidence();
  test::expect_equal(shown, test::saved_map(1));
  expect_shown(4);
}

TEST_F(ShownMapTest, BringsInTheLogOfACrash) {
  open_map_file(folder_ / "live.stillmap")->save(test::saved_map(1));
  SQLite::Database live((folder_ / "live.stillmap").string(), SQLite::OPEN_READWRITE);
  live.exec("PRAGMA wal_autocheckpoint = 0; INSERT INTO metadata VALUES ('late', 'yes')");
  fs::copy_file(live.getFilename(), file_);
  fs::copy_file(live.getFilename() + "-wal", file_.string() + "-wal");
  EXPECT_EQ(read_shown_map(file_).map.metadata.at("late"), "yes");
}

TEST_F(ShownMapTest, EvidenceOfAnotherStateIsNeverTaken) {
  save(2);
  if (!ReadLease::take(file_)) GTEST_SKIP() << "this file system has no leases";
  const auto [shown, read_evidence] = read_shown_map(file_);
  const auto refusal = [&, &read = read_evidence] {
    return message_of<MapFileError>([&] { static_cast<void>(read()); });
  };
  const auto is_changed = AllOf(StartsWith(file_.string()), HasSubstr("open it again"));
  {
    // The same map in the same version, a pose longer.
    const auto store = open_map_file(file_);
    SavedMap later = store->load();
    StampedPose pose = later.trajectory.back();
    pose.stamp_ns += 1;
    later.trajectory.push_back(pose);
    store->save(later);
    EXPECT_THAT(refusal(), is_changed);
  }
  EXPECT_THAT(refusal(), is_changed);
  fs::remove(file_);
  EXPECT_THAT(refusal(), AllOf(StartsWith(file_.string()), HasSubstr("is not there")));
}

/// Somebody who opens the file for writing as soon as it is under a lease, and is let in.
class Writer {
 public:
  explicit Writer(const fs::path& file)
      : thread_([file](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            const int descriptor = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
            if (descriptor >= 0) ::close(descriptor);
          }
        }) {}

 private:
  std::jthread thread_;
};

TEST_F(ShownMapTest, IsTheMapWhoeverWantsToWriteMeanwhile) {
  save(2);
  const Writer writer(file_);
  for (int i = 0; i < 100; ++i) {
    const auto [shown, read_evidence] = read_shown_map(file_);
    EXPECT_EQ(shown.view.map_id, test::saved_map(2).view.map_id);
  }
}

TEST_F(ShownMapTest, AFileThatIsReplacedMeanwhileIsOneOfTheTwo) {
  save(2);
  const std::string one = content_of(file_);
  fs::remove(file_);
  save(3);
  const std::string other = content_of(file_);
  const std::jthread replacer([&](const std::stop_token& stop) {
    for (int i = 0; !stop.stop_requested(); ++i) {
      std::ofstream(folder_ / "fresh", std::ios::binary) << (i % 2 == 0 ? one : other);
      fs::rename(folder_ / "fresh", file_);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  });
  for (int i = 0; i < 100; ++i) {
    const auto map_id = read_shown_map(file_).map.view.map_id;
    EXPECT_TRUE(map_id == test::saved_map(2).view.map_id ||
                map_id == test::saved_map(3).view.map_id);
  }
}

TEST_F(ShownMapTest, NamesWhatCannotBeRead) {
  const auto refusal = [&] {
    return message_of<MapFileError>([&] { static_cast<void>(read_shown_map(file_)); });
  };
  EXPECT_THAT(refusal(), AllOf(HasSubstr(file_.string()), HasSubstr("is not there")));
  std::ofstream(file_).close();
  EXPECT_THAT(refusal(), HasSubstr("is empty"));
  std::ofstream(file_) << "some text";
  EXPECT_THAT(refusal(), StartsWith(file_.string() + ": is not a map file"));
  fs::remove(file_);
  fs::create_directory(file_);
  EXPECT_THAT(refusal(), HasSubstr("is not a file"));
}

TEST_F(ShownMapTest, ADamagedFileIsNamedWithOrWithoutACopy) {
  save(2);
  SQLite::Database database(file_.string(), SQLite::OPEN_READWRITE);
  database.exec("UPDATE tiles SET encoded = substr(encoded, 1, 20)");
  const auto refusal = [&] {
    return message_of<MapFileError>([&] { static_cast<void>(read_shown_map(file_)); });
  };
  const auto is_named =
      AllOf(StartsWith(file_.string() + ": is damaged: tile ("), HasSubstr("map-check"));
  EXPECT_THAT(refusal(), is_named);
  database = SQLite::Database(":memory:");
  EXPECT_THAT(refusal(), is_named);
}

TEST_F(ShownMapTest, AnIndexThatContradictsItsTableIsFound) {
  save(2);
  {
    SQLite::Database database(file_.string(), SQLite::OPEN_READWRITE);
    database.exec("PRAGMA writable_schema = ON; CREATE TABLE other AS SELECT * FROM tiles");
    database.exec(
        "UPDATE sqlite_schema SET rootpage = (SELECT rootpage FROM sqlite_schema WHERE "
        "name = 'other') WHERE name = 'tiles'");
    database.exec("DELETE FROM other WHERE rowid = (SELECT min(rowid) FROM other)");
  }
  EXPECT_THAT(message_of<MapFileError>([&] { static_cast<void>(read_shown_map(file_)); }),
              AllOf(StartsWith(file_.string()), HasSubstr("is damaged")));
}

TEST_F(ShownMapTest, WritersWaitForTheEndOfTheLease) {
  save(2);
  {
    const auto lease = ReadLease::take(file_);
    if (!lease) GTEST_SKIP() << "this file system has no leases";
    EXPECT_TRUE(lease->is_unbroken(file_));
    EXPECT_FALSE(can_be_written(file_));
    EXPECT_FALSE(lease->is_unbroken(file_));
  }
  EXPECT_TRUE(can_be_written(file_));
  const std::ofstream writer(file_, std::ios::app);
  EXPECT_FALSE(ReadLease::take(file_));
}

TEST_F(ShownMapTest, ALeaseIsOfTheFileThatHasTheName) {
  save(2);
  const auto lease = ReadLease::take(file_);
  if (!lease) GTEST_SKIP() << "this file system has no leases";
  fs::rename(file_, folder_ / "other.stillmap");
  EXPECT_FALSE(lease->is_unbroken(file_));
  save(3);
  EXPECT_FALSE(lease->is_unbroken(file_));
  EXPECT_TRUE(lease->is_unbroken(folder_ / "other.stillmap"));
}

}  // namespace
}  // namespace stillmap
