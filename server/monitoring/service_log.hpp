#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "idl/conversions/map_query.hpp"
#include "server/monitoring/duration_histogram.hpp"

namespace stillmap::server {

/// What was asked of the server, and with what success. Thread-safe.
class ServiceLog {
 public:
  void answered(const std::string& service, wire::ReplyCode code, double seconds);

  struct Service {
    /// By the answer's code.
    std::map<wire::ReplyCode, std::uint64_t> answers;
    DurationHistogram times;
  };
  /// By the service's ROS 2 name.
  [[nodiscard]] std::map<std::string, Service> services() const;

 private:
  mutable std::mutex mutex_;
  std::map<std::string, Service> services_;
};

/// "ok", "invalid_request", ...
[[nodiscard]] const char* name(wire::ReplyCode code);

/// What a reply says of itself; the standard types say nothing, and their answers are taken for ok.
template <typename Reply>
[[nodiscard]] wire::ReplyCode code_of(const Reply& reply) {
  if constexpr (requires { reply.status().code(); }) {
    return static_cast<wire::ReplyCode>(reply.status().code());
  } else {
    return wire::ReplyCode::ok;
  }
}

/// `answer`, with every call written into the log, which must outlive it.
template <typename Answer>
[[nodiscard]] auto logged(ServiceLog& log, std::string service, Answer answer) {
  return [&log, service = std::move(service), answer = std::move(answer)](const auto& request) {
    const auto began = std::chrono::steady_clock::now();
    auto reply = answer(request);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
    log.answered(service, code_of(reply), took.count());
    return reply;
  };
}

}  // namespace stillmap::server
