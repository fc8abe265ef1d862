// A server whose disk fails and which is stopped or killed at random moments, while clients save,
// reset and load: STILLMAP_KILLS rounds of each fault.

#include <gmock/gmock.h>
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <random>
#include <set>
#include <thread>

#include "core/map/storage/map_file.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

namespace fs = std::filesystem;
using Seconds = std::chrono::duration<double>;

int rounds() {
  const char* const text = std::getenv("STILLMAP_KILLS");
  return text == nullptr ? 2 : std::atoi(text);
}

struct Fault {
  const char* name;
  /// As disk_faults.cpp understands it; empty: the disk is well.
  const char* disk;
  /// One of these ends the server.
  std::vector<int> signals;
};

void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.name; }

/// The environment of the servers that are started in its life.
class PreloadedFaults {
 public:
  explicit PreloadedFaults(const fs::path& folder, const char* library = STILLMAP_DISK_FAULTS)
      : control_(folder / "fault") {
    setenv("LD_PRELOAD", library, 1);
    setenv("STILLMAP_FAULT", control_.c_str(), 1);
    setenv("STILLMAP_FAULT_FOLDER", folder.c_str(), 1);
  }
  ~PreloadedFaults() {
    for (const char* name : {"LD_PRELOAD", "STILLMAP_FAULT", "STILLMAP_FAULT_FOLDER"}) {
      unsetenv(name);
    }
  }
  PreloadedFaults(const PreloadedFaults&) = delete;
  PreloadedFaults& operator=(const PreloadedFaults&) = delete;

  void set(const std::string& fault) const {
    const fs::path fresh = control_.string() + ".next";
    std::ofstream(fresh) << fault;
    fs::rename(fresh, control_);
  }

 private:
  fs::path control_;
};

class DiskFault : public testing::TestWithParam<Fault> {
 protected:
  double random_s(double max_s) {
    return std::uniform_real_distribution<double>(0.0, max_s)(random_);
  }
  bool one_in(int n) { return std::uniform_int_distribution<int>(1, n)(random_) == 1; }

  /// What a client does meanwhile; the disk may refuse it.
  void disturb(Client& client) {
    try {
      if (one_in(3)) client.save_map();
      if (one_in(3)) client.reset();
      if (one_in(3)) client.load_map("");
      if (one_in(3)) client.save_map("copy", true);
    } catch (const std::exception&) {
      // Only what is on the disk in the end counts.
    }
  }

  /// Drives on from scan `next`. Stamp of the newest pose that the server said was saved; 0 where
  /// the disturbances began another map after that.
  std::int64_t run_server(const ServiceSetup& setup, const PreloadedFaults& faults, int& next);
  void check_files(const fs::path& folder);

  std::mt19937 random_{std::random_device{}()};
};

std::int64_t newest_ns(const fs::path& file) {
  const SavedMap map = open_map_file(file)->load();
  return map.trajectory.empty() ? 0 : map.trajectory.back().stamp_ns;
}

std::int64_t DiskFault::run_server(const ServiceSetup& setup, const PreloadedFaults& faults,
                                   int& next) {
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisher publisher(setup.publisher(true));
  EXPECT_TRUE(publisher.wait_for_subscriber(patience));
  std::jthread driver([&](const std::stop_token& stop) {
    for (; !stop.stop_requested(); ++next) {
      if (!publisher.publish(room_scan(next), {}, std::chrono::milliseconds(200))) continue;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  });
  EXPECT_TRUE(eventually([&] { return client.status().counter("scans_mapped") > 3; }));
  client.save_map();
  const std::int64_t saved_ns = newest_ns(setup.map_file());
  EXPECT_GT(saved_ns, 0);
  const bool is_disturbed = one_in(2);
  std::this_thread::sleep_for(Seconds(random_s(0.5)));
  faults.set(GetParam().disk);
  if (is_disturbed) disturb(client);
  std::this_thread::sleep_for(Seconds(random_s(1.0)));
  if (one_in(3)) faults.set("");
  std::this_thread::sleep_for(Seconds(random_s(0.3)));
  const auto& signals = GetParam().signals;
  server.send(
      signals.at(std::uniform_int_distribution<std::size_t>(0, signals.size() - 1)(random_)));
  EXPECT_NE(server.wait_for_exit(patience), -2);
  faults.set("");
  return is_disturbed ? 0 : saved_ns;
}

/// Every map file opens, and no two maps have a pose in common; no voxel is older than its map.
void DiskFault::check_files(const fs::path& folder) {
  std::set<std::int64_t> stamps;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path& file = entry.path();
    if (!is_map_file(file) || file.extension() != ".stillmap") continue;
    const SavedMap map = open_map_file(file)->load();
    for (const StampedPose& pose : map.trajectory) {
      EXPECT_TRUE(stamps.insert(pose.stamp_ns).second) << file << " has a pose of another map";
    }
    for (const auto& tile : map.view.tiles) {
      for (const Voxel& voxel : tile->voxels) {
        ASSERT_GE(voxel.first_seen_ns, map.trajectory[0].stamp_ns) << file;
        ASSERT_LE(voxel.last_seen_ns, map.trajectory.back().stamp_ns) << file;
      }
    }
  }
}

