#include "clients/gateway/tile_format.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>
#include <span>
#include <vector>

#include "core/map/packed_voxels.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap::gateway {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr double steps_per_voxel = 8.0;

struct Head {
  char magic[4] = {'S', 'T', 'L', '1'};
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::uint32_t voxels = 0;
  float tile_size_m = 0.0F;
  float voxel_size_m = 0.0F;
  float min_z_m = 0.0F;
  std::uint32_t reserved = 0;
};
static_assert(sizeof(Head) == 32);

/// Well-mixed bits of a voxel's key (Stafford's variant 13 of MurmurHash3's finaliser).
std::uint64_t mixed(std::uint64_t key) {
  key = (key ^ (key >> 30U)) * 0xbf58476d1ce4e5b9U;
  key = (key ^ (key >> 27U)) * 0x94d049bb133111ebU;
  return key ^ (key >> 31U);
}

std::vector<std::uint32_t> spread_order(std::span<const PackedVoxel> voxels) {
  std::vector<std::uint64_t> rank(voxels.size());
  for (std::size_t i = 0; i < voxels.size(); ++i) rank[i] = mixed(voxels[i].key);
  std::vector<std::uint32_t> order(voxels.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::sort(order, {}, [&](std::uint32_t i) { return rank[i]; });
  return order;
}

std::uint16_t steps(double distance_m, double voxel_size_m) {
  const double value = std::round(distance_m / voxel_size_m * steps_per_voxel);
  return static_cast<std::uint16_t>(std::clamp(value, 0.0, 65535.0));
}

}  // namespace

std::string encode_tile(const Tile& tile, const dds::MapIdentity& map) {
  const VoxelGrid grid(map.voxel_size_m, map.tile_size_m);
  const std::span<const PackedVoxel> voxels = tile.voxels.packed();
  const std::size_t count = voxels.size();
  Head head{.x = tile.info.id.x,
            .y = tile.info.id.y,
            .voxels = static_cast<std::uint32_t>(count),
            .tile_size_m = static_cast<float>(map.tile_size_m),
            .voxel_size_m = static_cast<float>(map.voxel_size_m),
            .min_z_m = count == 0 ? 0.0F : tile.info.bounds_map.min().z()};
  std::string bytes(sizeof(Head) + count * 4 * sizeof(std::uint16_t), '\0');
  std::memcpy(bytes.data(), &head, sizeof(Head));
  const double corner_x = tile.info.id.x * map.tile_size_m;
  const double corner_y = tile.info.id.y * map.tile_size_m;
  char* to = bytes.data() + sizeof(Head);
  for (const std::uint32_t i : spread_order(voxels)) {
    const PackedVoxel& voxel = voxels[i];
    const Eigen::Vector3f mean = mean_map(voxel, tile.info.id, grid);
    const std::array<std::uint16_t, 4> values{steps(mean.x() - corner_x, map.voxel_size_m),
                                              steps(mean.y() - corner_y, map.voxel_size_m),
                                              steps(mean.z() - head.min_z_m, map.voxel_size_m),
                                              static_cast<std::uint16_t>(voxel.evidence.winner())};
    std::memcpy(to, values.data(), sizeof(values));
    to += sizeof(values);
  }
  return bytes;
}

}  // namespace stillmap::gateway
