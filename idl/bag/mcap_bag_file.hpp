#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "idl/bag/bag_file.hpp"
#include "idl/bag/input_file.hpp"
#include "idl/bag/mcap_chunk.hpp"
#include "idl/bag/mcap_contents.hpp"

namespace stillmap::dds {

/// An .mcap file of any size, finished or not: one chunk is in memory at a time.
class McapBagFile final : public BagFile {
 public:
  /// Refuses what does not begin as MCAP.
  explicit McapBagFile(const std::filesystem::path& file);

  [[nodiscard]] std::vector<BagTopic> topics() const override;
  [[nodiscard]] std::vector<BagMessage> messages(const std::string& topic,
                                                 std::size_t file) const override;
  [[nodiscard]] std::vector<std::uint8_t> bytes(const BagMessage& message) const override;
  [[nodiscard]] std::vector<std::uint8_t> first_bytes(const BagMessage& message,
                                                      int bytes) const override;
  [[nodiscard]] std::vector<std::string> faults() const override { return contents_.faults; }

 private:
  /// By the chunk's index of the channel; the numbers of chunks begin with 1.
  [[nodiscard]] std::vector<mcap::MessageIndexEntry> indexed_in(std::uint32_t chunk,
                                                                std::uint16_t channel) const;
  /// Among the chunk's records.
  [[nodiscard]] std::vector<mcap::MessageIndexEntry> found_in(std::uint32_t chunk,
                                                              std::uint16_t channel) const;
  /// At most so many bytes, without the heads; `checked`: by the CRC of the chunk.
  [[nodiscard]] std::vector<std::uint8_t> read(const BagMessage& message, std::uint64_t max_bytes,
                                               bool checked) const;
  [[nodiscard]] std::vector<std::uint8_t> read_outside_of_chunks(const BagMessage& message,
                                                                 std::uint64_t max_bytes) const;
  [[nodiscard]] std::vector<std::uint8_t> read_in_chunk(const BagMessage& message,
                                                        std::uint64_t max_bytes,
                                                        bool checked) const;
  [[nodiscard]] mcap::ChunkReader& chunk_reader(std::uint32_t chunk) const;

  InputFile file_;
  mcap::Contents contents_;
  /// Messages are read in the order of time, and so from one chunk after the other.
  mutable std::optional<mcap::ChunkReader> reader_;
  mutable std::uint32_t reader_chunk_ = 0;
};

}  // namespace stillmap::dds
