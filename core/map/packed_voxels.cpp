#include "core/map/packed_voxels.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>

namespace stillmap {
namespace {

/// The sum of offsets whose mean is nearest to `offset` [voxels].
std::uint16_t offset_sum(double offset, std::uint32_t points) {
  const double most = (PackedVoxel::offset_steps - 1.0) * points;
  const double wanted = (offset * PackedVoxel::offset_steps - 0.5) * points;
  return static_cast<std::uint16_t>(std::lround(std::clamp(wanted, 0.0, most)));
}

}  // namespace

PackedVoxel pack(const Voxel& voxel, TileId tile, const VoxelGrid& grid) {
  constexpr std::uint32_t most = std::numeric_limits<std::uint16_t>::max();
  PackedVoxel packed;
  packed.key = voxel_key(voxel.index);
  packed.point_count =
      static_cast<std::uint16_t>(std::clamp(voxel.point_count, std::uint32_t{1}, most));
  packed.evidence = voxel.evidence;
  const Eigen::Vector3d offset =
      (voxel.mean_map.cast<double>() - grid.corner_map(tile, voxel.index)) / grid.voxel_size_m();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    packed.offset_sum.at(axis) =
        offset_sum(offset[static_cast<Eigen::Index>(axis)], packed.mean_points());
  }
  return packed;
}

SeenTimes seen_times(std::span<const std::int64_t> stamps_ns) {
  SeenTimes seen;
  seen.stamps_ns.assign(stamps_ns.begin(), stamps_ns.end());
  std::ranges::sort(seen.stamps_ns);
  // std::ranges::unique is nothing for clang 14, which compiles the fuzz targets.
  seen.stamps_ns.erase(std::unique(seen.stamps_ns.begin(), seen.stamps_ns.end()),
                       seen.stamps_ns.end());
  seen.stamp_of.reserve(stamps_ns.size());
  for (const std::int64_t stamp_ns : stamps_ns) {
    seen.stamp_of.push_back(static_cast<std::uint32_t>(
        std::ranges::lower_bound(seen.stamps_ns, stamp_ns) - seen.stamps_ns.begin()));
  }
  return seen;
}

PackedVoxels::PackedVoxels(TileId tile, const VoxelGrid& grid, std::span<const Voxel> voxels) {
  std::vector<PackedVoxel> packed;
  std::vector<std::int64_t> stamps_ns;
  packed.reserve(voxels.size());
  stamps_ns.reserve(2 * voxels.size());
  for (const Voxel& voxel : voxels) {
    packed.push_back(pack(voxel, tile, grid));
    stamps_ns.push_back(voxel.first_seen_ns);
    stamps_ns.push_back(voxel.last_seen_ns);
  }
  *this = PackedVoxels(tile, grid, std::move(packed), seen_times(stamps_ns));
}

PackedVoxels::PackedVoxels(TileId tile, const VoxelGrid& grid, std::vector<PackedVoxel> voxels,
                           const SeenTimes& seen) {
  auto content = std::make_shared<Content>(Content{
      .tile = tile, .grid = grid, .voxels = std::move(voxels), .stamps_ns = {}, .stamp_words = {}});
  content->set_stamps(seen);
  content_ = std::move(content);
}

void PackedVoxels::Content::set_stamps(const SeenTimes& seen) {
  assert(seen.stamp_of.size() == 2 * voxels.size());
  stamps_ns = seen.stamps_ns;
  stamp_bits =
      static_cast<unsigned>(std::bit_width(std::max<std::size_t>(stamps_ns.size(), 1) - 1));
  stamp_words.assign((seen.stamp_of.size() * stamp_bits + word_bits - 1) / word_bits, 0);
  if (stamp_bits == 0) return;
  auto word = stamp_words.begin();
  std::uint64_t bits = 0;
  unsigned filled = 0;
  for (const std::uint64_t stamp : seen.stamp_of) {
    bits |= stamp << filled;
    filled += stamp_bits;
    if (filled < word_bits) continue;
    *word++ = bits;
    filled -= word_bits;
    bits = filled > 0 ? stamp >> (stamp_bits - filled) : 0;
  }
  if (filled > 0) *word = bits;
}

Eigen::AlignedBox3f PackedVoxels::bounds_map() const {
  if (empty()) return {};
  // A mean lies within its voxel: those at the sides are enough. Fields are compared where they lie
  // in the key, columns, rows, layers.
  constexpr std::array<std::uint32_t, 3> fields = {0xFF000000U, 0x00FF0000U, 0x0000FFFFU};
  std::array<std::uint32_t, 3> first = fields;
  std::array<std::uint32_t, 3> last{};
  for (const PackedVoxel& voxel : content_->voxels) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      first[axis] = std::min(first[axis], voxel.key & fields[axis]);
      last[axis] = std::max(last[axis], voxel.key & fields[axis]);
    }
  }
  Eigen::Array3d least = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array3d most = -least;
  for (const PackedVoxel& voxel : content_->voxels) {
    bool is_at_side = false;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t place = voxel.key & fields[axis];
      is_at_side |= place == first[axis] || place == last[axis];
    }
    if (!is_at_side) continue;
    const Eigen::Array3d mean = mean_voxels(voxel, content_->tile, content_->grid);
    least = least.min(mean);
    most = most.max(mean);
  }
  // To metres and floats at the end: rounding keeps order.
  const double size_m = content_->grid.voxel_size_m();
  return {(size_m * least).matrix().cast<float>(), (size_m * most).matrix().cast<float>()};
}

PackedVoxels PackedVoxels::first(std::size_t count) const {
  if (!content_) return {};
  std::vector<std::int64_t> first_stamps_ns;
  for (std::size_t i = 0; i < count; ++i) {
    first_stamps_ns.push_back(content_->stamps_ns[first_stamp(i)]);
    first_stamps_ns.push_back(content_->stamps_ns[last_stamp(i)]);
  }
  const auto begin = content_->voxels.begin();
  return {content_->tile, content_->grid,
          std::vector<PackedVoxel>(begin, begin + static_cast<std::ptrdiff_t>(count)),
          seen_times(first_stamps_ns)};
}

std::size_t PackedVoxels::memory_bytes() const {
  if (!content_) return 0;
  return sizeof(Content) + content_->voxels.capacity() * sizeof(PackedVoxel) +
         content_->stamps_ns.capacity() * sizeof(std::int64_t) +
         content_->stamp_words.capacity() * sizeof(std::uint64_t);
}

}  // namespace stillmap
