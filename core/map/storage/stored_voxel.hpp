#pragma once

#include <cstddef>

#include "core/map/tile.hpp"

namespace stillmap {

inline constexpr std::size_t stored_voxel_bytes =
    3 * 2 + 4 + 3 * 4 + ClassEvidence::candidates * (1 + 4) + 16;

/// Every field of a voxel, in the order in which it is stored.
template <typename Visitor, typename AnyVoxel>
void visit_voxel(Visitor&& visit, AnyVoxel& voxel) {
  visit(voxel.index.x);
  visit(voxel.index.y);
  visit(voxel.index.z);
  visit(voxel.point_count);
  for (int axis = 0; axis < 3; ++axis) visit(voxel.mean_map[axis]);
  for (auto& vote : voxel.evidence.votes) {
    visit(vote.label);
    visit(vote.weight);
  }
  visit(voxel.first_seen_ns);
  visit(voxel.last_seen_ns);
}

/// Whether a voxel that was read can be one that was written.
[[nodiscard]] bool is_possible(const Voxel& voxel);

}  // namespace stillmap
