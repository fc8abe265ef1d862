#include "core/map/tile_evidence.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "core/map/storage/byte_planes.hpp"
#include "core/map/storage/stored_voxel.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "core/map/storage/tile_frame.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

constexpr std::uint8_t format_version = 1;
constexpr std::size_t header_bytes = 4 + 4 + 3 * 4;
constexpr std::size_t past_bytes = 2 + 2 + 1;
constexpr std::size_t hidden_bytes = stored_voxel_bytes + past_bytes + 1;
constexpr std::size_t excluded_bytes = 3 * 2 + 1 + 1 + 8;
/// Stands for no reason.
constexpr std::uint8_t no_reason = 255;

enum Flag : std::uint8_t { was_shown_flag = 1, is_restored_flag = 2 };

using Counts = std::array<std::uint32_t, 3>;

/// As they are stored: plain numbers.
struct StoredPast {
  std::uint16_t hits = 0;
  std::uint16_t passes = 0;
  std::uint8_t flags = 0;
};
struct StoredHidden {
  Voxel voxel;
  StoredPast past;
  std::uint8_t reason = no_reason;
};
struct StoredExcluded {
  VoxelIndex index;
  std::uint8_t label = 0;
  std::uint8_t was_moving = 0;
  std::int64_t last_seen_ns = 0;
};

constexpr auto visit_past = [](auto&& visit, auto& past) {
  visit(past.hits);
  visit(past.passes);
  visit(past.flags);
};
constexpr auto visit_hidden = [](auto&& visit, auto& hidden) {
  visit_voxel(visit, hidden.voxel);
  visit_past(visit, hidden.past);
  visit(hidden.reason);
};
constexpr auto visit_excluded = [](auto&& visit, auto& excluded) {
  visit(excluded.index.x);
  visit(excluded.index.y);
  visit(excluded.index.z);
  visit(excluded.label);
  visit(excluded.was_moving);
  visit(excluded.last_seen_ns);
};

StoredPast to_stored(const VoxelPast& past) {
  const int flags =
      (past.was_shown ? was_shown_flag : 0) | (past.is_restored ? is_restored_flag : 0);
  return {past.hits, past.passes, static_cast<std::uint8_t>(flags)};
}

StoredHidden to_stored(const HiddenVoxel& hidden) {
  return {hidden.voxel, to_stored(hidden.past),
          hidden.reason ? static_cast<std::uint8_t>(*hidden.reason) : no_reason};
}

StoredExcluded to_stored(const ExcludedPlace& excluded) {
  return {excluded.index, static_cast<std::uint8_t>(excluded.label),
          static_cast<std::uint8_t>(excluded.was_moving ? 1 : 0), excluded.last_seen_ns};
}

VoxelPast from_stored(const StoredPast& stored) {
  if (stored.flags > (was_shown_flag | is_restored_flag)) throw TileCodecError("has unknown flags");
  return {stored.hits, stored.passes, (stored.flags & was_shown_flag) != 0,
          (stored.flags & is_restored_flag) != 0};
}

HiddenVoxel from_stored(const StoredHidden& stored) {
  if (!is_possible(stored.voxel)) throw TileCodecError("has an impossible hidden voxel");
  HiddenVoxel hidden{stored.voxel, from_stored(stored.past), std::nullopt};
  if (stored.reason == no_reason) return hidden;
  if (stored.reason >= removal_reason_count) throw TileCodecError("has an unknown reason");
  hidden.reason = static_cast<RemovalReason>(stored.reason);
  return hidden;
}

ExcludedPlace from_stored(const StoredExcluded& stored) {
  if (stored.index.x >= VoxelGrid::max_columns || stored.index.y >= VoxelGrid::max_columns ||
      stored.label >= semantic_class_count || stored.was_moving > 1) {
    throw TileCodecError("has an impossible excluded place");
  }
  return {stored.index, static_cast<SemanticClass>(stored.label), stored.was_moving == 1,
          stored.last_seen_ns};
}