TEST_P(DiskFault, AtAnyMomentNoFileIsLostAndNoneHoldsAnotherMap) {
  const ServiceSetup setup("every", "save_period_s: 0.2, saved_maps: 100000");
  const fs::path folder = setup.map_file().parent_path();
  const PreloadedFaults faults(folder);
  int next = 1;
  for (int round = 0; round < rounds(); ++round) {
    const std::int64_t saved_ns = run_server(setup, faults, next);
    ASSERT_GE(newest_ns(setup.map_file()), saved_ns) << "round " << round;
    check_files(folder);
    if (HasFailure()) FAIL() << "round " << round << " of " << GetParam().name;
  }
  std::cout << GetParam().name << ": " << rounds() << " rounds\n";
}

/// Drives on until the condition holds.
template <typename Condition>
bool drive_until(ScanPublisher& publisher, int& next, Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    drive(publisher, next, next + 5);
    next += 5;
  }
  return true;
}

TEST(FullDisk, IsToldAndTheMapStopsGrowingUntilThereIsRoom) {
  const ServiceSetup setup("every", "save_period_s: 0.2, memory_limit_mib: 1");
  const PreloadedFaults faults(setup.map_file().parent_path());
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisher publisher(setup.publisher(true));
  int next = 0;
  ASSERT_TRUE(
      drive_until(publisher, next, [&] { return client.status().counter("map_memory_kib") > 0; }));
  faults.set("full");
  ASSERT_TRUE(drive_until(publisher, next,
                          [&] { return client.status().counter("scans_not_in_map") > 0; }));
  const dds::ServerStatus full = client.status();
  EXPECT_GT(full.counter(dds::checkpoints_failing_counter), 0U);
  EXPECT_THAT(full.reason, testing::HasSubstr("cannot be saved"));
  // The last scans that entered the map may still have to be published, and the map's memory is
  // looked at with every attempt to save it.
  std::vector<std::uint64_t> memory_kib;
  for (int round = 0; round < 3; ++round) {
    const auto not_in_map = client.status().counter("scans_not_in_map");
    const auto failing = client.status().counter(dds::checkpoints_failing_counter);
    drive(publisher, next, next + 20);
    next += 20;
    ASSERT_TRUE(
        eventually([&] { return client.status().counter("scans_not_in_map") >= not_in_map + 20; }));
    ASSERT_TRUE(eventually(
        [&] { return client.status().counter(dds::checkpoints_failing_counter) >= failing + 2; }));
    memory_kib.push_back(client.status().counter("map_memory_kib"));
  }
  EXPECT_EQ(memory_kib[1], memory_kib[2]);
  EXPECT_GT(client.status().mapped_hz, 0.0) << "poses go on";

  faults.set("");
  ASSERT_TRUE(drive_until(publisher, next, [&] {
    return client.status().counter(dds::checkpoints_failing_counter) == 0;
  }));
  EXPECT_THAT(client.status().reason, testing::Not(testing::HasSubstr("cannot be saved")));
  const auto still_out = client.status().counter("scans_not_in_map");
  drive(publisher, next, next + 5);
  ASSERT_TRUE(wait_for_scans(client, static_cast<std::uint64_t>(next) + 5));
  EXPECT_LE(client.status().counter("scans_not_in_map"), still_out + 3);
  server.send(SIGTERM);
  EXPECT_EQ(server.wait_for_exit(patience), 0);
}

TEST(ThreadFault, EndsTheServerWithACodeThatRestartsItAndTheMapSaved) {
  const ServiceSetup setup("every");
  const PreloadedFaults faults(setup.map_file().parent_path(), STILLMAP_THREAD_FAULTS);
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisher publisher(setup.publisher(true));
  constexpr int scans = 12;
  drive(publisher, 0, scans);
  ASSERT_TRUE(wait_for_scans(client, scans));
  EXPECT_TRUE(open_map_file(setup.map_file())->load().trajectory.empty()) << "saved once an hour";
  faults.set("throw");
  // The tiles of the next scan are hashed when they are published.
  static_cast<void>(publisher.publish(room_scan(scans), {}, std::chrono::seconds(1)));
  constexpr int thread_failed = 3;
  EXPECT_EQ(server.wait_for_exit(patience), thread_failed);
  EXPECT_GE(open_map_file(setup.map_file())->load().trajectory.size(),
            static_cast<std::size_t>(scans));
}

INSTANTIATE_TEST_SUITE_P(
    Faults, DiskFault,
    testing::Values(Fault{"killed", "", {SIGKILL}}, Fault{"terminated", "", {SIGTERM, SIGINT}},
                    Fault{"hung_up", "", {SIGHUP}},
                    Fault{"full", "full", {SIGKILL, SIGTERM, SIGHUP}},
                    Fault{"read_only", "read_only", {SIGKILL, SIGTERM, SIGHUP}},
                    Fault{"fsync", "fsync", {SIGKILL, SIGTERM, SIGHUP}}),
    [](const auto& fault) { return fault.param.name; });

}  // namespace
}  // namespace stillmap::test
