#pragma once

#include <memory>

#include "config/loaders/server_config.hpp"
#include "server/mapping/mapper_factory.hpp"

namespace stillmap::server {

/// A running stillmap-server: scans on DDS in; poses, the map and answers out.
class Server {
 public:
  /// Starts everything; the labels of a lidar that its scans tell are opened then. Throws DdsError,
  /// MapFileError, std::invalid_argument, or what `open_segmenter` throws.
  Server(const ServerConfig& config, const OpenSegmenter& open_segmenter);
  ~Server();

  /// Ends mapping after the scan in work, and saves the map. Throws MapFileError.
  void stop();

 private:
  struct Parts;

  std::unique_ptr<Parts> parts_;
};

}  // namespace stillmap::server
