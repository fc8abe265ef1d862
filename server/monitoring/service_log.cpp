#include "server/monitoring/service_log.hpp"

#include <spdlog/spdlog.h>

namespace stillmap::server {

void ServiceLog::answered(const std::string& service, wire::ReplyCode code, double seconds) {
  {
    const std::scoped_lock lock(mutex_);
    Service& entry = services_[service];
    ++entry.answers[code];
    entry.times.add(seconds);
  }
  spdlog::debug("{}: {} in {:.1f} ms", service, name(code), 1000.0 * seconds);
}

std::map<std::string, ServiceLog::Service> ServiceLog::services() const {
  const std::scoped_lock lock(mutex_);
  return services_;
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
