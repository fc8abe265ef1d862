#pragma once

#include <functional>
#include <memory>
#include <string>

#include "idl/interface/server_status.hpp"

namespace stillmap::server {

class Metrics;

/// Answers Prometheus over HTTP at /metrics, in a thread of its own, until destroyed. A request
/// must come within a second and in 8 KiB, and its answer be taken within five: connections that
/// stay silent, drip or do not read hold up nobody.
class MetricsEndpoint {
 public:
  /// `status` is called for every request, in that thread. Throws std::runtime_error that
  /// names the address when it cannot be listened on.
  MetricsEndpoint(const std::string& address, Metrics& metrics,
                  std::function<dds::ServerStatus()> status);
  ~MetricsEndpoint();

  /// Where it listens, with the port that was free for port 0.
  [[nodiscard]] const std::string& address() const { return address_; }

 private:
  std::unique_ptr<class MetricsListener> listener_;
  std::string address_;
};

}  // namespace stillmap::server