template <typename Stored, typename Value>
std::vector<Stored> all_to_stored(const std::vector<Value>& values) {
  std::vector<Stored> stored(values.size());
  std::ranges::transform(values, stored.begin(), [](const Value& v) { return to_stored(v); });
  return stored;
}

/// Reads one list and moves on behind it.
template <std::size_t record_bytes, typename Stored, typename Value, typename Visit>
void read_list(const std::uint8_t*& from, std::uint32_t count, std::vector<Value>& values,
               Visit visit) {
  std::vector<Stored> stored(count);
  read_planes<record_bytes>(from, stored, visit);
  from += count * record_bytes;
  values.resize(count);
  std::ranges::transform(stored, values.begin(), [](const Stored& s) { return from_stored(s); });
}

template <typename Visitor, typename Id, typename AnyCounts>
void visit_header(Visitor visit, Id& id, AnyCounts& counts) {
  visit(id.x);
  visit(id.y);
  for (auto& count : counts) visit(count);
}

}  // namespace

std::vector<RemovedVoxel> removed_voxels(const TileMemory& memory, double voxel_size_m,
                                         double tile_size_m) {
  const VoxelGrid grid(voxel_size_m, tile_size_m);
  std::vector<RemovedVoxel> removed;
  for (const HiddenVoxel& hidden : memory.hidden) {
    if (!hidden.reason) continue;
    removed.push_back({hidden.voxel.mean_map, hidden.voxel.evidence.winner(), *hidden.reason,
                       hidden.voxel.last_seen_ns});
  }
  for (const ExcludedPlace& place : memory.excluded) {
    const Eigen::Vector3d centre =
        grid.corner_map(memory.id, place.index).array() + 0.5 * voxel_size_m;
    removed.push_back({centre.cast<float>(), place.label,
                       place.was_moving ? RemovalReason::moving : RemovalReason::semi_static,
                       place.last_seen_ns});
  }
  return removed;
}

std::vector<std::uint8_t> encode_memory(const TileMemory& memory) {
  std::vector<std::uint8_t> content(header_bytes);
  const Counts counts{static_cast<std::uint32_t>(memory.shown.size()),
                      static_cast<std::uint32_t>(memory.hidden.size()),
                      static_cast<std::uint32_t>(memory.excluded.size())};
  visit_header(FieldWriter(content.data()), memory.id, counts);
  append_planes<past_bytes>(content, all_to_stored<StoredPast>(memory.shown), visit_past);
  append_planes<hidden_bytes>(content, all_to_stored<StoredHidden>(memory.hidden), visit_hidden);
  append_planes<excluded_bytes>(content, all_to_stored<StoredExcluded>(memory.excluded),
                                visit_excluded);
  return to_frame(format_version, content);
}

TileMemory decode_memory(std::span<const std::uint8_t> bytes) {
  const std::vector<std::uint8_t> content = from_frame(format_version, bytes, header_bytes);
  TileMemory memory;
  Counts counts{};
  visit_header(FieldReader(content.data()), memory.id, counts);
  const std::size_t needed = header_bytes + std::size_t{counts[0]} * past_bytes +
                             std::size_t{counts[1]} * hidden_bytes +
                             std::size_t{counts[2]} * excluded_bytes;
  if (content.size() != needed) {
    throw TileCodecError("has a memory of " + std::to_string(content.size()) +
                         " bytes instead of " + std::to_string(needed));
  }
  const std::uint8_t* from = content.data() + header_bytes;
  read_list<past_bytes, StoredPast>(from, counts[0], memory.shown, visit_past);
  read_list<hidden_bytes, StoredHidden>(from, counts[1], memory.hidden, visit_hidden);
  read_list<excluded_bytes, StoredExcluded>(from, counts[2], memory.excluded, visit_excluded);
  return memory;
}

}  // namespace stillmap
