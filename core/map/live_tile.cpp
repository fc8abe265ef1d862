#include "core/map/live_tile.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

#include "core/map/tile.hpp"

namespace stillmap {
namespace {

/// Misses of a voxel are counted up to here.
/// So many hits halve the misses of a voxel: more than a vehicle that waits at a light brings.
constexpr std::uint16_t hits_to_settle = 32;
constexpr std::uint32_t max_count = std::numeric_limits<std::uint16_t>::max();

/// The first format does not store hits: the maximum is assumed, so that the voxel is not cleared
/// too early.
VoxelHistory history_of_shown(const PackedVoxel& voxel) {
  return {.hits = voxel.point_count, .was_shown = true};
}

/// Voxels, sorted by key, that only one of the lists has, or that have another class there.
std::size_t changed_voxels(std::span<const PackedVoxel> before,
                           std::span<const PackedVoxel> after) {
  std::size_t changed = 0;
  auto a = before.begin();
  auto b = after.begin();
  while (a != before.end() && b != after.end()) {
    const auto order = a->key <=> b->key;
    if (order != 0 || a->evidence.winner() != b->evidence.winner()) ++changed;
    if (order <= 0) ++a;
    if (order >= 0) ++b;
  }
  return changed + static_cast<std::size_t>((before.end() - a) + (after.end() - b));
}

/// Of one voxel, and the same of it but for the confidence and where in it they are.
bool are_alike(const TilePoint& a, const TilePoint& b) {
  return a.voxel_key == b.voxel_key && a.label == b.label && a.motion == b.motion;
}

/// Of points that have one label.
void add_votes(ClassEvidence& evidence, std::span<const TilePoint> alike) {
  std::uint32_t steps = 0;
  for (const TilePoint& point : alike) steps += ClassEvidence::steps_of_vote(point.confidence);
  if (evidence.add_at_once(alike.front().label, steps)) return;
  for (const TilePoint& point : alike) evidence.add(point.label, point.confidence);
}

}  // namespace

/// Voxels chosen from a tile, and the numbers of the scans that saw them.
class LiveTile::Selection {
 public:
  explicit Selection(std::size_t expected) { positions_.reserve(expected); }

  void add(std::uint32_t position, const LiveVoxel& voxel) {
    positions_.push_back(position);
    const auto [low, high] = std::minmax(voxel.first_scan, voxel.last_scan);
    first_scan_ = std::min(first_scan_, low);
    last_scan_ = std::max(last_scan_, high);
  }
  [[nodiscard]] const std::vector<std::uint32_t>& positions() const { return positions_; }

  /// The stamps of `scans`, two of each voxel chosen.
  [[nodiscard]] SeenTimes seen_times(std::vector<std::uint32_t> scans,
                                     const ScanStamps& stamps) const {
    constexpr std::size_t wide = 4096;
    const std::size_t span = scans.empty() ? 0 : std::size_t{last_scan_} - first_scan_ + 1;
    if (span <= wide + 8 * scans.size()) return near_times(std::move(scans), span, stamps);
    std::vector<std::int64_t> stamps_ns(scans.size());
    std::ranges::transform(scans, stamps_ns.begin(),
                           [&](std::uint32_t scan) { return stamps.stamp_ns(scan); });
    return stillmap::seen_times(stamps_ns);
  }

 private:
  /// Where the numbers lie close together, a table of them is faster than a search.
  [[nodiscard]] SeenTimes near_times(std::vector<std::uint32_t> scans, std::size_t span,
                                     const ScanStamps& stamps) const {
    std::vector<std::uint32_t> place_of(span);
    for (const std::uint32_t scan : scans) place_of[scan - first_scan_] = 1;
    std::vector<std::pair<std::int64_t, std::uint32_t>> seen;
    for (std::size_t i = 0; i < span; ++i) {
      const auto scan = static_cast<std::uint32_t>(first_scan_ + i);
      if (place_of[i] != 0) seen.emplace_back(stamps.stamp_ns(scan), scan);
    }
    std::ranges::sort(seen);
    SeenTimes times;
    times.stamps_ns.reserve(seen.size());
    for (const auto& [stamp_ns, scan] : seen) {
      place_of[scan - first_scan_] = static_cast<std::uint32_t>(times.stamps_ns.size());
      times.stamps_ns.push_back(stamp_ns);
    }
    for (std::uint32_t& scan : scans) scan = place_of[scan - first_scan_];
    times.stamp_of = std::move(scans);
    return times;
  }

