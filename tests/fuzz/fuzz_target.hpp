#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace stillmap::fuzz {

using Bytes = std::span<const std::uint8_t>;

/// A small sound input to start from.
struct Seed {
  std::string name;
  std::string bytes;
};

/// One of the ways in which bytes come from outside.
struct Target {
  const char* name;
  /// Any bytes are fine. What the product throws for bad ones is caught in here; whatever else
  /// happens is a fault.
  void (*run)(Bytes bytes);
  std::vector<Seed> (*seeds)();
};

// In targets/, a file each, whose head says what its bytes are. In the order in which a scan meets
// them; what is read from disk last.
extern const Target point_cloud_target;
extern const Target service_request_target;
extern const Target continuation_target;
extern const Target message_target;
extern const Target octomap_target;
extern const Target tile_target;
extern const Target map_file_target;
extern const Target map_rows_target;
extern const Target cloud_file_target;
extern const Target pose_file_target;
extern const Target bag_message_target;
extern const Target bag_file_target;
extern const Target mcap_file_target;
extern const Target onnx_target;
extern const Target model_folder_target;
extern const Target config_file_target;

}  // namespace stillmap::fuzz
