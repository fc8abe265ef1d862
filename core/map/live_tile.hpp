#pragma once

#include <tsl/robin_map.h>

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/map/tile.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

/// Column, row and layer in 32 bits; keys sort as indices do.
[[nodiscard]] std::uint32_t voxel_key(VoxelIndex index);
[[nodiscard]] VoxelIndex voxel_index(std::uint32_t key);

/// A point on its way into a tile.
struct TilePoint {
  std::uint32_t voxel_key = 0;
  /// From the voxel's lowest corner, in 1/1024 voxel.
  std::array<std::uint16_t, 3> offset{};
  SemanticClass label = SemanticClass::unlabeled;
  /// Semi-static: says what a known voxel is, and makes none.
  bool only_evidence = false;
  float confidence = 0.0F;
};

/// The mutable side of a tile: everything seen so far, also what is not yet in any view.
class LiveTile {
 public:
  explicit LiveTile(TileId id) : id_(id) {}
  /// Goes on from a published tile.
  LiveTile(std::shared_ptr<const Tile> published, const VoxelGrid& grid);

  void insert(std::span<const TilePoint> points, std::int64_t stamp_ns);

  /// Of the voxel; without votes when there is none.
  [[nodiscard]] ClassEvidence evidence(std::uint32_t voxel_key) const;

  /// Publishes the voxels hit `min_points` times that are not of a movable class. False, and the
  /// published tile stays, when the content is the same as before.
  [[nodiscard]] bool publish(std::uint64_t revision, std::uint32_t min_points,
                             const VoxelGrid& grid);

  [[nodiscard]] TileId id() const { return id_; }
  /// What views share; null while there is nothing to show.
  [[nodiscard]] const std::shared_ptr<const Tile>& published() const { return published_; }

 private:
  /// Sums are whole numbers, so that the mean does not depend on the order of points.
  struct LiveVoxel {
    std::uint32_t key = 0;
    std::uint32_t point_count = 0;
    std::array<std::uint32_t, 3> offset_sum{};
    ClassEvidence evidence;
    std::int64_t first_seen_ns = 0;
    std::int64_t last_seen_ns = 0;
  };
  struct KeyHash {
    /// Fibonacci hashing: neighbours in space spread over the table.
    std::size_t operator()(std::uint32_t key) const {
      return static_cast<std::size_t>((key * 0x9E3779B97F4A7C15ULL) >> 32);
    }
  };

  [[nodiscard]] LiveVoxel* find(const TilePoint& point);
  void sort_new_voxels();
  [[nodiscard]] Voxel voxel(const LiveVoxel& live, const VoxelGrid& grid) const;
  [[nodiscard]] std::vector<Voxel> visible_voxels(std::uint32_t min_points,
                                                  const VoxelGrid& grid) const;

  TileId id_;
  std::vector<LiveVoxel> voxels_;
  tsl::robin_map<std::uint32_t, std::uint32_t, KeyHash> position_;
  /// Positions of voxels in order of their keys; those added since the last publication are not
  /// in it yet.
  std::vector<std::uint32_t> sorted_;
  std::shared_ptr<const Tile> published_;
};

}  // namespace stillmap
