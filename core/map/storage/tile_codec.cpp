#include "core/map/storage/tile_codec.hpp"

#include <algorithm>
#include <bit>
#include <string>

#include "core/map/storage/byte_planes.hpp"
#include "core/map/storage/stored_voxel.hpp"
#include "core/map/storage/tile_frame.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

static_assert(std::endian::native == std::endian::little,
              "fields are copied as they lie in memory");

constexpr std::uint8_t format_version = 1;
constexpr std::size_t header_bytes = 4 + 4 + 8 + 8 + 4;

template <typename Visitor, typename Info>
void visit_header(Visitor visit, Info& info) {
  visit(info.id.x);
  visit(info.id.y);
  visit(info.revision);
  visit(info.content_hash);
  visit(info.voxel_count);
}

constexpr auto visit_fields = [](auto visit, auto& voxel) { visit_voxel(visit, voxel); };

Tile from_content(const std::vector<std::uint8_t>& content) {
  Tile tile;
  visit_header(FieldReader(content.data()), tile.info);
  const std::size_t count = tile.info.voxel_count;
  if (content.size() != header_bytes + count * stored_voxel_bytes) {
    throw TileCodecError("has " + std::to_string(content.size()) + " bytes for " +
                         std::to_string(count) + " voxels");
  }
  tile.voxels.resize(count);
  read_planes<stored_voxel_bytes>(content.data() + header_bytes, tile.voxels, visit_fields);
  for (const Voxel& voxel : tile.voxels) tile.info.bounds_map.extend(voxel.mean_map);
  return tile;
}

}  // namespace

bool is_possible(const Voxel& voxel) {
  return voxel.index.x < VoxelGrid::max_columns && voxel.index.y < VoxelGrid::max_columns &&
         voxel.point_count > 0 && voxel.mean_map.allFinite() &&
         std::ranges::all_of(voxel.evidence.votes, [](const ClassEvidence::Vote& vote) {
           return static_cast<std::size_t>(vote.label) < semantic_class_count &&
                  vote.weight >= 0.0F && vote.weight <= ClassEvidence::max_total * 2.0F;
         });
}

std::vector<std::uint8_t> encode_tile(const Tile& tile) {
  std::vector<std::uint8_t> content(header_bytes);
  visit_header(FieldWriter(content.data()), tile.info);
  append_planes<stored_voxel_bytes>(content, tile.voxels, visit_fields);
  return to_frame(format_version, content);
}

Tile decode_tile(std::span<const std::uint8_t> bytes) {
  Tile tile = from_content(from_frame(format_version, bytes, header_bytes));
  if (!std::ranges::all_of(tile.voxels, is_possible)) {
    throw TileCodecError("has an impossible voxel");
  }
  const auto not_ascending = [](const Voxel& a, const Voxel& b) { return a.index >= b.index; };
  if (std::ranges::adjacent_find(tile.voxels, not_ascending) != tile.voxels.end()) {
    throw TileCodecError("has voxels out of order");
  }
  return tile;
}

}  // namespace stillmap
