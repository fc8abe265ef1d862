#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "idl/bag/bag_metadata.hpp"
#include "idl/bag/bag_storage.hpp"
#include "idl/bag/mcap_chunk.hpp"

namespace stillmap::dds {

/// The file of a new bag.
enum class BagFormat { sqlite, mcap };

/// Writes a rosbag2 as ROS 2 does: a folder with metadata.yaml and one .db3 or .mcap file. What was
/// committed survives the end of the process at any moment and is read from there (SQLite's
/// write-ahead log, MCAP's chunks); finish() leaves a plain file. All throw DatasetError. One
/// thread uses it.
class BagWriter {
 public:
  /// Makes the folder, which must not be there yet, with the topics it will hold.
  /// `compression` is of MCAP.
  BagWriter(const std::filesystem::path& folder, const std::vector<BagTopic>& topics,
            BagFormat format = BagFormat::sqlite,
            mcap::Compression compression = mcap::Compression::none);
  /// Finishes, as well as it goes.
  ~BagWriter();
  BagWriter(const BagWriter&) = delete;
  BagWriter& operator=(const BagWriter&) = delete;

  /// Adds a serialized message with its encapsulation to topic number `topic`.
  void add(std::size_t topic, std::int64_t received_ns, std::span<const std::uint8_t> message);
  /// Writes all that was added to the disk, with the metadata.
  void commit();
  /// The last commit; nothing can be added after it.
  void finish();

  [[nodiscard]] std::uint64_t messages() const { return messages_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// With the messages added so far.
  [[nodiscard]] const std::vector<BagTopic>& topics() const { return metadata_.topics; }

 private:
  std::filesystem::path folder_;
  BagMetadata metadata_;
  std::uint64_t messages_ = 0;
  std::uint64_t committed_ = 0;
  std::uint64_t bytes_ = 0;
  std::unique_ptr<BagStorage> storage_;
};

/// What a writer of a topic offers, as Humble's rosbag2 notes it (YAML), so that 'ros2 bag play'
/// offers the same.
[[nodiscard]] std::string offered_qos_yaml(bool reliable, bool transient_local, int depth);

}  // namespace stillmap::dds
