#include "core/map/storage/packed_codec.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "core/map/storage/byte_planes.hpp"
#include "core/map/storage/tile_codec.hpp"

namespace stillmap {
namespace {

std::uint16_t zigzag(std::int16_t difference) {
  return static_cast<std::uint16_t>(difference < 0 ? -(2 * difference + 1) : 2 * difference);
}

std::int16_t from_zigzag(std::uint16_t steps) {
  return static_cast<std::int16_t>((steps & 1U) != 0 ? -(steps >> 1) - 1 : steps >> 1);
}

struct StoredVoxel {
  KeySteps::Step step;
  /// Whole part and rest of the sum of offsets, divided by the points of the mean: the first is
  /// close to random, the second is small for few points.
  std::array<std::uint8_t, 3> mean{};
  std::array<std::uint8_t, 3> rest{};
  std::uint16_t point_count = 0;
  ClassEvidence::Bits evidence;
  std::uint32_t first_stamp = 0;
  /// Stamps after the first one, in a circle: time may go backwards.
  std::uint32_t stamps_on = 0;
};

constexpr auto visit_voxel = [](auto&& visit, auto& voxel) {
  visit(voxel.step.columns);
  visit(voxel.step.layers);
  for (auto& mean : voxel.mean) visit(mean);
  for (auto& rest : voxel.rest) visit(rest);
  visit(voxel.point_count);
  for (auto& weight : voxel.evidence.weights) visit(weight);
  visit(voxel.evidence.classes);
  visit(voxel.first_stamp);
  visit(voxel.stamps_on);
};

constexpr auto visit_number = [](auto&& visit, auto& number) { visit(number); };

/// Between votes as they are and what lacks of one confident vote for each point; its own inverse.
void turn_first_votes(StoredVoxel& voxel) {
  auto& weights = voxel.evidence.weights;
  const std::uint32_t most =
      std::min(voxel.point_count * ClassEvidence::confident_steps, ClassEvidence::max_steps);
  weights[0] = static_cast<std::uint16_t>(most - weights[0] - weights[1] - weights[2]);
}

StoredVoxel to_stored(const PackedVoxel& voxel, KeySteps& keys) {
  StoredVoxel stored;
  stored.step = keys.step_to(voxel.key);
  stored.point_count = voxel.point_count;
  stored.evidence = voxel.evidence.bits();
  turn_first_votes(stored);
  const std::uint32_t points = voxel.mean_points();
  for (std::size_t axis = 0; axis < 3 && points > 0; ++axis) {
    stored.mean[axis] = static_cast<std::uint8_t>(voxel.offset_sum[axis] / points);
    stored.rest[axis] = static_cast<std::uint8_t>(voxel.offset_sum[axis] % points);
  }
  return stored;
}

/// As StoredVoxel, for so many voxels at once.
struct StoredVoxels {
  static constexpr std::size_t size = 64;
  template <typename Number>
  using Each = std::array<Number, size>;

  struct {
    Each<std::uint16_t> columns;
    Each<std::uint16_t> layers;
  } step;
  std::array<Each<std::uint8_t>, 3> mean;
  std::array<Each<std::uint8_t>, 3> rest;
  Each<std::uint16_t> point_count;
  struct {
    std::array<Each<std::uint16_t>, ClassEvidence::candidates> weights;
    Each<std::uint16_t> classes;
  } evidence;
  Each<std::uint32_t> first_stamp;
  Each<std::uint32_t> stamps_on;
};

/// The inverse of the other turn_first_votes.
void turn_first_votes(StoredVoxels& stored) {
  constexpr std::uint16_t most_points = ClassEvidence::max_steps / ClassEvidence::confident_steps;
  static_assert(most_points * ClassEvidence::confident_steps == ClassEvidence::max_steps);
  auto& weights = stored.evidence.weights;
  for (std::size_t i = 0; i < StoredVoxels::size; ++i) {
    const std::uint16_t points = std::min(stored.point_count[i], most_points);
    weights[0][i] = static_cast<std::uint16_t>(points * ClassEvidence::confident_steps -
                                               weights[0][i] - weights[1][i] - weights[2][i]);
  }
}

/// What needs no voxel before.
struct VoxelParts {
  std::array<StoredVoxels::Each<std::uint16_t>, 3> offset_sum;
  /// Whether the mean is none, or outside of its voxel.
  StoredVoxels::Each<std::uint16_t> is_outside{};
};

VoxelParts parts_of(const StoredVoxels& stored) {
  VoxelParts parts;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < StoredVoxels::size; ++i) {
      const std::uint16_t points =
          std::min<std::uint16_t>(stored.point_count[i], PackedVoxel::max_mean_points);
      const std::uint16_t rest = stored.rest[axis][i];
      const auto sum = static_cast<std::uint16_t>(stored.mean[axis][i] * points + rest);
      const auto most = static_cast<std::uint16_t>((PackedVoxel::offset_steps - 1) * points);
      parts.offset_sum[axis][i] = sum;
      parts.is_outside[i] =
          static_cast<std::uint16_t>(parts.is_outside[i] | (rest >= points || sum > most ? 1 : 0));
    }
  }
  return parts;
}

