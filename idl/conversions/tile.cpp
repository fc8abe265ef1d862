#include "idl/conversions/tile.hpp"

#include <algorithm>

#include "idl/interface/topics.hpp"

namespace stillmap::wire {
namespace {

stillmap_msgs::msg::TileState to_state(const TileInfo& info) {
  stillmap_msgs::msg::TileState state;
  state.revision(info.revision);
  state.content_hash(info.content_hash);
  state.min_x(info.bounds_map.min().x());
  state.min_y(info.bounds_map.min().y());
  state.min_z(info.bounds_map.min().z());
  state.max_x(info.bounds_map.max().x());
  state.max_y(info.bounds_map.max().y());
  state.max_z(info.bounds_map.max().z());
  state.voxel_count(info.voxel_count);
  return state;
}

TileInfo from_state(TileId id, const stillmap_msgs::msg::TileState& state) {
  return {.id = id,
          .revision = state.revision(),
          .content_hash = state.content_hash(),
          .bounds_map =
              Eigen::AlignedBox3f(Eigen::Vector3f(state.min_x(), state.min_y(), state.min_z()),
                                  Eigen::Vector3f(state.max_x(), state.max_y(), state.max_z())),
          .voxel_count = state.voxel_count()};
}

void set_voxel(std::size_t i, const Voxel& voxel, stillmap_msgs::msg::MapTile& message) {
  message.index_x()[i] = voxel.index.x;
  message.index_y()[i] = voxel.index.y;
  message.index_z()[i] = voxel.index.z;
  auto& voxels = message.voxels();
  voxels.x()[i] = voxel.mean_map.x();
  voxels.y()[i] = voxel.mean_map.y();
  voxels.z()[i] = voxel.mean_map.z();
  voxels.label()[i] = static_cast<std::uint8_t>(voxel.evidence.winner());
  voxels.confidence()[i] = voxel.evidence.share();
  voxels.point_count()[i] = voxel.point_count;
}

Voxel voxel_at(const stillmap_msgs::msg::MapTile& message, std::size_t i) {
  const auto& voxels = message.voxels();
  Voxel voxel;
  voxel.index = {message.index_x()[i], message.index_y()[i], message.index_z()[i]};
  voxel.point_count = voxels.point_count()[i];
  voxel.mean_map = {voxels.x()[i], voxels.y()[i], voxels.z()[i]};
  voxel.evidence.add(static_cast<SemanticClass>(voxels.label()[i]), voxels.confidence()[i]);
  return voxel;
}

/// Nothing for sizes that no map has.
std::optional<VoxelGrid> grid_of(const stillmap_msgs::msg::MapIdentity& identity) {
  const double columns = identity.tile_size_m() / identity.voxel_size_m();
  if (!(identity.voxel_size_m() > 0.0 && columns >= 0.5 &&
        columns <= VoxelGrid::max_columns + 0.5)) {
    return std::nullopt;
  }
  return VoxelGrid(identity.voxel_size_m(), identity.tile_size_m());
}

bool is_in_a_tile(const Voxel& voxel) {
  return voxel.index.x < VoxelGrid::max_columns && voxel.index.y < VoxelGrid::max_columns &&
         voxel.mean_map.allFinite();
}

}  // namespace

dds::MapIdentity identity_of(const MapSnapshot& view) {
  return {.version = view.version,
          .map_id = view.map_id,
          .tile_size_m = view.tile_size_m,
          .voxel_size_m = view.voxel_size_m};
}

stillmap_msgs::msg::MapIdentity to_wire(const dds::MapIdentity& identity) {
  stillmap_msgs::msg::MapIdentity message;
  message.map_id(identity.map_id);
  message.map_version(identity.version);
  message.tile_size_m(identity.tile_size_m);
  message.voxel_size_m(identity.voxel_size_m);
  return message;
}

dds::MapIdentity from_wire(const stillmap_msgs::msg::MapIdentity& identity) {
  return {.version = identity.map_version(),
          .map_id = identity.map_id(),
          .tile_size_m = identity.tile_size_m(),
          .voxel_size_m = identity.voxel_size_m()};
}

stillmap_msgs::msg::TileInfo to_wire(const TileInfo& info, const dds::MapIdentity& identity) {
  stillmap_msgs::msg::TileInfo message;
  message.format_version(dds::wire_format_version);
  message.tile_x(info.id.x);
  message.tile_y(info.id.y);
  message.identity(to_wire(identity));
  message.state(to_state(info));
  return message;
}

std::optional<TileInfo> from_wire(const stillmap_msgs::msg::TileInfo& message) {
  if (message.format_version() != dds::wire_format_version) return std::nullopt;
  return from_state({message.tile_x(), message.tile_y()}, message.state());
}

stillmap_msgs::msg::MapTile to_wire(const Tile& tile, const dds::MapIdentity& identity) {
  stillmap_msgs::msg::MapTile message;
  message.format_version(dds::wire_format_version);
  message.tile_x(tile.info.id.x);
  message.tile_y(tile.info.id.y);
  message.identity(to_wire(identity));
  message.state(to_state(tile.info));
  const std::size_t count = tile.voxels.size();
  message.index_x().resize(count);
  message.index_y().resize(count);
  message.index_z().resize(count);
  resize(message.voxels(), count);
  for (std::size_t i = 0; i < count; ++i) set_voxel(i, tile.voxels[i], message);
  return message;
}

std::optional<Tile> from_wire(const stillmap_msgs::msg::MapTile& message) {
  const std::size_t count = message.voxels().x().size();
  if (message.format_version() != dds::wire_format_version || !consistent(message.voxels()) ||
      message.index_x().size() != count || message.index_y().size() != count ||
      message.index_z().size() != count) {
    return std::nullopt;
  }
  const auto grid = grid_of(message.identity());
  if (!grid) return std::nullopt;
  std::vector<Voxel> voxels;
  voxels.reserve(count);
  for (std::size_t i = 0; i < count; ++i) voxels.push_back(voxel_at(message, i));
  if (!std::ranges::all_of(voxels, is_in_a_tile)) return std::nullopt;
  const TileId id{message.tile_x(), message.tile_y()};
  return Tile{from_state(id, message.state()), PackedVoxels(id, *grid, voxels)};
}

void resize(stillmap_msgs::msg::Voxels& voxels, std::size_t count) {
  voxels.x().resize(count);
  voxels.y().resize(count);
  voxels.z().resize(count);
  voxels.label().resize(count);
  voxels.confidence().resize(count);
  voxels.point_count().resize(count);
}

bool consistent(const stillmap_msgs::msg::Voxels& voxels) {
  const std::size_t count = voxels.x().size();
  return voxels.y().size() == count && voxels.z().size() == count &&
         voxels.label().size() == count && voxels.confidence().size() == count &&
         voxels.point_count().size() == count &&
         std::ranges::all_of(voxels.label(),
                             [](std::uint8_t label) { return label < semantic_class_count; });
}

}  // namespace stillmap::wire
