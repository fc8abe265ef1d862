#include "server/monitoring/metrics_endpoint.hpp"

#include <prometheus/collectable.h>
#include <prometheus/exposer.h>

#include <stdexcept>
#include <utility>

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

class MetricsListener {
 public:
  explicit MetricsListener(const std::string& address) : exposer_(address) {}
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
