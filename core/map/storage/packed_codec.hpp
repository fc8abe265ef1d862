#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/map/packed_voxels.hpp"
#include "core/map/storage/byte_planes.hpp"

namespace stillmap {

/// Keys of voxels in ascending order as small numbers: neighbours lie a column on, at much the same
/// height, or on top of each other.
class KeySteps {
 public:
  struct Step {
    std::uint16_t columns = 0;
    /// Layers above the voxel below; in another column, from the lowest layer of the last one, in
    /// zigzag.
    std::uint16_t layers = 0;
  };
  [[nodiscard]] Step step_to(std::uint32_t key);
  /// The inverse. Any steps give a key, not always a greater one.
  [[nodiscard]] std::uint32_t key_at(const Step& step);

 private:
  void move_to(std::uint16_t column, std::uint16_t layer);

  std::uint16_t column_ = 0;
  std::uint16_t layer_ = 0x7FFF;
  std::uint16_t lowest_layer_ = 0x8000;
};

/// Stamps, ascending, by what they differ: eight bytes each.
void append_stamps(PlaneBytes& content, std::span<const std::int64_t> stamps_ns);
/// Throws TileCodecError for stamps that do not ascend. `from` has enough bytes and moves on behind
/// them.
[[nodiscard]] std::vector<std::int64_t> read_stamps(const std::uint8_t*& from, std::size_t count);

inline constexpr std::size_t stamp_bytes = 8;
inline constexpr std::size_t packed_voxel_bytes = 2 * 2 + 3 + 3 + 2 + 4 * 2 + 2 * 4;

/// How the votes for a voxel's first candidate class are stored.
enum class FirstVotes : std::uint8_t {
  as_they_are,
  /// What all votes lack to one confident vote for each point, in a circle: nothing for most voxels
  /// of a data set with labels.
  by_what_lacks,
};

/// The voxels by byte planes, without the table of stamps; their first votes by what lacks.
void append_voxels(PlaneBytes& content, const PackedVoxels& voxels);
/// Throws TileCodecError for voxels that append_voxels did not write. `from` has enough bytes for
/// `count` and moves on behind them.
[[nodiscard]] PackedVoxels read_voxels(const std::uint8_t*& from, std::size_t count,
                                       std::vector<std::int64_t> stamps_ns, TileId tile,
                                       const VoxelGrid& grid, FirstVotes first_votes);

}  // namespace stillmap
