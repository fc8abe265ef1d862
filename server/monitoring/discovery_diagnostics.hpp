#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "idl/dds/participant.hpp"
#include "idl/interface/diagnostic.hpp"

namespace stillmap::server {

/// What is wrong between the server and its peers: ends that do not fit, and identities that are
/// refused. Thread-safe.
class DiscoveryDiagnostics {
 public:
  /// `first_seen` is called once for each diagnostic, for the log.
  DiscoveryDiagnostics(const dds::Participant& participant,
                       std::function<void(const dds::Diagnostic&)> first_seen);

  /// Not older than a second: with many peers it is work to compare all their ends.
  [[nodiscard]] std::vector<dds::Diagnostic> diagnostics();

 private:
  [[nodiscard]] std::vector<dds::Diagnostic> collect() const;

  const dds::Participant& participant_;
  std::function<void(const dds::Diagnostic&)> first_seen_;
  std::mutex mutex_;
  std::chrono::steady_clock::time_point collected_;
  std::vector<dds::Diagnostic> last_;
  std::set<std::string> seen_;
};

}  // namespace stillmap::server
