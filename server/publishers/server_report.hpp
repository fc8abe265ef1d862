#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "idl/interface/server_status.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/publishers/latest_map.hpp"

namespace stillmap::server {

/// What a status tells of the server that stays as it is.
struct ServerTraits {
  DeliveryMode delivery = DeliveryMode::latest;
  std::string label_source;
  std::string sensor;
  std::string points_topic;
  /// What is known to be wrong with the machine from the start.
  std::vector<dds::Diagnostic> host_diagnostics;
};

/// Puts the server's status together, and says in words why nothing happens. Thread-safe.
class ServerReport {
 public:
  /// `discovery_diagnostics`: what is wrong with the peers now. `no_input_reason` gives an empty
  /// text once scans arrive.
  ServerReport(ServerTraits traits, const LatestMap& latest_map, const Statistics& statistics,
               std::function<std::vector<dds::Diagnostic>()> discovery_diagnostics,
               std::function<std::string()> no_input_reason);

  [[nodiscard]] dds::ServerStatus status() const;

 private:
  [[nodiscard]] std::string reason(const dds::ServerStatus& status) const;

  ServerTraits traits_;
  std::string host_;
  const LatestMap& latest_map_;
  const Statistics& statistics_;
  std::function<std::vector<dds::Diagnostic>()> discovery_diagnostics_;
  std::function<std::string()> no_input_reason_;
  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
};

}  // namespace stillmap::server
