// A number that says how the bytes are meant: an encoded tile or memory as it is stored, or what is
// inside the zstd frame, whose checksum would keep any change from being looked at.

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
constexpr std::uint8_t format_version = 1;

void decode(Kind kind, Bytes bytes) {
  const bool is_content = kind == tile_content || kind == memory_content;
  std::vector<std::uint8_t> framed;
  if (is_content) framed = to_frame(format_version, bytes);
  const Bytes encoded = is_content ? Bytes(framed) : bytes;
  if (kind == tile || kind == tile_content) {
    const Tile decoded = decode_tile(encoded);
    require(decode_tile(encode_tile(decoded)).voxels.size() == decoded.voxels.size(),
            "a tile comes back from its encoding");
  } else {
    const TileEvidence decoded = decode_evidence(encoded);
    require(decode_evidence(encode_evidence(decoded)).hidden.size() == decoded.hidden.size(),
            "a memory comes back from its encoding");
    static_cast<void>(removed_voxels(decoded, 0.2, 20.0));
  }
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const auto kind = static_cast<Kind>(source.byte() % kinds);
  try {
    decode(kind, source.rest());
  } catch (const TileCodecError&) {
  }
}

std::vector<Seed> seeds() {
  const SavedMap map = small_street();
  const auto tile_bytes = encode_tile(*map.view.tiles.front());
  const auto memory_bytes = encode_evidence(*map.tile_evidence.begin()->second);
  constexpr std::size_t min_bytes = 1;
  const auto content = [&](const std::vector<std::uint8_t>& framed) {
    return text_of(from_frame(format_version, framed, min_bytes));
  };
  return {{"tile", with_choice(tile, text_of(tile_bytes))},
          {"tile_content", with_choice(tile_content, content(tile_bytes))},
          {"memory", with_choice(memory, text_of(memory_bytes))},
          {"memory_content", with_choice(memory_content, content(memory_bytes))}};
}

}  // namespace
}  // namespace tile_inputs

const Target tile_target{"tile", tile_inputs::run, tile_inputs::seeds};

}  // namespace stillmap::fuzz