ClassEvidence::Bits evidence_at(std::size_t i, const StoredVoxels& stored) {
  const auto& [weights, classes] = stored.evidence;
  return {{weights[0][i], weights[1][i], weights[2][i]}, classes[i]};
}

/// Throws where one of the first `count` is no voxel.
void check_voxels(const StoredVoxels& stored, const VoxelParts& parts, std::size_t count,
                  std::uint32_t stamps) {
  bool is_impossible = false;
  bool is_outside = false;
  bool has_no_stamp = false;
  for (std::size_t i = 0; i < count; ++i) {
    is_impossible |= stored.point_count[i] == 0;
    is_impossible |= !ClassEvidence::of(evidence_at(i, stored));
  }
  for (std::size_t i = 0; i < count; ++i) is_outside |= parts.is_outside[i] != 0;
  for (std::size_t i = 0; i < count; ++i) {
    has_no_stamp |= stored.first_stamp[i] >= stamps;
    has_no_stamp |= stored.stamps_on[i] >= stamps;
  }
  if (is_impossible) throw TileCodecError("has an impossible voxel");
  if (is_outside) throw TileCodecError("has a mean outside of its voxel");
  if (has_no_stamp) throw TileCodecError("has a voxel without a stamp");
}

using VoxelBatch = std::array<PackedVoxel, StoredVoxels::size>;

/// The first `count`, whose keys go on from `last_key`.
void unpack(const StoredVoxels& stored, const VoxelParts& parts, std::size_t count, KeySteps& keys,
            std::optional<std::uint32_t>& last_key, VoxelBatch& voxels) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t key = keys.key_at({stored.step.columns[i], stored.step.layers[i]});
    if (last_key && key <= *last_key) throw TileCodecError("has voxels out of order");
    last_key = key;
    voxels[i] = {
        .key = key,
        .offset_sum = {parts.offset_sum[0][i], parts.offset_sum[1][i], parts.offset_sum[2][i]},
        .point_count = stored.point_count[i],
        .evidence = *ClassEvidence::of(evidence_at(i, stored))};
  }
}

/// The voxel's stamps, which are checked.
void unpack_stamps(const StoredVoxels& stored, std::size_t count, std::uint32_t stamps,
                   std::vector<std::uint32_t>& stamp_of) {
  std::array<std::uint32_t, 2 * StoredVoxels::size> both{};
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t last = stored.first_stamp[i] + stored.stamps_on[i];
    both[2 * i] = stored.first_stamp[i];
    both[2 * i + 1] = last < stamps ? last : last - stamps;
  }
  stamp_of.insert(stamp_of.end(), both.begin(),
                  both.begin() + static_cast<std::ptrdiff_t>(2 * count));
}

}  // namespace

KeySteps::Step KeySteps::step_to(std::uint32_t key) {
  const auto column = static_cast<std::uint16_t>(key >> 16);
  const auto layer = static_cast<std::uint16_t>(key & 0xFFFFU);
  Step step{.columns = static_cast<std::uint16_t>(column - column_)};
  step.layers = step.columns == 0 ? static_cast<std::uint16_t>(layer - layer_ - 1)
                                  : zigzag(static_cast<std::int16_t>(layer - lowest_layer_));
  move_to(column, layer);
  return step;
}

