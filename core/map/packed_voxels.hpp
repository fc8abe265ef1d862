#pragma once

#include <Eigen/Geometry>
#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/lidar/indexed_iterator.hpp"
#include "core/map/tile_table.hpp"
#include "core/map/voxel.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

/// What is known of a voxel apart from times and visibility, in 20 bytes: as maps hold it in memory
/// and on disk.
struct PackedVoxel {
  /// Offsets from the voxel's lowest corner are in these parts of a voxel.
  static constexpr std::uint32_t offset_steps = 256;
  /// The mean is that of the first so many points: whole numbers in 16 bits hold their sum.
  static constexpr std::uint32_t max_mean_points = 255;

  std::uint32_t key = 0;
  /// Sums are whole numbers, so that the mean does not depend on the order of points.
  std::array<std::uint16_t, 3> offset_sum{};
  std::uint16_t point_count = 0;
  ClassEvidence evidence;

  [[nodiscard]] std::uint32_t mean_points() const {
    return point_count < max_mean_points ? point_count : max_mean_points;
  }
  friend bool operator==(const PackedVoxel&, const PackedVoxel&) = default;
};

/// 1 / (offset_steps n), for n points.
inline constexpr auto share_of_points = [] {
  std::array<double, PackedVoxel::max_mean_points + 1> shares{};
  for (std::uint32_t n = 1; n < shares.size(); ++n)
    shares[n] = 1.0 / (PackedVoxel::offset_steps * n);
  return shares;
}();

/// Clients see means in eighths of a voxel.
inline constexpr std::uint32_t content_steps = 8;

/// The mean of the voxel's points, map frame [voxels]; point_count > 0.
[[nodiscard]] inline Eigen::Array3d mean_voxels(const PackedVoxel& voxel, TileId tile,
                                                const VoxelGrid& grid) {
  constexpr double half_step = 0.5 / PackedVoxel::offset_steps;
  const double share = share_of_points[voxel.mean_points()];
  const VoxelIndex index = voxel_index(voxel.key);
  const Eigen::Array3d corner(static_cast<double>(tile.x) * grid.columns() + index.x,
                              static_cast<double>(tile.y) * grid.columns() + index.y, index.z);
  const Eigen::Array3d sum(voxel.offset_sum[0], voxel.offset_sum[1], voxel.offset_sum[2]);
  return corner + (sum * share + half_step);
}

/// The same in metres.
[[nodiscard]] inline Eigen::Vector3f mean_map(const PackedVoxel& voxel, TileId tile,
                                              const VoxelGrid& grid) {
  return (grid.voxel_size_m() * mean_voxels(voxel, tile, grid)).matrix().cast<float>();
}

/// The eighth of a voxel in which a mean lies: of the middle of its step.
[[nodiscard]] inline std::uint64_t content_step(std::uint32_t sum, std::uint32_t points) {
  constexpr std::uint32_t half_steps = 2 * PackedVoxel::offset_steps / content_steps;
  // 2^32 / (half_steps * n), rounded up, for n points: with dividends below 2^17 and divisors below
  // 2^14, the product's upper word is the quotient.
  static constexpr auto reciprocal_of_points = [] {
    std::array<std::uint64_t, PackedVoxel::max_mean_points + 1> reciprocals{};
    for (std::uint64_t n = 1; n < reciprocals.size(); ++n)
      reciprocals[n] = ((std::uint64_t{1} << 32) - 1) / (half_steps * n) + 1;
    return reciprocals;
  }();
  return (2 * sum + points) * reciprocal_of_points[points] >> 32;
}

/// What a client sees of a voxel, in one word: 48 bits of index, three times 3 bits of mean, 5 bits
/// of class.
[[nodiscard]] inline std::uint64_t content_word(const PackedVoxel& voxel) {
  const std::uint32_t points = voxel.mean_points();
  std::uint64_t mean = 0;
  for (const std::uint32_t sum : voxel.offset_sum) {
    mean = mean * content_steps + content_step(sum, points);
  }
  const VoxelIndex index = voxel_index(voxel.key);
  return std::uint64_t{index.x} << 48 | std::uint64_t{index.y} << 32 |
         std::uint64_t{static_cast<std::uint16_t>(index.z)} << 16 | mean << 5 |
         static_cast<std::uint64_t>(voxel.evidence.winner());
}

/// The voxel without its times. The mean of a packed voxel leads to the same packed voxel again,
/// where a float is fine enough. A mean outside of the voxel is moved to its face.
[[nodiscard]] PackedVoxel pack(const Voxel& voxel, TileId tile, const VoxelGrid& grid);

