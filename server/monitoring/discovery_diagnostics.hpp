#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "idl/dds/participant.hpp"
#include "idl/interface/diagnostic.hpp"

namespace stillmap {

/// What is wrong between the server and its peers: ends that do not fit, and identities that are
/// refused. Thread-safe.
class PeerReport {
 public:
  /// `first_seen` is called once for each finding, for the log.
  PeerReport(const Participant& participant, std::function<void(const Finding&)> first_seen);

  /// Not older than a second: with many peers it is work to compare all their ends.
  [[nodiscard]] std::vector<Finding> findings();

 private:
  [[nodiscard]] std::vector<Finding> look() const;

  const Participant& participant_;
  std::function<void(const Finding&)> first_seen_;
  std::mutex mutex_;
  std::chrono::steady_clock::time_point looked_;
  std::vector<Finding> last_;
  std::set<std::string> seen_;
};

}  // namespace stillmap