  std::vector<std::uint32_t> positions_;
  std::uint32_t first_scan_ = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t last_scan_ = 0;
};

LiveTile::LiveVoxel* LiveTile::find(std::uint32_t key, std::uint32_t likely_position) {
  if (likely_position != PositionIndex::none && key_at()(likely_position) == key)
    return &at(likely_position);
  const std::uint32_t position = index_.find(key, key_at());
  return position == PositionIndex::none ? nullptr : &at(position);
}

LiveTile::LiveVoxel* LiveTile::make(const TilePoint& point) {
  if (point.motion != Motion::stationary || size() >= PositionIndex::max_entries) return nullptr;
  excluded_.erase(point.voxel_key);
  return &add_fresh(point.voxel_key);
}

LiveTile::LiveVoxel& LiveTile::add_fresh(std::uint32_t key) {
  index_.push_back(key, key_at());
  LiveVoxel& voxel = fresh_.emplace_back();
  voxel.packed.key = key;
  return voxel;
}

ClassEvidence LiveTile::evidence(std::uint32_t voxel_key) const {
  const std::uint32_t position = index_.find(voxel_key, key_at());
  return position == PositionIndex::none ? ClassEvidence() : at(position).packed.evidence;
}

void LiveTile::begin_session(std::uint32_t max_scans, const VisibilityRule& rule) {
  for (auto* const voxels : {&sorted_, &fresh_})
    for (LiveVoxel& voxel : *voxels) forget_beyond(voxel, max_scans, rule);
}

void LiveTile::insert(std::span<const TilePoint> points, std::uint32_t scan,
                      const SettledVoxels* settled) {
  if (settled != nullptr) {
    first_seen_ns_ = std::min(first_seen_ns_, settled->stamps.stamp_ns(scan));
    if (first_seen_ns_ >= settled->before_ns) settled = nullptr;
  }
  for (std::size_t begin = 0; begin < points.size(); begin += block_size) {
    const auto block = points.subspan(begin, std::min(block_size, points.size() - begin));
    insert_block(block, prefetch_voxels(block), scan, settled);
  }
}

LiveTile::LikelyPositions LiveTile::prefetch_voxels(std::span<const TilePoint> points) const {
  // Neighbours on a beam mostly share a voxel: asked for once.
  std::array<PositionIndex::Start, block_size> starts;
  std::size_t count = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (k > 0 && points[k].voxel_key == points[k - 1].voxel_key) continue;
    starts[count] = index_.start_of(points[k].voxel_key);
    index_.prefetch_slot(starts[count++]);
  }
  LikelyPositions positions;
  for (std::size_t k = 0; k < count; ++k) {
    positions[k] = index_.likely_position(starts[k]);
    if (positions[k] != PositionIndex::none) prefetch(&at(positions[k]));
  }
  return positions;
}

void LiveTile::insert_block(std::span<const TilePoint> points, const LikelyPositions& positions,
                            std::uint32_t scan, const SettledVoxels* settled) {
  const std::size_t size_before = size();
  std::optional<std::uint32_t> key;
  auto position = positions.begin();
  LiveVoxel* voxel = nullptr;
  Excluded* excluded = nullptr;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const TilePoint& point = points[i];
    const bool makes_voxel = voxel == nullptr && point.motion == Motion::stationary;
    // Neighbours on a beam mostly share a voxel: no look-up for them.
    if (key != point.voxel_key || makes_voxel) {
      const bool is_next = key != point.voxel_key;
      key = point.voxel_key;
      excluded = nullptr;
      const std::uint32_t likely = is_next ? *position++ : PositionIndex::none;
      // Where no position was likely there was no voxel, and since then none has come.
      const bool is_unknown = is_next && likely == PositionIndex::none && size() == size_before;
      voxel = is_unknown ? nullptr : find(point.voxel_key, likely);
      if (voxel == nullptr) {
        if (settled != nullptr && add_to_settled(point, scan, *settled)) continue;
        voxel = make(point);
      }
    }
    if (voxel != nullptr) {
      const std::size_t first = i;
      while (i + 1 < points.size() && are_alike(points[i + 1], point)) ++i;
      hit(*voxel, points.subspan(first, i + 1 - first), scan);
    } else if (point.motion != Motion::stationary) {
      if (excluded == nullptr) excluded = &excluded_[point.voxel_key];
      exclude(*excluded, point, scan);
    }
  }
}

