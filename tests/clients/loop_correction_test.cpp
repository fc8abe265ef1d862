#include "clients/commands/mapping/loop_correction.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "core/dataset/dataset_error.hpp"
#include "tests/graph/street_world.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::cli {
namespace {

constexpr int scans = 60;
constexpr int begin = 20, end = 50;

/// What of a drive along a street, a metre a scan, is in a map of its scans between these two.
class StretchThatHasWaited : public testing::Test {
 protected:
  [[nodiscard]] MappedScan mapped(int k, MapEntry entry) const {
    const Eigen::Isometry3d T_map_lidar = world_.T_map_lidar_at(k, false);
    MappedScan mapped;
    mapped.odometry.T_map_lidar = T_map_lidar;
    mapped.odometry.map_entry = entry;
    mapped.labelled = world_.scan_at(T_map_lidar, static_cast<std::uint64_t>(k));
    mapped.labelled.scan.stamp_ns = 100'000'000 * (k + 1);
    return mapped;
  }
  /// `last` is the entry of the scan that ends the stretch.
  void drive(LoopCorrection& loops, int from, int to, MapEntry last) const {
    for (int k = from; k < to; ++k) {
      MapEntry entry = MapEntry::enters;
      if (k >= begin && k < end) entry = k == begin + 5 ? MapEntry::stays_out : MapEntry::waits;
      if (k == end) entry = last;
      loops.add(static_cast<std::size_t>(k), mapped(k, entry));
    }
  }
  /// Scans that saw something, by the times at which voxels were seen first and last.
  [[nodiscard]] std::size_t scans_in_map(LoopCorrection& loops) const {
    static_cast<void>(loops.finish());
    EXPECT_EQ(loops.T_map_lidar().size(), std::size_t{scans});
    StaticMap map({});
    EXPECT_TRUE(loops.insert_into(map, loops.T_map_lidar(), 0, [](std::size_t) { return true; }));
    std::set<std::int64_t> stamps;
    for (const auto& tile : map.view()->tiles)
      for (const Voxel& voxel : tile->voxels)
        stamps.insert({voxel.first_seen_ns, voxel.last_seen_ns});
    return stamps.size();
  }
  [[nodiscard]] LoopOptions options() const { return {scratch_ / "scans", 0.0, {}, {}}; }

 private:
  ScratchFolder scratch_;
  StreetWorld world_{11};
};

TEST_F(StretchThatHasWaited, IsInTheMapThatIsMadeAgain) {
  LoopCorrection loops(options(), vlp_16());
  drive(loops, 0, scans, MapEntry::enters_with_waiting);
  EXPECT_EQ(scans_in_map(loops), std::size_t{scans - 1});
}

TEST_F(StretchThatHasWaited, StaysOutWhereNobodyKnowsWhereItIs) {
  LoopCorrection loops(options(), vlp_16());
  drive(loops, 0, scans, MapEntry::enters);
  EXPECT_EQ(scans_in_map(loops), std::size_t{scans - (end - begin)});
}

TEST_F(StretchThatHasWaited, IsDecidedByScansAfterAnInterruption) {
  {
    LoopCorrection killed(options(), vlp_16());
    drive(killed, 0, begin + 15, MapEntry::enters);
    killed.flush();
  }
  LoopCorrection loops(options(), vlp_16());
  loops.resume(begin + 10, begin + 10);
  drive(loops, begin + 10, scans, MapEntry::enters_with_waiting);
  EXPECT_EQ(scans_in_map(loops), std::size_t{scans - 1});
}

// The power was lost before all scans were on disk: loops of the rest alone would be closed.
TEST_F(StretchThatHasWaited, AnInterruptedRunWhoseScansAreGoneIsRefused) {
  {
    LoopCorrection killed(options(), vlp_16());
    drive(killed, 0, begin, MapEntry::enters);
    killed.flush();
  }
  LoopCorrection loops(options(), vlp_16());
  try {
    loops.resume(begin + 10, begin + 10);
    FAIL() << "it has not all scans";
  } catch (const DatasetError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("--force"));
  }
}

TEST_F(StretchThatHasWaited, StaysOutAtTheEndOfTheDrive) {
  LoopCorrection loops(options(), vlp_16());
  drive(loops, 0, end, MapEntry::enters);
  EXPECT_FALSE(loops.finish());
  EXPECT_EQ(loops.T_map_lidar().size(), std::size_t{end});
}

}  // namespace
}  // namespace stillmap::cli
