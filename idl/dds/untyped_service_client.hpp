#pragma once

#include <string>
#include <vector>

#include "idl/dds/serialized_sample.hpp"
#include "idl/dds/service_identity.hpp"

namespace stillmap::dds {

/// What ServiceClient does without knowing its types. Replies to everybody come by here, in forms
/// that are not ours, so none is read before it is known to be for us. One thread uses it.
class UntypedServiceClient {
 public:
  using TypeSupport = eprosima::fastdds::dds::TypeSupport;

  UntypedServiceClient(Participant& participant, const std::string& service,
                       TypeSupport request_type, TypeSupport reply_type);

  [[nodiscard]] bool wait_for_server(std::chrono::milliseconds timeout) const;

  /// Fills in `reply`; false after `timeout`. The objects must be of the service's types.
  [[nodiscard]] bool call(const void* request, void* reply, std::chrono::milliseconds timeout);

 private:
  using Clock = std::chrono::steady_clock;

  void send(const SerializedSample& request);
  [[nodiscard]] bool receive(void* reply, Clock::time_point deadline);
  [[nodiscard]] bool is_ours(const eprosima::fastrtps::rtps::SampleIdentity& answered) const;

  TypeSupport request_type_;
  TypeSupport reply_type_;
  std::vector<eprosima::fastrtps::rtps::SampleIdentity> sent_;
  // First: where permissions forbid a service, they are refused for its requests.
  SerializedSampleWriter requests_;
  SerializedSampleReader replies_;
};

}  // namespace stillmap::dds
