#include "core/map/tile_codec.hpp"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <memory>
#include <string>

#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

static_assert(std::endian::native == std::endian::little,
              "fields are copied as they lie in memory");

constexpr std::uint8_t format_version = 1;
constexpr int compression_level = 3;
constexpr std::size_t header_bytes = 4 + 4 + 8 + 8 + 4;
constexpr std::size_t vote_bytes = 1 + 4;
constexpr std::size_t voxel_bytes = 3 * 2 + 4 + 3 * 4 + ClassEvidence::candidates * vote_bytes + 16;
/// Five million voxels; what claims more is taken for damaged rather than allocated.
constexpr std::size_t max_content_bytes = std::size_t{1} << 28;

using Bytes = std::vector<std::uint8_t>;

/// Writes or reads the fields of one record in turn: one list of fields serves both ways.
class FieldWriter {
 public:
  explicit FieldWriter(std::uint8_t* to) : to_(to) {}
  template <typename Field>
  void operator()(const Field& field) {
    std::memcpy(to_, &field, sizeof(field));
    to_ += sizeof(field);
  }

 private:
  std::uint8_t* to_;
};

class FieldReader {
 public:
  explicit FieldReader(const std::uint8_t* from) : from_(from) {}
  template <typename Field>
  void operator()(Field& field) {
    std::memcpy(&field, from_, sizeof(field));
    from_ += sizeof(field);
  }

 private:
  const std::uint8_t* from_;
};

template <typename Visitor, typename Info>
void visit_header(Visitor visit, Info& info) {
  visit(info.id.x);
  visit(info.id.y);
  visit(info.revision);
  visit(info.content_hash);
  visit(info.voxel_count);
}

template <typename Visitor, typename AnyVoxel>
void visit_voxel(Visitor visit, AnyVoxel& voxel) {
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

Bytes to_planes(const Tile& tile) {
  const std::size_t count = tile.voxels.size();
  Bytes content(header_bytes + count * voxel_bytes);
  visit_header(FieldWriter(content.data()), tile.info);
  std::array<std::uint8_t, voxel_bytes> record{};
  for (std::size_t v = 0; v < count; ++v) {
    visit_voxel(FieldWriter(record.data()), tile.voxels[v]);
    for (std::size_t k = 0; k < voxel_bytes; ++k) content[header_bytes + k * count + v] = record[k];
  }
  return content;
}

Tile from_planes(const Bytes& content) {
  Tile tile;
  visit_header(FieldReader(content.data()), tile.info);
  const std::size_t count = tile.info.voxel_count;
  if (content.size() != header_bytes + count * voxel_bytes) {
    throw TileCodecError("has " + std::to_string(content.size()) + " bytes for " +
                         std::to_string(count) + " voxels");
  }
  tile.voxels.resize(count);
  std::array<std::uint8_t, voxel_bytes> record{};
  for (std::size_t v = 0; v < count; ++v) {
    for (std::size_t k = 0; k < voxel_bytes; ++k) record[k] = content[header_bytes + k * count + v];
    visit_voxel(FieldReader(record.data()), tile.voxels[v]);
    tile.info.bounds_map.extend(tile.voxels[v].mean_map);
  }
  return tile;
}

Bytes decompress(std::span<const std::uint8_t> frame) {
  const unsigned long long size = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN) {
    throw TileCodecError("is not a zstd frame");
  }
  if (size < header_bytes || size > max_content_bytes) {
    throw TileCodecError("claims a size of " + std::to_string(size) + " bytes");
  }
  Bytes content(size);
  const std::size_t got =
      ZSTD_decompress(content.data(), content.size(), frame.data(), frame.size());
  if (ZSTD_isError(got) != 0) throw TileCodecError(ZSTD_getErrorName(got));
  if (got != content.size()) throw TileCodecError("ends early");
  return content;
}

bool is_valid(const Voxel& voxel) {
  return voxel.index.x < VoxelGrid::max_columns && voxel.index.y < VoxelGrid::max_columns &&
         voxel.point_count > 0 && voxel.mean_map.allFinite() &&
         std::ranges::all_of(voxel.evidence.votes, [](const ClassEvidence::Vote& vote) {
           return static_cast<std::size_t>(vote.label) < semantic_class_count &&
                  vote.weight >= 0.0F && vote.weight <= ClassEvidence::max_total * 2.0F;
         });
}

}  // namespace

std::vector<std::uint8_t> encode_tile(const Tile& tile) {
  const Bytes content = to_planes(tile);
  if (content.size() > max_content_bytes) {
    throw TileCodecError("has " + std::to_string(tile.voxels.size()) +
                         " voxels, too many for a tile; choose smaller tiles");
  }
  const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(),
                                                                     &ZSTD_freeCCtx);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, compression_level);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  Bytes blob(1 + ZSTD_compressBound(content.size()));
  blob[0] = format_version;
  const std::size_t written = ZSTD_compress2(context.get(), blob.data() + 1, blob.size() - 1,
                                             content.data(), content.size());
  if (ZSTD_isError(written) != 0) throw TileCodecError(ZSTD_getErrorName(written));
  blob.resize(1 + written);
  return blob;
}

Tile decode_tile(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) throw TileCodecError("is empty");
  if (bytes[0] != format_version) {
    throw TileCodecError("has format " + std::to_string(bytes[0]) + ", this program reads format " +
                         std::to_string(format_version));
  }
  Tile tile = from_planes(decompress(bytes.subspan(1)));
  if (!std::ranges::all_of(tile.voxels, is_valid)) throw TileCodecError("has an impossible voxel");
  const auto not_ascending = [](const Voxel& a, const Voxel& b) { return a.index >= b.index; };
  if (std::ranges::adjacent_find(tile.voxels, not_ascending) != tile.voxels.end()) {
    throw TileCodecError("has voxels out of order");
  }
  return tile;
}

}  // namespace stillmap
