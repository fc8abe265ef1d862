#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace stillmap::dds {

/// What kept requests of a service from an answer, and how often.
struct ServiceFault {
  /// "unreadable_request", "lost_request", "undelivered_reply" or "slow_client".
  std::string fault;
  /// "stillmap/get_status".
  std::string service;
  std::uint64_t count = 0;
  friend auto operator<=>(const ServiceFault&, const ServiceFault&) = default;
};

/// Counts the requests that a process could not answer. Thread-safe.
class ServiceFaults {
 public:
  /// A request that is not of the service's type: another version of it, or damaged.
  void unreadable_request(const std::string& service);
  /// So many requests that never came to be read: more of them came than wait at a time.
  void lost_requests(const std::string& service, std::uint64_t count);
  /// A reply that reached no client: it was never discovered, or left.
  void undelivered_reply(const std::string& service);

  /// A request of a client that does not take the replies it has: it was refused.
  void slow_client(const std::string& service);

  /// How often each occurred.
  [[nodiscard]] std::vector<ServiceFault> counts() const;
  /// How often this one occurred.
  [[nodiscard]] std::uint64_t count(const std::string& fault, const std::string& service) const;

 private:
  void add(const char* fault, const std::string& service, std::uint64_t times = 1);

  mutable std::mutex mutex_;
  std::map<std::pair<std::string, std::string>, std::uint64_t> counts_;
};

}  // namespace stillmap::dds
