#include "core/odometry/voxel_downsample.hpp"

#include <bit>

namespace stillmap {
namespace {

constexpr std::uint64_t unused = ~std::uint64_t{0};

std::uint64_t cube_of(const Eigen::Vector3f& point, float inverse_spacing) {
  const Eigen::Array3i cube = (point.array() * inverse_spacing).floor().cast<int>();
  constexpr std::uint64_t mask = (1U << 21) - 1;
  const auto part = [](int v) { return static_cast<std::uint64_t>(v) & mask; };
  return part(cube.x()) << 42 | part(cube.y()) << 21 | part(cube.z());
}

}  // namespace

std::vector<std::uint32_t> voxel_downsample(std::span<const Eigen::Vector3f> points,
                                            std::span<const std::uint32_t> chosen,
                                            double spacing_m) {
  // An open-addressing set of its own: it is filled once and thrown away, so it needs neither
  // growth nor deletion.
  const std::size_t slots = std::bit_ceil(2 * chosen.size() + 1);
  std::vector<std::uint64_t> taken(slots, unused);
  const auto inverse_spacing = static_cast<float>(1.0 / spacing_m);
  std::vector<std::uint32_t> kept;
  kept.reserve(chosen.size() / 2);
  for (const std::uint32_t i : chosen) {
    const std::uint64_t cube = cube_of(points[i], inverse_spacing);
    std::size_t slot = (cube * 0x9e3779b97f4a7c15ULL) >> 20 & (slots - 1);
    while (taken[slot] != unused && taken[slot] != cube) slot = (slot + 1) & (slots - 1);
    if (taken[slot] == cube) continue;
    taken[slot] = cube;
    kept.push_back(i);
  }
  return kept;
}

}  // namespace stillmap
