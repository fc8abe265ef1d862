#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "clients/gateway/foxglove_protocol.hpp"
#include "clients/gateway/post.hpp"
#include "idl/dds/participant.hpp"
#include "idl/dds/serialized_sample.hpp"

namespace stillmap::gateway {

struct ServiceChoice {
  std::string server_name = "stillmap";
  /// Also those that change, save or replace the map.
  bool with_control = false;
  /// Longest wait for an answer, from when the gateway has the request.
  std::chrono::milliseconds timeout{10000};
};

/// Calls the server's services with requests in CDR, each service in a thread of its own, one call
/// after the other, clients in turn. A call whose client is gone, or whose time is up, before its
/// turn comes is not made. One thread uses it, that of `post`.
class ServiceBridge {
 public:
  ServiceBridge(dds::Participant& participant, const ServiceChoice& choice, Post post);
  ~ServiceBridge();
  ServiceBridge(const ServiceBridge&) = delete;
  ServiceBridge& operator=(const ServiceBridge&) = delete;

  /// Ids count from 1.
  [[nodiscard]] const std::vector<ServiceInfo>& services() const { return infos_; }
  [[nodiscard]] bool has(std::uint32_t service) const {
    return service >= 1 && service <= infos_.size();
  }

  /// The reply in CDR, or why there is none.
  using Answer = std::variant<dds::SerializedSample, std::string>;
  /// Whoever asks, for as long as it lives.
  using Client = std::weak_ptr<const void>;
  /// `answered` is called once, in the thread of `post`, unless the client has gone.
  void call(std::uint32_t service, Client client, dds::SerializedSample request,
            std::function<void(Answer)> answered);

 private:
  class Caller;

  Post post_;
  std::vector<ServiceInfo> infos_;
  std::vector<std::unique_ptr<Caller>> callers_;
};

}  // namespace stillmap::gateway