std::uint32_t KeySteps::key_at(const Step& step) {
  const auto column = static_cast<std::uint16_t>(column_ + step.columns);
  const auto layer = static_cast<std::uint16_t>(
      step.columns == 0 ? layer_ + 1 + step.layers : lowest_layer_ + from_zigzag(step.layers));
  move_to(column, layer);
  return std::uint32_t{column} << 16 | layer;
}

void KeySteps::move_to(std::uint16_t column, std::uint16_t layer) {
  if (column != column_) lowest_layer_ = layer;
  column_ = column;
  layer_ = layer;
}

void append_stamps(PlaneBytes& content, std::span<const std::int64_t> stamps_ns) {
  std::vector<std::uint64_t> steps;
  std::uint64_t last = 0;
  for (const std::int64_t stamp_ns : stamps_ns) {
    const auto bits = static_cast<std::uint64_t>(stamp_ns);
    steps.push_back(bits - std::exchange(last, bits));
  }
  append_planes<stamp_bytes>(content, steps, visit_number);
}

std::vector<std::int64_t> read_stamps(const std::uint8_t*& from, std::size_t count) {
  std::vector<std::int64_t> stamps_ns;
  stamps_ns.reserve(count);
  std::uint64_t last = 0;
  for_each_in_planes<stamp_bytes, std::uint64_t>(from, count, visit_number, [&](auto step) {
    last += step;
    const auto stamp_ns = static_cast<std::int64_t>(last);
    if (!stamps_ns.empty() && stamp_ns <= stamps_ns.back()) {
      throw TileCodecError("has stamps out of order");
    }
    stamps_ns.push_back(stamp_ns);
  });
  from += count * stamp_bytes;
  return stamps_ns;
}

void append_voxels(PlaneBytes& content, const PackedVoxels& voxels) {
  std::vector<StoredVoxel> stored;
  stored.reserve(voxels.size());
  const auto stamps = static_cast<std::uint32_t>(voxels.stamps_ns().size());
  KeySteps keys;
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    StoredVoxel& voxel = stored.emplace_back(to_stored(voxels.packed()[i], keys));
    voxel.first_stamp = voxels.first_stamp(i);
    const std::uint32_t last = voxels.last_stamp(i);
    voxel.stamps_on = last - voxel.first_stamp + (last < voxel.first_stamp ? stamps : 0);
  }
  append_planes<packed_voxel_bytes>(content, stored, visit_voxel);
}

PackedVoxels read_voxels(const std::uint8_t*& from, std::size_t count,
                         std::vector<std::int64_t> stamps_ns, TileId tile, const VoxelGrid& grid,
                         FirstVotes first_votes) {
  std::vector<PackedVoxel> voxels;
  SeenTimes seen{std::move(stamps_ns), {}};
  voxels.reserve(count);
  seen.stamp_of.reserve(2 * count);
  const auto stamps = static_cast<std::uint32_t>(seen.stamps_ns.size());
  KeySteps keys;
  std::optional<std::uint32_t> last_key;
  VoxelBatch batch;
  const auto read = [&](StoredVoxels& stored, std::size_t in_batch) {
    if (first_votes == FirstVotes::by_what_lacks) turn_first_votes(stored);
    const VoxelParts parts = parts_of(stored);
    check_voxels(stored, parts, in_batch, stamps);
    unpack(stored, parts, in_batch, keys, last_key, batch);
    voxels.insert(voxels.end(), batch.begin(),
                  batch.begin() + static_cast<std::ptrdiff_t>(in_batch));
    unpack_stamps(stored, in_batch, stamps, seen.stamp_of);
  };
  for_each_batch_in_planes<packed_voxel_bytes, StoredVoxels>(from, count, visit_voxel, read);
  from += count * packed_voxel_bytes;
  return {tile, grid, std::move(voxels), seen};
}

}  // namespace stillmap
