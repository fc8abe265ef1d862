#include "idl/dds/service_faults.hpp"

namespace stillmap::dds {

void ServiceFaults::unreadable_request(const std::string& service) {
  count("unreadable_request_" + service);
}

void ServiceFaults::undelivered_reply(const std::string& service) {
  count("undelivered_reply_" + service);
}

void ServiceFaults::slow_client(const std::string& service) { count("slow_client_" + service); }

std::map<std::string, std::uint64_t> ServiceFaults::counts() const {
  const std::scoped_lock lock(mutex_);
  return counts_;
}

void ServiceFaults::count(const std::string& name) {
  const std::scoped_lock lock(mutex_);
  ++counts_[name];
}

}  // namespace stillmap::dds
