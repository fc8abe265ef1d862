// A `cp` over the running map's file that meets the moment in which a save is written into it.

#include <gmock/gmock.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/server/displaced_map_file.hpp"

namespace stillmap::server {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t page_bytes = 1024;

class TornCopy : public DisplacedMapFile {
 protected:
  /// A scan that fills pages of its own.
  void map_wall(float x, unsigned seed) {
    LabelledScan labelled;
    for (unsigned i = 0; i < 3000; ++i) {
      const unsigned place = (i * 2654435761U) ^ (seed * 40503U);
      const auto part = [&](unsigned divisor, unsigned count) {
        return static_cast<float>(place / divisor % count);
      };
      labelled.scan.points_lidar.insert(
          labelled.scan.points_lidar.end(), 5,
          Eigen::Vector3f(x + part(1, 1000) * 0.009F, part(1000, 1000) * 0.009F,
                          part(1000000, 30) * 0.1F));
    }
    labelled.motion.assign(labelled.scan.size(), Motion::stationary);
    map_.insert(labelled, Eigen::Isometry3d::Identity());
    latest_map_.publish(map_.view());
    latest_map_.add_pose({.stamp_ns = ++last_ns_}, OdometryHealth::good, "none");
  }
  /// The content of the file after a save whose changed pages came over a copy of the backup.
  [[nodiscard]] std::string saved_over_copy() {
    const std::string before = content_of(file_);
    map_wall(41.0F, 77);
    saver_.save_if_changed();
    const std::string after = content_of(file_);
    std::string mixed = content_of(folder_ / "backup.stillmap");
    mixed.resize(after.size());
    for (std::size_t at = 0; at < after.size(); at += page_bytes) {
      if (at >= before.size() || after.compare(at, page_bytes, before, at, page_bytes) != 0)
        mixed.replace(at, page_bytes, after, at, page_bytes);
    }
    return mixed;
  }
  /// Of what the map shows, the tiles that the file has, too.
  [[nodiscard]] std::size_t tiles_as_shown(const fs::path& file) {
    const SavedMap stored = open_map_file(file)->load();
    return static_cast<std::size_t>(
        std::ranges::count_if(map_.view()->tiles, [&](const auto& tile) {
          const auto found = stored.view.tiles.find(tile->info.id);
          return found && found->info.content_hash == tile->info.content_hash;
        }));
  }
};

TEST_F(TornCopy, IsNoMapAndTheRunningOneGoesOnBesideIt) {
  for (const float x : {31.0F, 1.0F}) map_wall(x, 3);
  saver_.save_if_changed();
  fs::copy_file(file_, folder_ / "backup.stillmap", fs::copy_options::overwrite_existing);
  for (const float x : {30.0F, -19.0F, 41.0F}) map_wall(x, 5);
  saver_.save_if_changed();
  const std::string mixed = saved_over_copy();
  ASSERT_NE(mixed, content_of(file_));
  std::ofstream(file_, std::ios::binary | std::ios::trunc) << mixed;
  map_wall(31.0F, 7);
  const fs::path saved = saver_.save_as("");
  EXPECT_NE(saved, file_);
  EXPECT_EQ(tiles_as_shown(saved), map_.view()->tiles.size());
  EXPECT_EQ(content_of(file_), mixed);
  EXPECT_EQ(displaced(), 1U);
  map_wall(50.0F, 7);
  saver_.save_at_end();
  EXPECT_EQ(tiles_as_shown(saved), map_.view()->tiles.size());
}

TEST_F(TornCopy, WhateverPagesItLeavesNothingInMemoryIsLost) {
  for (const float x : {31.0F, 1.0F}) map_wall(x, 3);
  saver_.save_if_changed();
  constexpr std::size_t parts = 8;
  for (std::size_t part = 0; part <= 2 * parts; ++part) {
    map_wall(30.0F, static_cast<unsigned>(part));
    const fs::path current = saver_.save_as("");
    const std::string own = content_of(current), other = content_of(folder_ / "backup.stillmap");
    const std::size_t pages = std::min(own.size(), other.size()) / page_bytes;
    const std::size_t cut = pages * (part % (parts + 1)) / parts * page_bytes;
    const std::string mixed = part > parts ? own.substr(0, cut) + other.substr(cut)
                                           : other.substr(0, cut) + own.substr(cut);
    std::ofstream(current, std::ios::binary | std::ios::trunc) << mixed;
    map_wall(1.0F, static_cast<unsigned>(part) + 100);
    EXPECT_EQ(tiles_as_shown(saver_.save_as("")), map_.view()->tiles.size()) << part;
  }
}

TEST_F(TornCopy, AnotherProgramThatOpenedTheFileLeavesItItsOwn) {
  map_wall(31.0F, 3);
  saver_.save_if_changed();
  std::ofstream(file_, std::ios::binary | std::ios::in) << "";
  static_cast<void>(tiles_in(file_));
  map_wall(1.0F, 3);
  EXPECT_EQ(saver_.save_as(""), file_);
  EXPECT_EQ(displaced(), 0U);
}

}  // namespace
}  // namespace stillmap::server
