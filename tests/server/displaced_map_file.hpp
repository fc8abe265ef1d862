#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/map/map_id.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "server/mapping/map_saver.hpp"
#include "server/monitoring/metrics.hpp"
#include "tests/map/short_lock_patience.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::server {

/// A running map of voxels in tiles of their own, with a memory limit as by default, in
/// city.stillmap.
class DisplacedMapFile : public testing::Test, public CheckpointSource {
 protected:
  DisplacedMapFile() {
    save_other_map(folder_ / "backup.stillmap");
    saver_.set_source(*this);
    begin(new_map_id(), saver_.tile_store());
    map_scan(5.0F);
    saver_.save_if_changed();
    map_.checkpoint_stored(step_);
  }

  RunCheckpoint checkpoint(CheckpointScope scope) override {
    const MapCheckpoint map = map_.checkpoint(scope);
    step_ = map.step;
    if (while_saving_) std::exchange(while_saving_, nullptr)();
    latest_map_.publish(map.view);
    RunCheckpoint checkpoint{to_saved_map(map), map.step};
    checkpoint.map.trajectory = latest_map_.trajectory();
    return checkpoint;
  }
  void checkpoint_stored(std::uint64_t step) override { map_.checkpoint_stored(step); }
  void checkpoint_failed() override { ++failed_; }
  void stored_is_gone() override { map_.keep_in_memory(); }
  void forget_lost_tiles() override {
    map_.forget_lost();
    latest_map_.publish(map_.view());
  }
  [[nodiscard]] MemoryUse memory_use() override { return {}; }

  void begin(std::uint64_t map_id, const std::shared_ptr<TileStore>& tiles) {
    map_.use_tile_store(tiles);
    map_.reset(map_id);
    latest_map_.begin(map_.view(), {});
  }
  void map_scan(float x) {
    map_.insert(scan_at(x), Eigen::Isometry3d::Identity());
    latest_map_.publish(map_.view());
    latest_map_.add_pose({.stamp_ns = ++last_ns_}, OdometryHealth::good, "none");
  }
  void evict_all() { map_.evict(Eigen::Vector3d(1e6, 0.0, 0.0), 0); }
  std::filesystem::path load(const std::string& name) {
    return saver_.resume_from(name, [this](const SavedMap& stored, const auto& tiles) {
      return [this, stored, tiles] {
        map_.resume(stored.view, stored.tile_evidence);
        map_.use_tile_store(tiles);
        latest_map_.begin(map_.view(), stored.trajectory);
      };
    });
  }

  static LabelledScan scan_at(float x) {
    LabelledScan labelled;
    labelled.scan.points_lidar.assign(5, Eigen::Vector3f(x, 1.0F, 1.0F));
    labelled.motion.assign(5, Motion::stationary);
    return labelled;
  }
  static void save_other_map(const std::filesystem::path& file) {
    StaticMap other{StaticMapConfig()};
    other.reset(new_map_id());
    other.insert(scan_at(50.0F), Eigen::Isometry3d::Identity());
    open_map_file(file)->save(
        {.view = *other.view(), .tile_evidence = {}, .trajectory = {{}}, .metadata = {}});
  }
  /// Tile columns in a map file as it is, with all that is stored of them.
  [[nodiscard]] static std::vector<int> tiles_in(const std::filesystem::path& file) {
    std::vector<int> columns;
    const SavedMap stored = open_map_file(file)->load();
    for (const auto& tile : stored.view.tiles) {
      if (!tile->voxels.empty()) columns.push_back(tile->info.id.x);
    }
    return columns;
  }
  /// Maps beside the configured one that are neither it nor the backup.
  [[nodiscard]] std::vector<std::filesystem::path> others() const {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      const auto name = entry.path().filename();
      if (is_map_file(entry.path()) && name != "city.stillmap" && name != "backup.stillmap")
        files.push_back(entry.path());
    }
    return files;
  }
  /// What `mv backup city.stillmap` does.
  void put_back() const { std::filesystem::rename(folder_ / "backup.stillmap", file_); }
  /// What `cp backup city.stillmap` does: the file stays, with another content.
  void copy_over() const {
    const std::string content = content_of(folder_ / "backup.stillmap");
    std::ofstream(file_, std::ios::binary | std::ios::trunc) << content;
  }
  /// Saves a map whose file was damaged while tiles of it lay there alone.
  std::filesystem::path saved_after_damage() {
    map_scan(30.0F);
    saver_.save_if_changed();
    evict_all();
    map_scan(50.0F);
    std::ofstream(file_, std::ios::binary | std::ios::trunc) << "no map";
    return saver_.save_as("");
  }
  [[nodiscard]] std::uint64_t displaced() const {
    dds::ServerStatus status;
    statistics_.report_to(status);
    return status.counter("map_files_displaced");
  }

  test::ShortLockPatience patience_;
  ScratchFolder folder_;
  std::filesystem::path file_ = folder_ / "city.stillmap";
  StaticMap map_{StaticMapConfig()};
  LatestMap latest_map_;
  Statistics statistics_;
  MapSaver saver_{latest_map_,
                  statistics_,
                  file_,
                  {},
                  {.memory_limit_mib = 64, .session = {.source = "test", .withdrawable = 2}}};
  std::function<void()> while_saving_;
  std::uint64_t step_ = 0;
  std::int64_t last_ns_ = 0;
  int failed_ = 0;
};

}  // namespace stillmap::server
