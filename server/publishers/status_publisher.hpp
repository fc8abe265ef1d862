#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "idl/dds/participant.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/diagnostic.hpp"
#include "idl/interface/server_status.hpp"
#include "idl/interface/topics.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/publishers/namesakes.hpp"
#include "server/threads/periodic_worker.hpp"
#include "stillmap_msgs.h"

namespace stillmap::server {

/// Problems between the server and the other participants of its domain: endpoints whose types or
/// quality of service do not match, identities that are refused, and other servers of its name.
/// Thread-safe.
class DiscoveryDiagnostics {
 public:
  /// Each diagnostic is also logged when it occurs and was not among the last thousand.
  /// `name_space`: of the server's topics, by which clients call it.
  DiscoveryDiagnostics(dds::Participant& participant, const std::string& name_space);

  /// At most a second old: comparing all endpoints takes time in a domain of many participants.
  [[nodiscard]] std::vector<dds::Diagnostic> diagnostics();

  /// Why a request that changes something is refused: it went to other servers of this name, too,
  /// which are named. Empty while none is there. As discovery knows it now.
  [[nodiscard]] std::string namesake_refusal();

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] std::vector<dds::Diagnostic> collect();

  const dds::Participant& participant_;
  const std::string name_space_;
  Namesakes namesakes_;
  std::mutex mutex_;
  Clock::time_point collected_;
  std::vector<dds::Diagnostic> last_;
  NewLines logged_;
};

/// Problems of this machine, logged too: socket buffers smaller than wanted, peers that are
/// unknown.
[[nodiscard]] std::vector<dds::Diagnostic> host_diagnostics(const dds::Participant& participant);

/// The part of the status that does not change.
struct ServerTraits {
  DeliveryMode delivery = DeliveryMode::latest;
  std::string label_source;
  std::string points_topic;
  std::vector<dds::Diagnostic> host_diagnostics;
};

/// Puts the server's status together, and says in words why nothing happens. Thread-safe.
class ServerReport {
 public:
  /// `discovery_diagnostics`: the current ones. `no_input_reason` returns an empty text once scans
  /// arrive.
  ServerReport(ServerTraits traits, const LatestMap& latest_map, const Statistics& statistics,
               std::function<std::vector<dds::Diagnostic>()> discovery_diagnostics,
               std::function<std::string()> no_input_reason);

  [[nodiscard]] dds::ServerStatus status() const;

 private:
  [[nodiscard]] std::string reason(const dds::ServerStatus& status) const;
  /// What keeps scans from being mapped as they should.
  [[nodiscard]] std::string mapping_fault(const dds::ServerStatus& status) const;

  ServerTraits traits_;
  std::string host_;
  const LatestMap& latest_map_;
  const Statistics& statistics_;
  std::function<std::vector<dds::Diagnostic>()> discovery_diagnostics_;
  std::function<std::string()> no_input_reason_;
};

/// Publishes the status every period, and within 0.1 s after the odometry's health changed.
class StatusPublisher {
 public:
  StatusPublisher(dds::Participant& participant, const dds::Topics& topics, double period_s,
                  std::function<dds::ServerStatus()> status);

 private:
  void publish_when_due();

  std::chrono::duration<double> period_;
  std::function<dds::ServerStatus()> status_;
  std::chrono::steady_clock::time_point last_;
  OdometryHealth last_health_ = OdometryHealth::initialised;
  dds::Writer<stillmap_msgs::msg::Status> writer_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