void LiveTile::hit(LiveVoxel& voxel, std::span<const TilePoint> alike, std::uint32_t scan) {
  const Motion motion = alike.front().motion;
  // A moving object says nothing about the voxel that it passes.
  if (motion == Motion::highly_dynamic) return;
  PackedVoxel& packed = voxel.packed;
  if (packed.point_count == 0) voxel.first_scan = scan;
  const bool is_new_scan = packed.point_count == 0 || voxel.last_scan != scan;
  add_votes(packed.evidence, alike);
  voxel.last_scan = scan;
  if (motion == Motion::semi_static) return;
  // That it is seen again says that it was no part of what moved on.
  if (is_new_scan && voxel.misses == misses_of_rest) voxel.misses = 0;
  if (is_new_scan && voxel.hits < max_count) {
    ++voxel.hits;
    // What stays where space was free for long becomes part of the static world in the end.
    if (voxel.hits % hits_to_settle == 0) voxel.misses = (voxel.misses / 2U) & 0x1FFFU;
  }
  const std::uint32_t of_mean = PackedVoxel::max_mean_points - packed.mean_points();
  for (const TilePoint& point : alike.first(std::min<std::size_t>(alike.size(), of_mean))) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      packed.offset_sum[axis] =
          static_cast<std::uint16_t>(packed.offset_sum[axis] + point.offset[axis]);
    }
  }
  for (const TilePoint& point : alike)
    if (point.is_thin) voxel.is_thin = 1;
  packed.point_count = static_cast<std::uint16_t>(
      std::min<std::size_t>(max_count, packed.point_count + alike.size()));
}

void LiveTile::exclude(Excluded& voxel, const TilePoint& point, std::uint32_t scan) {
  voxel.label = point.label;
  voxel.was_moving |= point.motion == Motion::highly_dynamic;
  voxel.last_scan = scan;
}

VoxelHistory LiveTile::history(const LiveVoxel& voxel) {
  return {voxel.hits, voxel.misses, voxel.was_shown != 0, voxel.is_restored != 0,
          voxel.is_thin != 0};
}

void LiveTile::sort_fresh() {
  if (fresh_.empty()) return;
  const auto key = [](const LiveVoxel& voxel) { return voxel.packed.key; };
  std::ranges::sort(fresh_, {}, key);
  std::vector<LiveVoxel> merged;
  merged.reserve(size());
  std::ranges::merge(sorted_, fresh_, std::back_inserter(merged), {}, key, key);
  sorted_ = std::move(merged);
  fresh_ = std::vector<LiveVoxel>();  // also its memory
  index_.rebuild(sorted_.size(), sorted_.size(), key_at());
}

bool LiveTile::publish(std::uint64_t revision, const VisibilityRule& rule,
                       const ScanStamps& stamps) {
  sort_fresh();
  // A table keeps the buckets of what left it.
  if (excluded_.bucket_count() > 4 * excluded_.size() + 64) excluded_.rehash(0);
  Selection shown(sorted_.size());
  for (std::uint32_t position = 0; position < sorted_.size(); ++position) {
    LiveVoxel& live = sorted_[position];
    if (!is_shown(live, rule)) continue;
    live.was_shown = 1;
    shown.add(position, live);
  }
  std::vector<PackedVoxel> next = packed(shown);
  if (published_ && !next.empty() && published_->info.content_hash == content_hash(next)) {
    return false;
  }
  unrecorded_voxels_ += changed_voxels(
      published_ ? published_->voxels.packed() : std::span<const PackedVoxel>(), next);
  if (next.empty()) return std::exchange(published_, nullptr) != nullptr;
  Tile tile = make_tile(id_, revision,
                        PackedVoxels(id_, grid_, std::move(next), seen_times(shown, stamps)));
  tile.info.appeared_in = published_ ? published_->info.appeared_in : revision;
  published_ = std::make_shared<const Tile>(std::move(tile));
  return true;
}

