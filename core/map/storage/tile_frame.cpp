#include "core/map/storage/tile_frame.hpp"

#include <zstd.h>

#include <memory>
#include <string>

#include "core/map/storage/tile_codec.hpp"

namespace stillmap {
namespace {

constexpr int compression_level = 3;
/// Five million voxels; what claims more is taken for damaged rather than allocated.
constexpr std::size_t max_content_bytes = std::size_t{1} << 28;

}  // namespace

std::vector<std::uint8_t> to_frame(std::uint8_t format_version,
                                   std::span<const std::uint8_t> content) {
  if (content.size() > max_content_bytes) {
    throw TileCodecError("has " + std::to_string(content.size()) +
                         " bytes, too many for a tile; choose smaller tiles");
  }
  const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(),
                                                                     &ZSTD_freeCCtx);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, compression_level);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  std::vector<std::uint8_t> frame(1 + ZSTD_compressBound(content.size()));
  frame[0] = format_version;
  const std::size_t written = ZSTD_compress2(context.get(), frame.data() + 1, frame.size() - 1,
                                             content.data(), content.size());
  if (ZSTD_isError(written) != 0) throw TileCodecError(ZSTD_getErrorName(written));
  frame.resize(1 + written);
  return frame;
}

std::vector<std::uint8_t> from_frame(std::uint8_t format_version,
                                     std::span<const std::uint8_t> frame, std::size_t min_bytes) {
  if (frame.empty()) throw TileCodecError("is empty");
  if (frame[0] != format_version) {
    throw TileCodecError("has format " + std::to_string(frame[0]) +
                         ", this program reads formats 1 to " + std::to_string(tile_format));
  }
  const std::span<const std::uint8_t> packed = frame.subspan(1);
  const unsigned long long size = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN) {
    throw TileCodecError("is not a zstd frame");
  }
  if (size < min_bytes || size > max_content_bytes) {
    throw TileCodecError("claims a size of " + std::to_string(size) + " bytes");
  }
  std::vector<std::uint8_t> content(size);
  const std::size_t got =
      ZSTD_decompress(content.data(), content.size(), packed.data(), packed.size());
  if (ZSTD_isError(got) != 0) throw TileCodecError(ZSTD_getErrorName(got));
  if (got != content.size()) throw TileCodecError("ends early");
  return content;
}

}  // namespace stillmap
