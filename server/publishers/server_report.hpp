#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "idl/interface/server_status.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap {

/// What a status tells of the server that stays as it is.
struct ServerTraits {
  DeliveryMode delivery = DeliveryMode::latest;
  std::string label_source;
  std::string sensor;
  std::string points_topic;
  /// What is known to be wrong with the machine from the start.
  std::vector<Finding> troubles;
};

/// Puts the server's status together, and says in words why nothing happens. Thread-safe.
class ServerReport {
 public:
  /// `peer_findings`: what is wrong with the peers now. `why_nothing_arrives` gives an empty text
  /// once scans arrive.
  ServerReport(ServerTraits traits, const MapBoard& board, const Statistics& statistics,
               std::function<std::vector<Finding>()> peer_findings,
               std::function<std::string()> why_nothing_arrives);

  [[nodiscard]] ServerStatus status() const;

 private:
  [[nodiscard]] std::string reason(const ServerStatus& status) const;

  ServerTraits traits_;
  std::string host_;
  const MapBoard& board_;
  const Statistics& statistics_;
  std::function<std::vector<Finding>()> peer_findings_;
  std::function<std::string()> why_nothing_arrives_;
  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
};

}  // namespace stillmap