std::vector<PackedVoxel> LiveTile::packed(const Selection& selection) const {
  std::vector<PackedVoxel> voxels;
  voxels.reserve(selection.positions().size());
  for (const std::uint32_t position : selection.positions()) voxels.push_back(at(position).packed);
  return voxels;
}

SeenTimes LiveTile::seen_times(const Selection& selection, const ScanStamps& stamps) const {
  std::vector<std::uint32_t> scans;
  scans.reserve(2 * selection.positions().size());
  for (const std::uint32_t position : selection.positions()) {
    scans.push_back(at(position).first_scan);
    scans.push_back(at(position).last_scan);
  }
  return selection.seen_times(std::move(scans), stamps);
}

std::vector<RemovedVoxel> LiveTile::removed(const VisibilityRule& rule,
                                            const ScanStamps& stamps) const {
  std::vector<RemovedVoxel> removed;
  for (std::uint32_t position = 0; position < size(); ++position) {
    const LiveVoxel& voxel = at(position);
    const auto reason = removal(voxel, rule);
    if (!reason) continue;
    removed.push_back({mean_map(voxel), voxel.packed.evidence.winner(), *reason,
                       stamps.stamp_ns(voxel.last_scan)});
  }
  for (const auto& [key, excluded] : excluded_) {
    removed.push_back({centre_map(key), excluded.label, reason_of(excluded),
                       stamps.stamp_ns(excluded.last_scan)});
  }
  return removed;
}

std::size_t LiveTile::restore(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                              const VisibilityRule& rule, const ScanStamps& stamps) {
  std::size_t restored = restore_excluded(reason, box_map, rule, stamps);
  for (std::uint32_t position = 0; position < size(); ++position) {
    LiveVoxel& voxel = at(position);
    if (removal(voxel, rule) != reason) continue;
    if (!box_map.contains(mean_map(voxel).cast<double>())) continue;
    voxel.is_restored = 1;
    ++restored;
  }
  return restored;
}

std::size_t LiveTile::restore_excluded(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                                       const VisibilityRule& rule, const ScanStamps& stamps) {
  std::vector<std::uint32_t> restored;
  for (const auto& [key, excluded] : excluded_) {
    if (reason_of(excluded) != reason || size() >= PositionIndex::max_entries) continue;
    if (!box_map.contains(centre_map(key).cast<double>())) continue;
    LiveVoxel& voxel = add_fresh(key);
    voxel.packed.point_count = static_cast<std::uint16_t>(std::min(rule.min_points, max_count));
    voxel.packed.offset_sum.fill(
        static_cast<std::uint16_t>(voxel.packed.mean_points() * (PackedVoxel::offset_steps / 2)));
    voxel.packed.evidence.add(excluded.label, 1.0F);
    voxel.first_scan = voxel.last_scan = excluded.last_scan;
    voxel.is_restored = 1;
    first_seen_ns_ = std::min(first_seen_ns_, stamps.stamp_ns(voxel.first_scan));
    restored.push_back(key);
  }
  for (const std::uint32_t key : restored) excluded_.erase(key);
  return restored.size();
}

Eigen::Vector3f LiveTile::centre_map(std::uint32_t key) const {
  const Eigen::Vector3d corner = grid_.corner_map(id_, voxel_index(key));
  return (corner.array() + 0.5 * grid_.voxel_size_m()).matrix().cast<float>();
}

RemovalReason LiveTile::reason_of(const Excluded& excluded) {
  return excluded.was_moving ? RemovalReason::moving : RemovalReason::semi_static;
}

