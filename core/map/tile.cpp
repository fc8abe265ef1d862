#include "core/map/tile.hpp"

#include <xxhash.h>

#include <algorithm>
#include <utility>

#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

float total_weight(const ClassEvidence& evidence) {
  float total = 0.0F;
  for (const auto& vote : evidence.votes) total += vote.weight;
  return total;
}

/// The strongest vote; of equals that of the lower class, so that the order of votes does not
/// matter.
const ClassEvidence::Vote& strongest(const ClassEvidence& evidence) {
  return *std::ranges::max_element(evidence.votes, [](const auto& a, const auto& b) {
    return a.weight != b.weight ? a.weight < b.weight : a.label > b.label;
  });
}

/// A voxel's content in one word: 48 bits of index, three times 3 bits of mean, 5 bits of class.
std::uint64_t content_word(TileId tile, const Voxel& voxel, const VoxelGrid& grid) {
  constexpr int steps = 8;
  const Eigen::Vector3d offset =
      (voxel.mean_map.cast<double>() - grid.corner_map(tile, voxel.index)) / grid.voxel_size_m();
  const Eigen::Vector3i step =
      (offset * steps).array().floor().cwiseMax(0.0).cwiseMin(steps - 1.0).cast<int>();
  const auto mean = static_cast<std::uint64_t>((step.x() * steps + step.y()) * steps + step.z());
  return std::uint64_t{voxel.index.x} << 48 | std::uint64_t{voxel.index.y} << 32 |
         std::uint64_t{static_cast<std::uint16_t>(voxel.index.z)} << 16 | mean << 5 |
         static_cast<std::uint64_t>(voxel.evidence.winner());
}

}  // namespace

void ClassEvidence::add(SemanticClass label, float weight) {
  if (label == SemanticClass::unlabeled || !(weight > 0.0F)) return;
  const auto known = std::ranges::find(votes, label, &Vote::label);
  Vote& vote = known != votes.end() ? *known : *std::ranges::min_element(votes, {}, &Vote::weight);
  // Space-saving algorithm: a new class inherits the weight of the one that it replaces, so that a
  // recurring class is not shut out by earlier ones.
  vote.label = label;
  vote.weight += std::min(weight, 1.0F);

  const float total = total_weight(*this);
  if (total <= max_total) return;
  for (Vote& kept : votes) kept.weight *= max_total / total;
}

SemanticClass ClassEvidence::winner() const {
  const Vote& best = strongest(*this);
  return best.weight > 0.0F ? best.label : SemanticClass::unlabeled;
}

float ClassEvidence::share() const {
  const float total = total_weight(*this);
  return total > 0.0F ? strongest(*this).weight / total : 0.0F;
}

std::string_view name(RemovalReason reason) {
  constexpr std::array<std::string_view, removal_reason_count> names{"moving", "semi-static",
                                                                     "seen through", "relabelled"};
  return names.at(static_cast<std::size_t>(reason));
}

std::uint64_t content_hash(TileId tile, std::span<const Voxel> voxels, const VoxelGrid& grid) {
  std::vector<std::uint64_t> words(voxels.size());
  std::ranges::transform(voxels, words.begin(),
                         [&](const Voxel& voxel) { return content_word(tile, voxel, grid); });
  return XXH3_64bits(words.data(), words.size() * sizeof(words[0]));
}

Tile make_tile(TileId id, std::uint64_t revision, std::vector<Voxel> voxels,
               const VoxelGrid& grid) {
  Tile tile;
  tile.info.id = id;
  tile.info.revision = revision;
  tile.info.content_hash = content_hash(id, voxels, grid);
  tile.info.voxel_count = static_cast<std::uint32_t>(voxels.size());
  for (const Voxel& voxel : voxels) tile.info.bounds_map.extend(voxel.mean_map);
  tile.voxels = std::move(voxels);
  return tile;
}

std::shared_ptr<const Tile> find_tile(const MapSnapshot& view, TileId id) {
  return view.tiles.find(id);
}

}  // namespace stillmap
