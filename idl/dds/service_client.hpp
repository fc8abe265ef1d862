#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "idl/dds/dds_error.hpp"
#include "idl/dds/serialized_sample.hpp"
#include "idl/dds/service_identity.hpp"
#include "idl/dds/type_support.hpp"

namespace stillmap::dds {

/// What ServiceClient does without knowing its types. The reader gets the replies to all clients,
/// some in other vendors' forms, so none is decoded before it is known to be for this client. One
/// thread uses it.
class UntypedServiceClient {
 public:
  using TypeSupport = eprosima::fastdds::dds::TypeSupport;

  UntypedServiceClient(Participant& participant, const std::string& service,
                       TypeSupport request_type, TypeSupport reply_type);

  [[nodiscard]] bool wait_for_server(std::chrono::milliseconds timeout) const;

  /// Fills in `reply`; false after `timeout`, or when a stop was requested. The objects must be of
  /// the service's types.
  [[nodiscard]] bool call(const void* request, void* reply, std::chrono::milliseconds timeout,
                          const std::stop_token& stop);

  /// The same with bytes, neither of which is looked into.
  [[nodiscard]] std::optional<SerializedSample> call(const SerializedSample& request,
                                                     std::chrono::milliseconds timeout,
                                                     const std::stop_token& stop);

  /// Guid prefixes, as RemoteParticipant::guid, of those that answer this request within `timeout`:
  /// it is sent once, and all that offer the service are waited for, until a stop is requested. For
  /// requests that change nothing.
  [[nodiscard]] std::vector<std::string> who_answers(const void* request,
                                                     std::chrono::milliseconds timeout,
                                                     const std::stop_token& stop);

 private:
  using Clock = std::chrono::steady_clock;
  /// False for bytes that are no answer.
  using Accept = std::function<bool(SerializedSample&)>;

  [[nodiscard]] bool find_server(Clock::time_point deadline, const std::stop_token& stop) const;
  [[nodiscard]] bool exchange(const SerializedSample& request, std::chrono::milliseconds timeout,
                              const std::stop_token& stop, const Accept& accept);
  void send(const SerializedSample& request, const RequestId& id);
  [[nodiscard]] bool receive(const Accept& accept, const std::stop_token& stop,
                             Clock::time_point deadline);
  [[nodiscard]] bool is_ours(const eprosima::fastrtps::rtps::SampleIdentity& answered) const;

  TypeSupport request_type_;
  TypeSupport reply_type_;
  /// Of the newest call. Begins anywhere, so that two processes whose guids are the same, one after
  /// the other, are told apart.
  std::int64_t call_number_;
  std::vector<eprosima::fastrtps::rtps::SampleIdentity> sent_;
  /// The newest answer's bytes, kept for their memory (ServiceClient::reuse says why).
  SerializedSample received_;
  // First: where permissions forbid a service, they are refused for its requests.
  SerializedSampleWriter requests_;
  SerializedSampleReader replies_;
};

/// Calls one ROS 2 service. Thread-safe: calls wait for each other.
template <typename Request, typename Reply>
class ServiceClient {
 public:
  /// Throws DdsError when the topics cannot be made. For a service that our permissions forbid,
  /// refusal() says so, and calls fail.
  ServiceClient(Participant& participant, const std::string& service) {
    try {
      client_.emplace(participant, service, type_support<Request>(), type_support<Reply>());
    } catch (const NotPermitted& error) {
      refusal_ = error.what();
    }
  }

  /// Why this service must not be called; empty when it may be.
  [[nodiscard]] const std::string& refusal() const { return refusal_; }

  /// True once the server's reader and writer are discovered; false after `timeout`. Throws
  /// NotPermitted.
  [[nodiscard]] bool wait_for_server(std::chrono::milliseconds timeout) const {
    if (!refusal_.empty()) throw NotPermitted(refusal_);
    return client_->wait_for_server(timeout);
  }

  /// Throws NotPermitted for a service that our permissions forbid. The answer; nothing after
  /// `timeout`, or when a stop was requested. A request is sent again at half time: a server that
  /// was just restarted may have lost the first, and the first answer that comes is taken. Both
  /// name the same call, which a service that changes something carries out once.
  [[nodiscard]] std::optional<Reply> call(const Request& request, std::chrono::milliseconds timeout,
                                          const std::stop_token& stop = {}) {
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    if (!refusal_.empty()) throw NotPermitted(refusal_);
    const Turn turn(*this, deadline);
    // The calls before this one may take all of its time.
    if (!turn.has_come()) return std::nullopt;
    Reply reply = take_spare();
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    if (!client_->call(&request, &reply, left, stop)) return std::nullopt;
    return reply;
  }

  /// The next answer is read into the memory of this one. What is asked for again and again and
  /// takes megabytes comes in half the time: where memory is given back to the system after each
  /// answer, it is got from there anew, page by page.
  void reuse(Reply reply) {
    const std::scoped_lock lock(mutex_);
    spare_ = std::move(reply);
  }

  /// As UntypedServiceClient::who_answers; nothing where calls of other threads take all of the
  /// time. Throws NotPermitted.
  [[nodiscard]] std::optional<std::vector<std::string>> who_answers(
      const Request& request, std::chrono::milliseconds timeout, const std::stop_token& stop = {}) {
    if (!refusal_.empty()) throw NotPermitted(refusal_);
    const Turn turn(*this, std::chrono::steady_clock::now() + timeout);
    if (!turn.has_come()) return std::nullopt;
    return client_->who_answers(&request, timeout, stop);
  }

 private:
  /// Of one call among those of several threads; no std::timed_mutex, which GCC 12's
  /// ThreadSanitizer does not know.
  class Turn {
   public:
    Turn(ServiceClient& client, std::chrono::steady_clock::time_point deadline) : client_(client) {
      std::unique_lock lock(client_.mutex_);
      has_come_ = client_.ended_.wait_until(lock, deadline, [this] { return !client_.is_called_; });
      if (has_come_) client_.is_called_ = true;
    }
    ~Turn() {
      if (!has_come_) return;
      const std::scoped_lock lock(client_.mutex_);
      client_.is_called_ = false;
      client_.ended_.notify_one();
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    [[nodiscard]] bool has_come() const { return has_come_; }

   private:
    ServiceClient& client_;
    bool has_come_ = false;
  };

  [[nodiscard]] Reply take_spare() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(spare_, Reply());
  }

  std::mutex mutex_;
  std::condition_variable ended_;
  bool is_called_ = false;
  Reply spare_;
  std::string refusal_;
  std::optional<UntypedServiceClient> client_;
};

}  // namespace stillmap::dds
