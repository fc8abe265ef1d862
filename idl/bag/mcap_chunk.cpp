#include "idl/bag/mcap_chunk.hpp"

#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>

namespace stillmap::dds::mcap {
namespace {

/// How much is read from the file, and unpacked, at a time.
constexpr std::size_t step_bytes = std::size_t{128} << 10U;

class Plain final : public Decompressor {
 public:
  Progress decompress(std::span<const std::uint8_t> from, std::span<std::uint8_t> to) override {
    const std::size_t bytes = std::min(from.size(), to.size());
    std::copy_n(from.begin(), bytes, to.begin());
    return {bytes, bytes};
  }
};

class Zstd final : public Decompressor {
 public:
  Progress decompress(std::span<const std::uint8_t> from, std::span<std::uint8_t> to) override {
    ZSTD_inBuffer in{from.data(), from.size(), 0};
    ZSTD_outBuffer out{to.data(), to.size(), 0};
    const std::size_t result = ZSTD_decompressStream(stream_.get(), &out, &in);
    if (ZSTD_isError(result) != 0) {
      throw McapError(std::string("its zstd is damaged: ") + ZSTD_getErrorName(result));
    }
    return {in.pos, out.pos};
  }

 private:
  struct Free {
    void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
  };
  std::unique_ptr<ZSTD_DStream, Free> stream_{ZSTD_createDStream()};
};

class Lz4 final : public Decompressor {
 public:
  Lz4() {
    LZ4F_dctx* context = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) {
      throw McapError("lz4 cannot be set up");
    }
    context_.reset(context);
  }
  Progress decompress(std::span<const std::uint8_t> from, std::span<std::uint8_t> to) override {
    std::size_t consumed = from.size(), produced = to.size();
    const std::size_t result =
        LZ4F_decompress(context_.get(), to.data(), &produced, from.data(), &consumed, nullptr);
    if (LZ4F_isError(result) != 0) {
      throw McapError(std::string("its lz4 is damaged: ") + LZ4F_getErrorName(result));
    }
    return {consumed, produced};
  }

 private:
  struct Free {
    void operator()(LZ4F_dctx* context) const { LZ4F_freeDecompressionContext(context); }
  };
  std::unique_ptr<LZ4F_dctx, Free> context_;
};

std::unique_ptr<Decompressor> decompressor_for(const std::string& compression) {
  if (compression.empty() || compression == "none") return std::make_unique<Plain>();
  if (compression == "zstd") return std::make_unique<Zstd>();
  if (compression == "lz4") return std::make_unique<Lz4>();
  throw McapError("its compression is '" + compression.substr(0, 20) +
                  "'; none, zstd and lz4 are read");
}

/// Of a chunk's content, as far as its records: more than any compression's name needs.
constexpr std::size_t max_chunk_head_bytes = 256;

}  // namespace

std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t before) {
  if (bytes.empty()) return before;
  return static_cast<std::uint32_t>(crc32_z(before, bytes.data(), bytes.size()));
}

ChunkReader::ChunkReader(const InputFile& file, std::uint64_t offset) : file_(file) {
  const auto fits = [&](std::uint64_t from, std::uint64_t bytes) {
    return from <= file.size() && bytes <= file.size() - from;
  };
  if (!fits(offset, record_head_bytes)) throw McapError("it lies behind the end of the file");
  const RecordHead record = parse_record_head(file.read(offset, record_head_bytes));
  const std::uint64_t content = offset + record_head_bytes;
  if (record.opcode != Opcode::chunk) throw McapError("there is no chunk where one should be");
  if (!fits(content, record.length)) throw McapError("it goes beyond the end of the file");
  std::size_t head_bytes = 0;
  head_ = parse_chunk_head(file.read(content, static_cast<std::size_t>(std::min<std::uint64_t>(
                                                  record.length, max_chunk_head_bytes))),
                           head_bytes);
  if (head_.compressed_bytes > record.length - head_bytes) {
    throw McapError("its records are longer than it is");
  }
  if (head_.uncompressed_bytes > max_chunk_bytes) {
    throw McapError("it unpacks to " + std::to_string(head_.uncompressed_bytes >> 20U) +
                    " MiB, and at most " + std::to_string(max_chunk_bytes >> 20U) +
                    " are read: 'mcap compress IN -o OUT --chunk-size 4194304' makes smaller ones");
  }
  next_ = content + head_bytes;
  left_ = head_.compressed_bytes;
  decompressor_ = decompressor_for(head_.compression);
}

void ChunkReader::read_packed() {
  if (left_ == 0) throw McapError("its packed records end too early");
  buffer_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(left_, step_bytes)));
  file_.read(next_, buffer_);
  next_ += buffer_.size();
  left_ -= buffer_.size();
  packed_ = buffer_;
}

std::span<const std::uint8_t> ChunkReader::first(std::uint64_t bytes) {
  if (bytes > size()) throw McapError("a record goes beyond its end");
  while (records_.size() < bytes) {
    // In steps, so that a chunk that only says that it is large costs nothing.
    const std::size_t before = records_.size();
    records_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(size(), before + step_bytes)));
    const auto made = decompressor_->decompress(packed_, std::span(records_).subspan(before));
    records_.resize(before + made.produced);
    packed_ = packed_.subspan(made.consumed);
    if (made.consumed > 0 || made.produced > 0) continue;
    if (!packed_.empty()) throw McapError("its packed records do not go on");
    read_packed();
  }
  return std::span(records_).first(static_cast<std::size_t>(bytes));
}

std::span<const std::uint8_t> ChunkReader::all() {
  const auto records = first(size());
  if (!checked_ && head_.crc != 0 && crc32(records) != head_.crc) {
    throw McapError("its bytes are not those that were written (CRC)");
  }
  checked_ = true;
  return records;
}

std::string_view compression_name(Compression compression) {
  constexpr std::array<std::string_view, 3> names{"", "lz4", "zstd"};
  return names.at(static_cast<std::size_t>(compression));
}

std::string compressed(std::string_view records, Compression compression) {
  if (compression == Compression::none) return std::string(records);
  // Recording must not take processor time from mapping.
  constexpr int zstd_level = 1;
  std::string packed(compression == Compression::zstd
                         ? ZSTD_compressBound(records.size())
                         : LZ4F_compressFrameBound(records.size(), nullptr),
                     '\0');
  const std::size_t bytes =
      compression == Compression::zstd
          ? ZSTD_compress(packed.data(), packed.size(), records.data(), records.size(), zstd_level)
          : LZ4F_compressFrame(packed.data(), packed.size(), records.data(), records.size(),
                               nullptr);
  packed.resize(bytes);
  return packed;
}

}  // namespace stillmap::dds::mcap
