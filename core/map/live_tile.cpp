#include "core/map/live_tile.hpp"

#include <algorithm>
#include <cassert>
#include <limits>
#include <numeric>
#include <type_traits>
#include <utility>

#include "core/lidar/prefetch.hpp"
#include "core/map/tile.hpp"

namespace stillmap {
namespace {

/// Misses of a voxel are counted up to here.
constexpr std::uint16_t max_misses = 1000;
constexpr int layer_bias = 1 << 15;
/// So many points are looked up before they are added: their voxels are on their way meanwhile.
constexpr std::size_t block_size = 64;

/// Place of a voxel in the index: bricks have 4 columns, 4 rows and 2 layers.
BrickIndex::Part place_of(std::uint32_t voxel_key) {
  constexpr std::uint32_t in_brick = 0x03030001;
  const std::uint32_t cell = voxel_key & in_brick;
  return {voxel_key & ~in_brick, (cell >> 21 | cell >> 15 | cell) & 31U};
}

/// The first format does not store hits: the maximum is assumed, so that the voxel is not cleared
/// too early.
VoxelHistory history_of_shown(const Voxel& voxel) {
  constexpr std::uint32_t most = std::numeric_limits<std::uint16_t>::max();
  return {.hits = static_cast<std::uint16_t>(std::min(voxel.point_count, most)), .was_shown = true};
}

/// Voxels, sorted by index, that only one of the lists has, or that have another class there.
std::size_t changed_voxels(std::span<const Voxel> before, std::span<const Voxel> after) {
  std::size_t changed = 0;
  auto a = before.begin();
  auto b = after.begin();
  while (a != before.end() && b != after.end()) {
    const auto order = a->index <=> b->index;
    if (order != 0 || a->evidence.winner() != b->evidence.winner()) ++changed;
    if (order <= 0) ++a;
    if (order >= 0) ++b;
  }
  return changed + static_cast<std::size_t>((before.end() - a) + (after.end() - b));
}

}  // namespace

std::uint32_t voxel_key(VoxelIndex index) {
  return std::uint32_t{index.x} << 24 | std::uint32_t{index.y} << 16 |
         static_cast<std::uint32_t>(index.z + layer_bias);
}

VoxelIndex voxel_index(std::uint32_t key) {
  return {static_cast<std::uint16_t>(key >> 24), static_cast<std::uint16_t>(key >> 16 & 0xFFU),
          static_cast<std::int16_t>(static_cast<int>(key & 0xFFFFU) - layer_bias)};
}

std::uint32_t LiveTile::find(const TilePoint& point, std::uint32_t& brick, std::int64_t stamp_ns) {
  const std::uint32_t cell = place_of(point.voxel_key).cell;
  const bool may_make_one = point.motion == Motion::stationary;
  if (brick == BrickIndex::none && may_make_one)
    brick = positions_.brick_at(place_of(point.voxel_key).brick_key);
  const std::uint32_t known =
      brick == BrickIndex::none ? BrickIndex::none : positions_.number(brick, cell);
  if (known != BrickIndex::none) return known;
  if (!may_make_one) {
    exclude(point, stamp_ns);
    return BrickIndex::none;
  }
  const auto position = static_cast<std::uint32_t>(voxels_.size());
  positions_.number(brick, cell) = position;
  voxels_.emplace_back().key = point.voxel_key;
  excluded_.erase(point.voxel_key);
  return position;
}

void LiveTile::remember(std::uint32_t voxel_key, std::uint32_t position) {
  const BrickIndex::Part place = place_of(voxel_key);
  std::uint32_t& known = positions_.number(positions_.brick_at(place.brick_key), place.cell);
  if (known == BrickIndex::none) known = position;
}

ClassEvidence LiveTile::evidence(std::uint32_t voxel_key) const {
  const std::uint32_t known = positions_.number(place_of(voxel_key));
  return known == BrickIndex::none ? ClassEvidence() : voxels_[known].evidence;
}

void LiveTile::insert(std::span<const TilePoint> points, std::int64_t stamp_ns) {
  for (std::size_t begin = 0; begin < points.size(); begin += block_size)
    insert_block(points.subspan(begin, std::min(block_size, points.size() - begin)), stamp_ns);
}

void LiveTile::insert_block(std::span<const TilePoint> points, std::int64_t stamp_ns) {
  std::array<std::uint32_t, block_size> positions;
  // Neighbours on a beam mostly share a brick, and often a voxel.
  std::uint64_t brick_key = 0;
  std::uint32_t brick = BrickIndex::none;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const TilePoint* const last = i == 0 ? nullptr : &points[i - 1];
    if (last && last->voxel_key == points[i].voxel_key &&
        (positions[i - 1] != BrickIndex::none ||
         (last->label == points[i].label && last->motion == points[i].motion))) {
      positions[i] = positions[i - 1];
      continue;
    }
    const std::uint64_t key = place_of(points[i].voxel_key).brick_key;
    if (i == 0 || key != brick_key) brick = positions_.find_brick(key);
    brick_key = key;
    positions[i] = find(points[i], brick, stamp_ns);
    if (positions[i] == BrickIndex::none) continue;
    const LiveVoxel& voxel = voxels_[positions[i]];
    prefetch(&voxel);
    prefetch(&voxel + 1);
  }
  for (std::size_t i = 0; i < points.size(); ++i)
    if (positions[i] != BrickIndex::none) hit(voxels_[positions[i]], points[i], stamp_ns);
}

