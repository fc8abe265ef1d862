#pragma once

#include <functional>
#include <memory>
#include <string>

#include "idl/interface/server_status.hpp"

namespace stillmap::server {

class Metrics;

/// Answers Prometheus over HTTP at /metrics, from its own threads, until destroyed. A request must
/// come within a second and in 8 KiB; one client that keeps to that is answered within seconds
/// beside a hundred that do not.
class MetricsEndpoint {
 public:
  /// `status` is called for every request, also by several threads. Throws std::runtime_error that
  /// names the address when it cannot be listened on.
  MetricsEndpoint(const std::string& address, Metrics& metrics,
                  std::function<dds::ServerStatus()> status);
  ~MetricsEndpoint();

  /// Where it listens, with the port that was free for port 0.
  [[nodiscard]] const std::string& address() const { return address_; }

 private:
  class Exposed;
  std::shared_ptr<Exposed> exposed_;
  std::unique_ptr<class MetricsListener> listener_;
  std::string address_;
};

}  // namespace stillmap::server
