#pragma once

#include <memory>

#include "config/loaders/server_config.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap::server {

/// A running stillmap-server: scans on DDS in; poses, the map and answers out.
class Server {
 public:
  /// Starts everything. Throws DdsError, MapFileError, std::invalid_argument, or what the segmenter
  /// throws.
  Server(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter);
  ~Server();

  /// Ends mapping after the scan in work, and saves the map. Throws MapFileError.
  void stop();

 private:
  struct Parts;

  std::unique_ptr<Parts> parts_;
};

}  // namespace stillmap::server