void LiveTile::hit(LiveVoxel& voxel, const TilePoint& point, std::int64_t stamp_ns) {
  // A moving object says nothing about the voxel that it passes.
  if (point.motion == Motion::highly_dynamic) return;
  if (voxel.point_count == 0) voxel.first_seen_ns = stamp_ns;
  const bool is_new_scan = voxel.point_count == 0 || voxel.last_seen_ns != stamp_ns;
  voxel.evidence.add(point.label, point.confidence);
  voxel.last_seen_ns = stamp_ns;
  if (point.motion == Motion::semi_static) return;
  if (is_new_scan && voxel.history.hits < std::numeric_limits<std::uint16_t>::max())
    ++voxel.history.hits;
  if (voxel.point_count < max_mean_points) {
    for (std::size_t axis = 0; axis < 3; ++axis) voxel.offset_sum[axis] += point.offset[axis];
  }
  if (voxel.point_count < std::numeric_limits<std::uint32_t>::max()) ++voxel.point_count;
}

void LiveTile::exclude(const TilePoint& point, std::int64_t stamp_ns) {
  Excluded& excluded = excluded_[point.voxel_key];
  excluded.label = point.label;
  excluded.was_moving |= point.motion == Motion::highly_dynamic;
  excluded.last_seen_ns = stamp_ns;
}

bool LiveTile::clear_seen_through(const std::function<bool(const Eigen::Vector3f&)>& is_free,
                                  std::int64_t stamp_ns, const VisibilityRule& rule,
                                  const VoxelGrid& grid) {
  bool hides_one = false;
  for (LiveVoxel& voxel : voxels_) {
    if (voxel.last_seen_ns == stamp_ns || voxel.history.is_restored) continue;
    if (!is_free(mean_map(voxel, grid))) continue;
    if (voxel.history.misses >= max_misses) {
      // Halved, so that something placed where space was free for long can still become visible.
      voxel.history.misses /= 2;
      voxel.history.hits /= 2;
    }
    const bool was_hidden = is_seen_through(voxel, rule);
    ++voxel.history.misses;
    hides_one |= !was_hidden && is_seen_through(voxel, rule);
  }
  return hides_one;
}

bool LiveTile::is_seen_through(const LiveVoxel& voxel, const VisibilityRule& rule) {
  return !voxel.history.is_restored && voxel.history.misses >= rule.misses_to_clear &&
         voxel.history.misses > rule.misses_per_hit * voxel.history.hits;
}

bool LiveTile::is_shown(const LiveVoxel& voxel, const VisibilityRule& rule) {
  if (voxel.history.is_restored) return true;
  return voxel.point_count >= rule.min_points && !is_movable(voxel.evidence.winner()) &&
         !is_seen_through(voxel, rule);
}

std::optional<RemovalReason> LiveTile::removal(const LiveVoxel& voxel, const VisibilityRule& rule) {
  if (is_shown(voxel, rule) || voxel.point_count < rule.min_points) return std::nullopt;
  if (!is_movable(voxel.evidence.winner())) return RemovalReason::seen_through;
  return voxel.history.was_shown ? RemovalReason::relabelled : RemovalReason::semi_static;
}

void LiveTile::sort_new_voxels() {
  const auto known = static_cast<std::ptrdiff_t>(sorted_.size());
  sorted_.resize(voxels_.size());
  const auto middle = sorted_.begin() + known;
  std::iota(middle, sorted_.end(), static_cast<std::uint32_t>(known));
  const auto by_key = [this](std::uint32_t a, std::uint32_t b) {
    return voxels_[a].key < voxels_[b].key;
  };
  std::sort(middle, sorted_.end(), by_key);
  std::inplace_merge(sorted_.begin(), middle, sorted_.end(), by_key);
}