LiveTile::LiveTile(TileId id, const TileRecord& record, const VoxelGrid& grid, ScanStamps& stamps)
    : id_(id), grid_(grid), published_(record.tile) {
  const TileEvidence* const evidence = record.evidence.get();
  const std::size_t shown = published_ ? published_->voxels.size() : 0;
  sorted_.reserve(shown + (evidence ? evidence->hidden.size() : 0));
  if (published_) {
    add(
        published_->voxels,
        [&](std::size_t i) {
          return evidence ? evidence->shown[i] : history_of_shown(published_->voxels.packed()[i]);
        },
        stamps);
  }
  if (evidence) {
    add(
        evidence->hidden, [&](std::size_t i) { return evidence->hidden_states[i].history; },
        stamps);
  }
  const auto key = [](const LiveVoxel& voxel) { return voxel.packed.key; };
  // Stable: of a voxel that a file has twice, what is shown stays.
  std::ranges::stable_sort(sorted_, {}, key);
  const auto is_same = [&](const LiveVoxel& a, const LiveVoxel& b) { return key(a) == key(b); };
  sorted_.erase(std::unique(sorted_.begin(), sorted_.end(), is_same), sorted_.end());
  if (sorted_.size() > PositionIndex::max_entries) sorted_.resize(PositionIndex::max_entries);
  index_.rebuild(sorted_.size(), sorted_.size(), key_at());
  if (!evidence) return;
  for (const ExcludedVoxel& voxel : evidence->excluded) {
    // Of a place that a file has as a voxel, too, the voxel stays.
    const std::uint32_t excluded_key = voxel_key(voxel.index);
    if (index_.find(excluded_key, key_at()) != PositionIndex::none) continue;
    excluded_.emplace(excluded_key,
                      Excluded{stamps.add(voxel.last_seen_ns), voxel.label, voxel.was_moving});
  }
}

void LiveTile::add(const PackedVoxels& known,
                   const std::function<VoxelHistory(std::size_t)>& history, ScanStamps& stamps) {
  std::vector<std::uint32_t> scan_of;
  scan_of.reserve(known.stamps_ns().size());
  if (!known.empty()) first_seen_ns_ = std::min(first_seen_ns_, known.stamps_ns().front());
  for (const std::int64_t stamp_ns : known.stamps_ns()) scan_of.push_back(stamps.add(stamp_ns));
  for (std::size_t i = 0; i < known.size(); ++i) {
    const VoxelHistory counts = history(i);
    LiveVoxel& live = sorted_.emplace_back();
    live.packed = known.packed()[i];
    live.first_scan = scan_of[known.first_stamp(i)];
    live.last_scan = scan_of[known.last_stamp(i)];
    live.hits = counts.hits;
    live.misses = std::min(counts.misses, misses_of_rest) & 0x1FFFU;
    live.was_shown = counts.was_shown ? 1 : 0;
    live.is_restored = counts.is_restored ? 1 : 0;
    live.is_thin = counts.is_thin ? 1 : 0;
  }
}

TileRecord LiveTile::record(const VisibilityRule& rule, const ScanStamps& stamps) const {
  assert(fresh_.empty());
  auto evidence = std::make_shared<TileEvidence>();
  evidence->id = id_;
  Selection shown(sorted_.size());
  Selection hidden(0);
  for (std::uint32_t position = 0; position < sorted_.size(); ++position) {
    const LiveVoxel& live = sorted_[position];
    if (is_shown(live, rule)) {
      shown.add(position, live);
      evidence->shown.push_back(history(live));
    } else {
      hidden.add(position, live);
      evidence->hidden_states.push_back({history(live), removal(live, rule)});
    }
  }
  evidence->hidden = {id_, grid_, packed(hidden), seen_times(hidden, stamps)};
  evidence->excluded.reserve(excluded_.size());
  for (const auto& [key, excluded] : excluded_) {
    evidence->excluded.push_back({voxel_index(key), excluded.label, excluded.was_moving,
                                  stamps.stamp_ns(excluded.last_scan)});
  }
  std::ranges::sort(evidence->excluded, {}, &ExcludedVoxel::index);
  if (!published_) return {nullptr, std::move(evidence)};
  assert(shown.positions().size() == published_->voxels.size());
  // As published, with the current counts and times.
  auto tile = std::make_shared<Tile>(
      Tile{published_->info, PackedVoxels(id_, grid_, packed(shown), seen_times(shown, stamps))});
  tile->info.bounds_map = tile->voxels.bounds_map();
  return {std::move(tile), std::move(evidence)};
}

std::size_t LiveTile::memory_bytes() const {
  const auto table_bytes = [](const auto& table) {
    using Entry = typename std::remove_cvref_t<decltype(table)>::value_type;
    // A bucket holds its entry and its probe distance.
    return table.bucket_count() * (sizeof(Entry) + 4);
  };
  return sizeof(*this) + (sorted_.capacity() + fresh_.capacity()) * sizeof(LiveVoxel) +
         index_.memory_bytes() + hidden_.capacity() * sizeof(std::uint32_t) +
         table_bytes(excluded_) + (published_ ? published_->voxels.memory_bytes() : 0);
}

}  // namespace stillmap
