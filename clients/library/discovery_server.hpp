#pragma once

#include <memory>

#include "idl/dds/dds_options.hpp"

namespace stillmap {

/// Tells DDS processes that register with it of each other, as long as it lives.
class DiscoveryServer {
 public:
  /// Listens at `options.discovery_port`. Throws DdsError when the port is taken.
  explicit DiscoveryServer(const dds::DdsOptions& options);
  ~DiscoveryServer();

 private:
  struct Registry;
  std::unique_ptr<Registry> registry_;
};

}  // namespace stillmap