Eigen::Vector3f LiveTile::mean_map(const LiveVoxel& live, const VoxelGrid& grid) const {
  const Eigen::Vector3d sum(live.offset_sum[0], live.offset_sum[1], live.offset_sum[2]);
  const Eigen::Vector3d steps =
      (sum / std::min(live.point_count, max_mean_points)).array() + 0.5;  // a step's middle
  return (grid.corner_map(id_, voxel_index(live.key)) +
          steps * (grid.voxel_size_m() / offset_steps))
      .cast<float>();
}

Voxel LiveTile::voxel(const LiveVoxel& live, const VoxelGrid& grid) const {
  Voxel voxel;
  voxel.index = voxel_index(live.key);
  voxel.point_count = live.point_count;
  voxel.mean_map = mean_map(live, grid);
  voxel.evidence = live.evidence;
  voxel.first_seen_ns = live.first_seen_ns;
  voxel.last_seen_ns = live.last_seen_ns;
  return voxel;
}

std::vector<Voxel> LiveTile::visible_voxels(const VisibilityRule& rule, const VoxelGrid& grid) {
  std::vector<Voxel> visible;
  visible.reserve(sorted_.size());
  for (const std::uint32_t position : sorted_) {
    LiveVoxel& live = voxels_[position];
    if (!is_shown(live, rule)) continue;
    live.history.was_shown = true;
    visible.push_back(voxel(live, grid));
  }
  return visible;
}

bool LiveTile::publish(std::uint64_t revision, const VisibilityRule& rule, const VoxelGrid& grid) {
  sort_new_voxels();
  Tile next = make_tile(id_, revision, visible_voxels(rule, grid), grid);
  const auto shown = published_ ? std::span(published_->voxels) : std::span<const Voxel>();
  unrecorded_voxels_ += changed_voxels(shown, next.voxels);
  if (next.voxels.empty()) return std::exchange(published_, nullptr) != nullptr;
  if (published_ && published_->info.content_hash == next.info.content_hash) return false;
  next.voxels.shrink_to_fit();
  next.info.appeared_in = published_ ? published_->info.appeared_in : revision;
  published_ = std::make_shared<const Tile>(std::move(next));
  return true;
}

std::vector<RemovedVoxel> LiveTile::removed(const VisibilityRule& rule,
                                            const VoxelGrid& grid) const {
  std::vector<RemovedVoxel> removed;
  for (const LiveVoxel& voxel : voxels_) {
    const auto reason = removal(voxel, rule);
    if (!reason) continue;
    removed.push_back(
        {mean_map(voxel, grid), voxel.evidence.winner(), *reason, voxel.last_seen_ns});
  }
  for (const auto& [key, excluded] : excluded_) {
    removed.push_back(
        {centre_map(key, grid), excluded.label, reason_of(excluded), excluded.last_seen_ns});
  }
  return removed;
}

std::size_t LiveTile::restore(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                              const VisibilityRule& rule, const VoxelGrid& grid) {
  std::size_t restored = restore_excluded(reason, box_map, rule, grid);
  for (LiveVoxel& voxel : voxels_) {
    if (removal(voxel, rule) != reason) continue;
    if (!box_map.contains(mean_map(voxel, grid).cast<double>())) continue;
    voxel.history.is_restored = true;
    ++restored;
  }
  return restored;
}

std::size_t LiveTile::restore_excluded(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                                       const VisibilityRule& rule, const VoxelGrid& grid) {
  std::vector<std::uint32_t> restored;
  for (const auto& [key, excluded] : excluded_) {
    if (reason_of(excluded) != reason) continue;
    if (!box_map.contains(centre_map(key, grid).cast<double>())) continue;
    LiveVoxel& voxel = voxels_.emplace_back();
    voxel.key = key;
    voxel.point_count = rule.min_points;
    voxel.offset_sum.fill(rule.min_points * static_cast<std::uint32_t>(offset_steps / 2));
    voxel.evidence.add(excluded.label, 1.0F);
    voxel.first_seen_ns = voxel.last_seen_ns = excluded.last_seen_ns;
    voxel.history.is_restored = true;
    remember(key, static_cast<std::uint32_t>(voxels_.size() - 1));
    restored.push_back(key);
  }
  for (const std::uint32_t key : restored) excluded_.erase(key);
  return restored.size();
}

