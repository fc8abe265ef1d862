#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/bag/input_file.hpp"
#include "idl/bag/mcap_records.hpp"

namespace stillmap::dds::mcap {

/// Larger chunks are refused: a chunk is unpacked as a whole.
inline constexpr std::uint64_t max_chunk_bytes = std::uint64_t{512} << 20U;

/// CRC-32 as zlib has it, of bytes that follow those of `before`.
[[nodiscard]] std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t before = 0);

/// A stream of one compression.
class Decompressor {
 public:
  struct Progress {
    std::size_t consumed = 0;
    std::size_t produced = 0;
  };

  Decompressor() = default;
  virtual ~Decompressor() = default;
  Decompressor(const Decompressor&) = delete;
  Decompressor& operator=(const Decompressor&) = delete;
  /// As much as fits. Throws McapError for damaged bytes.
  virtual Progress decompress(std::span<const std::uint8_t> from, std::span<std::uint8_t> to) = 0;
};

/// The records of one chunk, unpacked no further than they are asked for: a message that lies at
/// the beginning costs its own bytes only. Throws McapError, and DatasetError when the disk fails.
class ChunkReader {
 public:
  /// Of the chunk whose record begins there; the file must outlive this.
  ChunkReader(const InputFile& file, std::uint64_t offset);

  [[nodiscard]] std::uint64_t size() const { return head_.uncompressed_bytes; }
  /// The first so many bytes of its records; not checked against the CRC.
  [[nodiscard]] std::span<const std::uint8_t> first(std::uint64_t bytes);
  /// All of its records, which are what was written.
  [[nodiscard]] std::span<const std::uint8_t> all();

 private:
  void read_packed();

  const InputFile& file_;
  ChunkHead head_;
  /// What has not been read of the packed records.
  std::uint64_t next_ = 0;
  std::uint64_t left_ = 0;
  std::vector<std::uint8_t> buffer_;
  std::span<const std::uint8_t> packed_;
  std::unique_ptr<Decompressor> decompressor_;
  std::vector<std::uint8_t> records_;
  bool checked_ = false;
};

enum class Compression { none, lz4, zstd };

/// "", "lz4", "zstd".
[[nodiscard]] std::string_view compression_name(Compression compression);

/// Packs the records of a chunk.
[[nodiscard]] std::string compressed(std::string_view records, Compression compression);

}  // namespace stillmap::dds::mcap
