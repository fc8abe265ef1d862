#include "idl/bag/zstd_decompression.hpp"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <memory>
#include <string>

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/cdr_reader.hpp"

namespace stillmap::dds {
namespace {

constexpr std::size_t max_message_bytes = std::size_t{1} << 30U;

struct FreeStream {
  void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
};

}  // namespace

bool is_zstd(std::span<const std::uint8_t> bytes) {
  constexpr std::array<std::uint8_t, 4> magic{0x28, 0xB5, 0x2F, 0xFD};
  return bytes.size() >= magic.size() && std::ranges::equal(bytes.first(magic.size()), magic);
}

std::vector<std::uint8_t> decompressed(std::span<const std::uint8_t> frame) {
  const auto size = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN) {
    throw CdrError("it is no zstd frame with its size, as the bag's compression mode says");
  }
  if (size > max_message_bytes) {
    throw CdrError("it says that it unpacks to " + std::to_string(size) + " bytes");
  }
  std::vector<std::uint8_t> content(static_cast<std::size_t>(size));
  const std::size_t written =
      ZSTD_decompress(content.data(), content.size(), frame.data(), frame.size());
  if (ZSTD_isError(written) != 0 || written != content.size()) {
    throw CdrError("its zstd frame is damaged");
  }
  return content;
}

void decompress_file(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::ifstream in(from, std::ios::binary);
  std::ofstream out(to, std::ios::binary | std::ios::trunc);
  if (!in) throw DatasetError(from, "cannot be read; check the path and its permissions");
  const std::unique_ptr<ZSTD_DStream, FreeStream> stream(ZSTD_createDStream());
  std::vector<char> packed(ZSTD_DStreamInSize()), content(ZSTD_DStreamOutSize());
  std::size_t left = 1;
  while (in.read(packed.data(), static_cast<std::streamsize>(packed.size())) || in.gcount() > 0) {
    ZSTD_inBuffer input{packed.data(), static_cast<std::size_t>(in.gcount()), 0};
    while (input.pos < input.size) {
      ZSTD_outBuffer output{content.data(), content.size(), 0};
      left = ZSTD_decompressStream(stream.get(), &output, &input);
      if (ZSTD_isError(left) != 0) {
        throw DatasetError(from, std::string("is damaged: ") + ZSTD_getErrorName(left));
      }
      out.write(content.data(), static_cast<std::streamsize>(output.pos));
    }
  }
  if (left != 0) throw DatasetError(from, "is cut off: its zstd frame does not end");
  out.close();
  if (!out)
    throw DatasetWriteError(to, "cannot be written; is the folder for temporary files full?");
}

}  // namespace stillmap::dds
