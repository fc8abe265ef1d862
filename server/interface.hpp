#pragma once

#include <list>
#include <optional>
#include <string>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "idl/dds/participant.hpp"
#include "idl/interface/topics.hpp"
#include "server/mapping/mapping.hpp"
#include "server/mapping/scan_receiver.hpp"
#include "server/monitoring/service_log.hpp"
#include "server/publishers/map_publisher.hpp"
#include "server/publishers/status_publisher.hpp"
#include "server/services/map_services.hpp"
#include "server/traversability/traversability.hpp"

namespace stillmap::server {

/// What the interface uses of the rest of the server; all of it must outlive the interface.
struct InterfaceContext {
  dds::Participant& participant;
  const dds::Topics& topics;
  Statistics& statistics;
  ServiceLog& service_log;
  MapStorage& storage;
  Mapping& mapping;
  const Traversability& traversability;
  /// Null: no octree.
  const OccupancyThread* occupancy = nullptr;
};

/// What clients and the sensor see of the server on DDS, apart from what mapping publishes for each
/// scan: the input topic, map topics, status and services.
class Interface {
 public:
  /// Throws DdsError.
  Interface(const ServerConfig& config, const InterfaceContext& context);

  /// Answers no more requests, and then takes no more scans. The map is still published, until
  /// destruction.
  void stop();

  /// Thread-safe.
  [[nodiscard]] dds::ServerStatus status() const;

 private:
  void start_receivers(const ServerConfig& config, const InterfaceContext& context);
  /// Of discovery, and about scans that get lost.
  [[nodiscard]] std::vector<dds::Diagnostic> diagnostics();
  /// Why no scan has arrived yet; empty once one has.
  [[nodiscard]] std::string no_input_reason() const;
  [[nodiscard]] ServiceContext service_context(const ServerConfig& config,
                                               const InterfaceContext& context) const;

  const dds::Participant& participant_;
  MapPublisher map_publisher_;
  /// Of several lidars.
  std::optional<SweepInput> sweeps_;
  /// One a topic.
  std::list<ScanReceiver> receivers_;
  DiscoveryDiagnostics discovery_diagnostics_;
  ServerReport report_;
  std::optional<MapServices> services_;
  std::optional<StatusPublisher> status_publisher_;
};

}  // namespace stillmap::server
