#include "server/monitoring/metrics_endpoint.hpp"

#include <prometheus/collectable.h>
#include <prometheus/exposer.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include "server/monitoring/metrics.hpp"

namespace stillmap::server {

class MetricsEndpoint::Exposed : public prometheus::Collectable {
 public:
  Exposed(Metrics& metrics, std::function<dds::ServerStatus()> status)
      : metrics_(metrics), status_(std::move(status)) {}

  [[nodiscard]] std::vector<prometheus::MetricFamily> Collect() const override {
    return metrics_.collect(status_());
  }

 private:
  Metrics& metrics_;
  std::function<dds::ServerStatus()> status_;
};

namespace {

/// Of the web server (civetweb) that the Prometheus library uses. Each connection takes a thread
/// until its request has come whole and the answer has been taken, so both are bounded in time:
/// connections that stay silent or drip cannot keep the threads. A scrape waits for its turn.
std::vector<std::string> web_server_options(const std::string& address) {
  return {"listening_ports",    address,  //
          "num_threads",        "16",     //
          "request_timeout_ms", "1000",   //
          "enable_keep_alive",  "no",     //
          "max_request_size",   "8192",   //
          "connection_queue",   "64",     //
          "listen_backlog",     "64"};
}

}  // namespace

class MetricsListener {
 public:
  explicit MetricsListener(const std::string& address) : exposer_(web_server_options(address)) {}
  prometheus::Exposer& exposer() { return exposer_; }

 private:
  prometheus::Exposer exposer_;
};

namespace {

std::unique_ptr<MetricsListener> listen_at(const std::string& address) {
  try {
    return std::make_unique<MetricsListener>(address);
  } catch (const std::exception& error) {
    throw std::runtime_error("metrics.address " + address + " cannot be listened on (" +
                             error.what() +
                             "): is the port taken, or the address not this machine's? Choose "
                             "another, or leave it empty to switch metrics off");
  }
}

}  // namespace

MetricsEndpoint::MetricsEndpoint(const std::string& address, Metrics& metrics,
                                 std::function<dds::ServerStatus()> status)
    : exposed_(std::make_shared<Exposed>(metrics, std::move(status))),
      listener_(listen_at(address)) {
  listener_->exposer().RegisterCollectable(exposed_);
  const std::string host = address.substr(0, address.rfind(':'));
  address_ = host + ":" + std::to_string(listener_->exposer().GetListeningPorts().at(0));
}

MetricsEndpoint::~MetricsEndpoint() = default;

}  // namespace stillmap::server
