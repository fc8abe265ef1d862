#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace stillmap::dds {

/// Counts the requests that a process could not answer. Thread-safe.
class ServiceFaults {
 public:
  /// A request that is not of the service's type: another version of it, or damaged.
  void unreadable_request(const std::string& service);
  /// A reply that reached no client: it was never discovered, or left.
  void undelivered_reply(const std::string& service);

  /// A request of a client that does not take the replies it has: it was refused.
  void slow_client(const std::string& service);

  /// How often each occurred: "unreadable_request_stillmap/get_status".
  [[nodiscard]] std::map<std::string, std::uint64_t> counts() const;

 private:
  void count(const std::string& name);

  mutable std::mutex mutex_;
  std::map<std::string, std::uint64_t> counts_;
};

}  // namespace stillmap::dds
