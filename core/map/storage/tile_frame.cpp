#include "core/map/storage/tile_frame.hpp"

#include <zstd.h>

#include <algorithm>
#include <memory>
#include <string>

#include "core/map/storage/tile_codec.hpp"

namespace stillmap {
namespace {

/// With long matches only: in planes of bytes, short ones cost more than the bytes. Half as much
/// time as level 3, and no more bytes.
constexpr int compression_level = 1;
constexpr int min_match_bytes = 7;
/// Planes that are smaller share a block: each has a head, and a table of codes.
constexpr std::size_t min_block_bytes = 1024;
/// Five million voxels; what claims more is taken for damaged rather than allocated.
constexpr std::size_t max_content_bytes = std::size_t{1} << 28;

/// Takes zstd's errors for ours.
std::size_t checked(std::size_t result) {
  if (ZSTD_isError(result) != 0) throw TileCodecError(ZSTD_getErrorName(result));
  return result;
}

/// Appends to a frame, whose output has room for all that may come.
class FrameWriter {
 public:
  FrameWriter(std::size_t content_bytes, std::span<std::uint8_t> to)
      : context_(ZSTD_createCCtx(), &ZSTD_freeCCtx), to_{to.data(), to.size(), 0} {
    checked(ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_compressionLevel, compression_level));
    checked(ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_minMatch, min_match_bytes));
    checked(ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_checksumFlag, 1));
    checked(ZSTD_CCtx_setPledgedSrcSize(context_.get(), content_bytes));
  }
  void append(std::span<const std::uint8_t> bytes, ZSTD_EndDirective then) {
    ZSTD_inBuffer from{bytes.data(), bytes.size(), 0};
    if (checked(ZSTD_compressStream2(context_.get(), &to_, &from, then)) != 0)
      throw TileCodecError("does not fit into its frame");
  }
  [[nodiscard]] std::size_t written() const { return to_.pos; }

 private:
  std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context_;
  ZSTD_outBuffer to_;
};

/// What a block's head and a flush may cost.
constexpr std::size_t max_block_head_bytes = 16;

}  // namespace

std::vector<std::uint8_t> to_frame(std::uint8_t format_version, const PlaneBytes& planes) {
  const std::span<const std::uint8_t> content = planes.bytes;
  if (content.size() > max_content_bytes) {
    throw TileCodecError("has " + std::to_string(content.size()) +
                         " bytes, too many for a tile; choose smaller tiles");
  }
  const std::size_t max_blocks = content.size() / min_block_bytes + 1;
  std::vector<std::uint8_t> frame(1 + ZSTD_compressBound(content.size()) +
                                  max_blocks * max_block_head_bytes);
  frame[0] = format_version;
  FrameWriter writer(content.size(), std::span(frame).subspan(1));
  std::size_t begin = 0;
  for (const std::size_t end : planes.plane_ends) {
    if (end - begin < min_block_bytes) continue;
    writer.append(content.subspan(begin, end - begin), ZSTD_e_flush);
    begin = end;
  }
  writer.append(content.subspan(begin), ZSTD_e_end);
  frame.resize(1 + writer.written());
  return frame;
}

std::vector<std::uint8_t> from_frame(std::span<const std::uint8_t> frame, std::size_t min_bytes) {
  if (frame.empty()) throw TileCodecError("is empty");
  if (std::ranges::find(tile_formats, frame[0]) == tile_formats.end()) {
    throw TileCodecError("has format " + std::to_string(frame[0]) +
                         ", this program reads formats up to " +
                         std::to_string(tile_formats.back()));
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
      checked(ZSTD_decompress(content.data(), content.size(), packed.data(), packed.size()));
  if (got != content.size()) throw TileCodecError("ends early");
  return content;
}

}  // namespace stillmap
