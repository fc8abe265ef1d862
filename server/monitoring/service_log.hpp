#pragma once

#include <chrono>
#include <string>
#include <utility>

#include "idl/conversions/map_query.hpp"

namespace stillmap::server {

class Metrics;

/// Counts and times the answers of each service. Thread-safe.
class ServiceLog {
 public:
  /// `metrics` must outlive it.
  explicit ServiceLog(Metrics& metrics) : metrics_(metrics) {}

  /// `service`: its ROS 2 name.
  void answered(const std::string& service, wire::ReplyCode code, double seconds);

 private:
  Metrics& metrics_;
};

/// "ok", "invalid_request", ...
[[nodiscard]] const char* name(wire::ReplyCode code);

/// The code in a reply's status; replies of standard types have none and count as ok.
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
