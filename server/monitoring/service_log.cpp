#include "server/monitoring/service_log.hpp"

#include <spdlog/spdlog.h>

#include "server/monitoring/metrics.hpp"

namespace stillmap::server {

void ServiceLog::answered(const std::string& service, wire::ReplyCode code, double seconds) {
  metrics_.service_requests.Add({{"service", service}, {"code", name(code)}}).Increment();
  Metrics::add_durations(metrics_.service_durations, {{"service", service}}).Observe(seconds);
  spdlog::debug("{}: {} in {:.1f} ms", service, name(code), 1000.0 * seconds);
}

const char* name(wire::ReplyCode code) {
  using enum wire::ReplyCode;
  switch (code) {
    case ok:
      return "ok";
    case invalid_request:
      return "invalid_request";
    case stale_continuation:
      return "stale_continuation";
    case failed:
      return "failed";
    case changes_unknown:
      return "changes_unknown";
    case too_large:
      return "too_large";
    case not_found:
      return "not_found";
  }
  return "unknown";
}

}  // namespace stillmap::server