Eigen::Vector3f LiveTile::centre_map(std::uint32_t key, const VoxelGrid& grid) const {
  const Eigen::Vector3d corner = grid.corner_map(id_, voxel_index(key));
  return (corner.array() + 0.5 * grid.voxel_size_m()).matrix().cast<float>();
}

RemovalReason LiveTile::reason_of(const Excluded& excluded) {
  return excluded.was_moving ? RemovalReason::moving : RemovalReason::semi_static;
}

LiveTile::LiveTile(TileId id, const TileRecord& record, const VoxelGrid& grid)
    : id_(id), published_(record.tile) {
  const TileEvidence* const evidence = record.evidence.get();
  if (published_) {
    voxels_.reserve(published_->voxels.size() + (evidence ? evidence->hidden.size() : 0));
    for (std::size_t i = 0; i < published_->voxels.size(); ++i) {
      const Voxel& voxel = published_->voxels[i];
      add(voxel, evidence ? evidence->shown[i] : history_of_shown(voxel), grid);
    }
  }
  if (evidence) {
    for (const HiddenVoxel& hidden : evidence->hidden) add(hidden.voxel, hidden.history, grid);
    for (const ExcludedVoxel& voxel : evidence->excluded) {
      excluded_.emplace(voxel_key(voxel.index),
                        Excluded{voxel.label, voxel.was_moving, voxel.last_seen_ns});
    }
  }
  sort_new_voxels();
}

void LiveTile::add(const Voxel& known, const VoxelHistory& history, const VoxelGrid& grid) {
  LiveVoxel live{voxel_key(known.index), known.point_count,  {},     known.evidence,
                 known.first_seen_ns,    known.last_seen_ns, history};
  const Eigen::Vector3d offset =
      (known.mean_map.cast<double>() - grid.corner_map(id_, known.index)) / grid.voxel_size_m();
  const double points = std::min(known.point_count, max_mean_points);
  for (int axis = 0; axis < 3; ++axis) {
    const double steps = std::clamp(offset[axis] * offset_steps - 0.5, 0.0, offset_steps - 1.0);
    live.offset_sum.at(static_cast<std::size_t>(axis)) =
        static_cast<std::uint32_t>(std::lround(steps * points));
  }
  remember(live.key, static_cast<std::uint32_t>(voxels_.size()));
  voxels_.push_back(live);
}

TileRecord LiveTile::record(const VisibilityRule& rule, const VoxelGrid& grid) const {
  auto evidence = std::make_shared<TileEvidence>();
  evidence->id = id_;
  std::vector<Voxel> shown;
  for (const std::uint32_t position : sorted_) {
    const LiveVoxel& live = voxels_[position];
    if (is_shown(live, rule)) {
      shown.push_back(voxel(live, grid));
      evidence->shown.push_back(live.history);
    } else {
      evidence->hidden.push_back({voxel(live, grid), live.history, removal(live, rule)});
    }
  }
  evidence->excluded.reserve(excluded_.size());
  for (const auto& [key, excluded] : excluded_) {
    evidence->excluded.push_back(
        {voxel_index(key), excluded.label, excluded.was_moving, excluded.last_seen_ns});
  }
  std::ranges::sort(evidence->excluded, {}, &ExcludedVoxel::index);
  if (!published_) return {nullptr, std::move(evidence)};
  assert(shown.size() == published_->voxels.size());
  // As published, with the current counts and times.
  auto tile = std::make_shared<Tile>(Tile{published_->info, std::move(shown)});
  tile->info.bounds_map.setEmpty();
  for (const Voxel& voxel : tile->voxels) tile->info.bounds_map.extend(voxel.mean_map);
  return {std::move(tile), std::move(evidence)};
}

std::size_t LiveTile::memory_bytes() const {
  const auto table_bytes = [](const auto& table) {
    using Entry = typename std::remove_cvref_t<decltype(table)>::value_type;
    // A bucket holds its entry and its probe distance.
    return table.bucket_count() * (sizeof(Entry) + 4);
  };
  return sizeof(*this) + voxels_.capacity() * sizeof(LiveVoxel) +
         sorted_.capacity() * sizeof(std::uint32_t) + positions_.memory_bytes() +
         table_bytes(excluded_) + (published_ ? published_->voxels.capacity() * sizeof(Voxel) : 0);
}

}  // namespace stillmap
