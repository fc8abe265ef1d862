#pragma once

#include <mutex>
#include <optional>
#include <string>

#include "idl/dds/service_asker.hpp"
#include "idl/dds/type_support.hpp"

namespace stillmap {

/// Asks one ROS 2 service. Thread-safe: requests wait for each other.
template <typename Request, typename Reply>
class ServiceClient {
 public:
  /// Throws DdsError when the topics cannot be made.
  ServiceClient(Participant& participant, const std::string& service)
      : asker_(participant, service, type_support<Request>(), type_support<Reply>()) {}

  /// True once both of the server's ends are discovered; false after `timeout`.
  [[nodiscard]] bool wait_for_server(std::chrono::milliseconds timeout) const {
    return asker_.wait_for_server(timeout);
  }

  /// The answer; nothing after `timeout`. A request is sent again at half time: a server that was
  /// just restarted may have lost the first, and the first answer that comes is taken.
  [[nodiscard]] std::optional<Reply> ask(const Request& request,
                                         std::chrono::milliseconds timeout) {
    const std::scoped_lock lock(mutex_);
    Reply reply;
    if (!asker_.ask(&request, &reply, timeout)) return std::nullopt;
    return reply;
  }

 private:
  std::mutex mutex_;
  ServiceAsker asker_;
};

}  // namespace stillmap
