// A number that says how the bytes are meant: an encoded tile or memory as it is stored, or what is
// inside the zstd frame, whose checksum would keep any change from being looked at.

#include <algorithm>

#include "core/map/storage/tile_codec.hpp"
#include "core/map/storage/tile_frame.hpp"
#include "core/map/tile_evidence.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/street_map.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace tile_inputs {
namespace {

enum Kind : std::uint8_t { tile, tile_content, memory, memory_content, kinds };
/// Added to a kind of content of the newest format; without it, of the first one.
constexpr std::uint8_t newest_format = kinds * (tile_formats.size() - 1);

void decode(Kind kind, std::uint8_t format_version, Bytes bytes) {
  const StaticMapConfig config = street_config();
  const VoxelGrid grid(config.voxel_size_m, config.tile_size_m);
  const bool is_content = kind == tile_content || kind == memory_content;
  std::vector<std::uint8_t> framed;
  if (is_content) framed = to_frame(format_version, {bytes_of(bytes), {}});
  const Bytes encoded = is_content ? Bytes(framed) : bytes;
  if (kind == tile || kind == tile_content) {
    const Tile decoded = decode_tile(encoded, grid);
    const Tile back = decode_tile(encode_tile(decoded), grid);
    require(std::ranges::equal(back.voxels.packed(), decoded.voxels.packed()),
            "a tile comes back from its encoding");
    for (const Voxel& voxel : back.voxels) require(voxel.mean_map.allFinite(), "a mean is finite");
  } else {
    const TileEvidence decoded = decode_evidence(encoded, grid);
    const TileEvidence back = decode_evidence(encode_evidence(decoded), grid);
    require(back.shown == decoded.shown && back.hidden_states == decoded.hidden_states &&
                back.excluded == decoded.excluded &&
                std::ranges::equal(back.hidden.packed(), decoded.hidden.packed()),
            "a memory comes back from its encoding");
    static_cast<void>(removed_voxels(decoded, config.voxel_size_m, config.tile_size_m));
  }
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const std::uint8_t choice = source.byte();
  const std::uint8_t format_version = tile_formats.at(choice / kinds % tile_formats.size());
  try {
    decode(static_cast<Kind>(choice % kinds), format_version, source.rest());
  } catch (const TileCodecError&) {
  }
}

std::vector<Seed> seeds() {
  const SavedMap map = small_street();
  const auto tile_bytes = encode_tile(*map.view.tiles.front());
  const auto memory_bytes = encode_evidence(*map.tile_evidence.begin()->second);
  constexpr std::size_t min_bytes = 1;
  const auto content = [&](const std::vector<std::uint8_t>& framed) {
    return text_of(from_frame(framed, min_bytes));
  };
  return {{"tile", with_choice(tile, text_of(tile_bytes))},
          {"tile_content", with_choice(newest_format + tile_content, content(tile_bytes))},
          {"memory", with_choice(memory, text_of(memory_bytes))},
          {"memory_content", with_choice(newest_format + memory_content, content(memory_bytes))}};
}

}  // namespace
}  // namespace tile_inputs

const Target tile_target{"tile", tile_inputs::run, tile_inputs::seeds};

}  // namespace stillmap::fuzz