/// When voxels were seen: numbers of stamps in a table.
struct SeenTimes {
  /// Ascending, each once.
  std::vector<std::int64_t> stamps_ns;
  /// For each voxel two: first seen, last seen.
  std::vector<std::uint32_t> stamp_of;
};

/// Table and numbers for these stamps.
[[nodiscard]] SeenTimes seen_times(std::span<const std::int64_t> stamps_ns);

/// The voxels of a tile, immutable, in some 22 bytes each: 20 and the numbers of two stamps in as
/// many bits as the tile has different ones. They are read by value. A copy costs one pointer, and
/// no voxels take no more.
class PackedVoxels {
 public:
  using const_iterator = IndexedIterator<PackedVoxels>;
  using iterator = const_iterator;
  using value_type = Voxel;

  PackedVoxels() = default;
  PackedVoxels(TileId tile, const VoxelGrid& grid, std::span<const Voxel> voxels);
  /// `seen` has two stamps for each voxel, all of them in its table.
  PackedVoxels(TileId tile, const VoxelGrid& grid, std::vector<PackedVoxel> voxels,
               const SeenTimes& seen);

  [[nodiscard]] std::size_t size() const { return content_ ? content_->voxels.size() : 0; }
  [[nodiscard]] bool empty() const { return size() == 0; }
  [[nodiscard]] Voxel operator[](std::size_t position) const {
    const Content& content = *content_;
    const PackedVoxel& packed = content.voxels[position];
    return {.index = voxel_index(packed.key),
            .point_count = packed.point_count,
            .mean_map = stillmap::mean_map(packed, content.tile, content.grid),
            .evidence = packed.evidence,
            .first_seen_ns = content.stamps_ns[content.stamp_of(2 * position)],
            .last_seen_ns = content.stamps_ns[content.stamp_of(2 * position + 1)]};
  }
  [[nodiscard]] Voxel front() const { return (*this)[0]; }
  [[nodiscard]] Voxel back() const { return (*this)[size() - 1]; }
  [[nodiscard]] const_iterator begin() const { return {this, 0}; }
  [[nodiscard]] const_iterator end() const { return {this, size()}; }

  [[nodiscard]] std::span<const PackedVoxel> packed() const {
    return content_ ? std::span<const PackedVoxel>(content_->voxels)
                    : std::span<const PackedVoxel>();
  }
  /// Ascending, each once.
  [[nodiscard]] std::span<const std::int64_t> stamps_ns() const {
    return content_ ? std::span<const std::int64_t>(content_->stamps_ns)
                    : std::span<const std::int64_t>();
  }
  /// Numbers of the voxel's stamps.
  [[nodiscard]] std::uint32_t first_stamp(std::size_t position) const {
    return content_->stamp_of(2 * position);
  }
  [[nodiscard]] std::uint32_t last_stamp(std::size_t position) const {
    return content_->stamp_of(2 * position + 1);
  }
  /// Of the tile.
  [[nodiscard]] VoxelGrid grid() const { return content_ ? content_->grid : VoxelGrid(1.0, 1.0); }

  /// Smallest box around the means, map frame [m]; empty without voxels.
  [[nodiscard]] Eigen::AlignedBox3f bounds_map() const;

  /// The first ones.
  [[nodiscard]] PackedVoxels first(std::size_t count) const;

  /// On the heap.
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  static constexpr unsigned word_bits = 64;

  struct Content {
    TileId tile;
    VoxelGrid grid;
    std::vector<PackedVoxel> voxels;
    std::vector<std::int64_t> stamps_ns;
    /// Numbers of stamps, two for each voxel, `stamp_bits` each.
    std::vector<std::uint64_t> stamp_words;
    unsigned stamp_bits = 0;

    [[nodiscard]] std::uint32_t stamp_of(std::size_t i) const {
      if (stamp_bits == 0) return 0;
      const std::size_t bit = i * stamp_bits;
      const std::size_t word = bit / word_bits;
      const std::size_t shift = bit % word_bits;
      std::uint64_t stamp = stamp_words[word] >> shift;
      if (shift + stamp_bits > word_bits) stamp |= stamp_words[word + 1] << (word_bits - shift);
      return static_cast<std::uint32_t>(stamp & ((std::uint64_t{1} << stamp_bits) - 1));
    }
    void set_stamps(const SeenTimes& seen);
  };

  /// Null where nothing was put in.
  std::shared_ptr<const Content> content_;
};

}  // namespace stillmap
