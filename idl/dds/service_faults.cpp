#include "idl/dds/service_faults.hpp"

namespace stillmap::dds {

void ServiceFaults::unreadable_request(const std::string& service) {
  add("unreadable_request", service);
}

void ServiceFaults::lost_requests(const std::string& service, std::uint64_t count) {
  if (count > 0) add("lost_request", service, count);
}

void ServiceFaults::undelivered_reply(const std::string& service) {
  add("undelivered_reply", service);
}

void ServiceFaults::slow_client(const std::string& service) { add("slow_client", service); }

std::vector<ServiceFault> ServiceFaults::counts() const {
  const std::scoped_lock lock(mutex_);
  std::vector<ServiceFault> faults;
  for (const auto& [what, count] : counts_) faults.push_back({what.first, what.second, count});
  return faults;
}

std::uint64_t ServiceFaults::count(const std::string& fault, const std::string& service) const {
  const std::scoped_lock lock(mutex_);
  const auto found = counts_.find({fault, service});
  return found == counts_.end() ? 0 : found->second;
}

void ServiceFaults::add(const char* fault, const std::string& service, std::uint64_t times) {
  const std::scoped_lock lock(mutex_);
  counts_[{fault, service}] += times;
}

}  // namespace stillmap::dds
