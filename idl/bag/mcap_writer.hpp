#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "idl/bag/bag_metadata.hpp"
#include "idl/bag/bag_storage.hpp"
#include "idl/bag/mcap_chunk.hpp"
#include "idl/bag/mcap_records.hpp"

namespace stillmap::dds {

/// Writes an .mcap file with chunks, their indexes, a summary and all CRCs. Each chunk brings the
/// channels that it is the first to use, so that a file that ends after any chunk can be read.
class McapWriter final : public BagStorage {
 public:
  /// Replaces the file.
  McapWriter(const std::filesystem::path& file, const std::vector<BagTopic>& topics,
             mcap::Compression compression);
  ~McapWriter() override;

  void add(std::size_t topic, std::int64_t received_ns,
           std::span<const std::uint8_t> message) override;
  /// Ends the chunk.
  void commit() override;
  void finish() override;

 private:
  /// The chunk that is being filled.
  struct OpenChunk {
    std::string records;
    /// By channel; those without a message have no entries.
    std::vector<mcap::MessageIndex> indexes;
    std::uint64_t start_ns = 0;
    std::uint64_t end_ns = 0;
  };

  void add_channels(const std::vector<BagTopic>& topics);
  void begin_chunk();
  /// In the chunk, before the first message of it.
  void define(const mcap::Channel& channel);
  void count(const mcap::MessageHead& message);
  [[nodiscard]] mcap::ChunkHead append_packed(std::string& to) const;
  [[nodiscard]] std::string summary(std::uint64_t begin) const;
  /// Either all of it comes into the file, or nothing.
  void write(std::string_view bytes);

  std::filesystem::path file_;
  int descriptor_ = -1;
  mcap::Compression compression_;
  std::vector<mcap::Schema> schemas_;
  std::vector<mcap::Channel> channels_;
  std::vector<std::uint32_t> sequences_;
  OpenChunk chunk_;
  std::vector<mcap::ChunkIndex> chunks_;
  mcap::Statistics statistics_;
  std::uint64_t written_ = 0;
  std::uint32_t data_crc_ = 0;
};

}  // namespace stillmap::dds
