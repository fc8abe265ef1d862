#include "core/graph/scan_log.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "core/dataset/dataset_error.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

LoggedScan random_scan(std::uint64_t index, bool has_labels) {
  std::mt19937_64 random(index);
  std::uniform_real_distribution<float> coordinate(-100.0F, 100.0F);
  LoggedScan scan{
      .index = index,
      .T_odom_lidar = Eigen::Isometry3d(Eigen::Translation3d(static_cast<double>(index), 2, 3)),
      .entry = MapEntry::enters,
      .labelled = {}};
  scan.labelled.scan.stamp_ns = static_cast<std::int64_t>(index) * 100'000'000;
  for (int i = 0; i < 500; ++i) {
    scan.labelled.scan.points_lidar.emplace_back(coordinate(random), coordinate(random),
                                                 coordinate(random));
    scan.labelled.motion.push_back(static_cast<Motion>(random() % 3));
    if (!has_labels) continue;
    scan.labelled.labels.classes.push_back(static_cast<SemanticClass>(random() % 20));
    scan.labelled.labels.confidence.push_back(static_cast<float>(random() % 256) / 255.0F);
  }
  return scan;
}

void expect_same(const LoggedScan& read, const LoggedScan& written) {
  EXPECT_EQ(read.index, written.index);
  EXPECT_EQ(read.entry, written.entry);
  EXPECT_EQ(read.begins_elsewhere, written.begins_elsewhere);
  EXPECT_EQ(read.T_odom_lidar.matrix(), written.T_odom_lidar.matrix());
  EXPECT_EQ(read.labelled.scan.stamp_ns, written.labelled.scan.stamp_ns);
  ASSERT_EQ(read.labelled.scan.size(), written.labelled.scan.size());
  for (std::size_t i = 0; i < read.labelled.scan.size(); ++i) {
    const Eigen::Vector3f off =
        read.labelled.scan.points_lidar[i] - written.labelled.scan.points_lidar[i];
    EXPECT_LE(off.cwiseAbs().maxCoeff(), 0.00201F);
  }
  EXPECT_EQ(read.labelled.motion, written.labelled.motion);
  EXPECT_EQ(read.labelled.labels.classes, written.labelled.labels.classes);
  EXPECT_EQ(read.labelled.labels.confidence, written.labelled.labels.confidence);
}

std::vector<LoggedScan> all_of(ScanLog& log) {
  std::vector<LoggedScan> scans;
  log.read([&](LoggedScan scan) { scans.push_back(std::move(scan)); });
  return scans;
}

TEST(ScanLog, ScansComeBack) {
  const ScratchFolder scratch;
  ScanLog log(scratch / "scans", 60.0);
  const LoggedScan labelled = random_scan(3, true), plain = random_scan(5, false);
  LoggedScan lost = random_scan(6, true);
  lost.entry = MapEntry::stays_out;
  LoggedScan waits = random_scan(7, false), decides = random_scan(8, true);
  waits.entry = MapEntry::waits;
  decides.entry = MapEntry::enters_with_waiting;
  decides.begins_elsewhere = true;
  LoggedScan unknown = random_scan(9, false);
  unknown.entry = MapEntry::stays_out_with_waiting;
  for (const LoggedScan& scan : {labelled, plain, lost, waits, decides, unknown}) log.append(scan);
  const auto read = all_of(log);
  ASSERT_EQ(read.size(), 6U);
  expect_same(read[0], labelled);
  expect_same(read[1], plain);
  EXPECT_EQ(read[2].index, 6U);
  EXPECT_EQ(read[2].entry, MapEntry::stays_out);
  EXPECT_TRUE(read[2].labelled.scan.empty());
  expect_same(read[3], waits);
  expect_same(read[4], decides);
  EXPECT_EQ(read[5].entry, MapEntry::stays_out_with_waiting);
  EXPECT_TRUE(read[5].labelled.scan.empty());
}

TEST(ScanLog, WhatIsTooFarStaysOnItsRay) {
  const ScratchFolder scratch;
  ScanLog log(scratch / "scans", 60.0);
  LoggedScan scan = random_scan(3, false);
  const Eigen::Vector3f far(180.0F, 60.0F, 5.0F);
  scan.labelled.scan.points_lidar[7] = far;
  log.append(scan);
  const auto read = all_of(log);
  ASSERT_EQ(read.size(), 1U);
  const Eigen::Vector3f& kept = read[0].labelled.scan.points_lidar[7];
  EXPECT_GT(kept.norm(), 131.0F);
  EXPECT_LT(kept.normalized().cross(far.normalized()).norm(), 1e-4F);
}

TEST(ScanLog, WhatAMapReachesComesBack) {
  const ScratchFolder scratch;
  LoggedScan scan = random_scan(3, false);
  const Eigen::Vector3f far(180.0F, 60.0F, 5.0F);
  scan.labelled.scan.points_lidar[7] = far;
  ScanLog(scratch / "scans", 200.0).append(scan);
  // Whatever it is opened with.
  ScanLog log(scratch / "scans", 60.0);
  EXPECT_LT((log.at(0).labelled.scan.points_lidar[7] - far).norm(), 0.006F);
}

TEST(ScanLog, AnotherProcessGoesOnWhereOneWasKilled) {
  const ScratchFolder scratch;
  {
    ScanLog log(scratch / "scans", 60.0);
    for (std::uint64_t i = 0; i < 5; ++i) log.append(random_scan(i, true));
  }
  // The last record is cut through.
  const auto size = std::filesystem::file_size(scratch / "scans");
  std::filesystem::resize_file(scratch / "scans", size - 10);
  ScanLog log(scratch / "scans", 60.0);
  EXPECT_EQ(all_of(log).size(), 4U);
  log.truncate_from(3);
  log.append(random_scan(3, false));
  const auto read = all_of(log);
  ASSERT_EQ(read.size(), 4U);
  expect_same(read[3], random_scan(3, false));
}

TEST(ScanLog, DamageIsNamed) {
  const ScratchFolder scratch;
  ScanLog log(scratch / "scans", 60.0);
  log.append(random_scan(0, true));
  log.flush();
  std::fstream file(scratch / "scans", std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(400);
  const std::string garbage(500, 'x');
  file.write(garbage.data(), static_cast<std::streamsize>(garbage.size()));
  file.close();
  EXPECT_THROW(all_of(log), DatasetError);
  EXPECT_THROW(ScanLog(scratch.path() / "no" / "folder", 60.0), DatasetError);
}

}  // namespace
}  // namespace stillmap
