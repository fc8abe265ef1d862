#pragma once

#include <chrono>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "idl/dds/reply_writer.hpp"
#include "idl/dds/sample_losses.hpp"
#include "idl/dds/service_faults.hpp"
#include "idl/dds/service_identity.hpp"
#include "idl/dds/type_support.hpp"
#include "stillmap_msgs.h"

namespace stillmap::dds {

/// Why a request is not answered, as the status of a reply says it.
struct Refusal {
  std::uint8_t code = 0;
  std::string reason;
};

struct ServiceOptions {
  /// A call that comes again, as clients send it when its answer is late, is answered from memory:
  /// for services that change something.
  bool carries_out_once = false;
  /// Called once a second without requests.
  std::function<void()> idle = [] {};
  /// Does the thread's work, and what is to be done where that throws: what `answer` throws is
  /// refused in words, but the transport and `idle` can fail, too.
  std::function<void(const std::function<void()>& work)> run = [](const auto& work) { work(); };
  /// Answers one request and sends the reply, and returns after that.
  std::function<void(const std::function<void()>& work)> turn = [](const auto& work) { work(); };
};

/// The newest replies of a service, so that a call that comes again is answered again and not
/// carried out again. One thread at a time uses it.
class AnsweredRequests {
 public:
  using Clock = std::chrono::steady_clock;

  /// Beyond them, the oldest go.
  static constexpr std::size_t max_count = 1000;
  static constexpr std::size_t max_bytes = 4U << 20U;
  /// Longer than a client waits for an answer.
  static constexpr std::chrono::minutes max_age{10};

  /// The reply to this call; null when it has not been answered, or too long ago.
  [[nodiscard]] const SerializedSample* find(const RequestId& id, Clock::time_point now) const;

  void add(const RequestId& id, SerializedSample reply, Clock::time_point now);

  [[nodiscard]] std::size_t count() const { return answers_.size(); }

 private:
  struct Answer {
    RequestId id;
    SerializedSample reply;
    Clock::time_point given;
  };

  std::deque<Answer> answers_;
  std::size_t bytes_ = 0;
};

/// The server's end of one ROS 2 service, for clients of rmw_fastrtps and of rmw_cyclonedds. One
/// thread at a time uses it.
class UntypedServiceServer {
 public:
  using TypeSupport = eprosima::fastdds::dds::TypeSupport;
  /// The reply that says so, after a gap of so many bytes.
  using MakeRefusal =
      std::function<SerializedSample(const Refusal& refusal, std::size_t gap_bytes)>;

  /// Replies of a client that were not taken; what it asks beyond them is refused.
  static constexpr std::size_t max_client_bytes = 16U << 20U;
  /// Replies that wait to be written; beyond them, requests wait.
  static constexpr std::size_t max_waiting_bytes = 32U << 20U;

  /// `make_refusal` is empty where the reply's type cannot say why there is no answer. Throws
  /// DdsError when the topics cannot be made.
  UntypedServiceServer(Participant& participant, const std::string& service,
                       TypeSupport request_type, TypeSupport reply_type, bool carries_out_once,
                       MakeRefusal make_refusal);

  /// Waits for the next request that is to be carried out, and reads it into `request`, an object
  /// of the request's type; meanwhile sends replies that wait for their readers, and refuses or
  /// answers again what needs no more. Nothing after `timeout` or on a stop.
  [[nodiscard]] std::optional<ServiceCall> take(void* request, const std::stop_token& stop,
                                                std::chrono::milliseconds timeout);

  /// Sends the reply as soon as its reader is found; a reader that is not found in time gets none.
  void send_reply(const ServiceCall& call, const void* reply);

  /// Tells the client that its request failed, where the reply's type can.
  void send_failure(const ServiceCall& call, const std::string& reason);

 private:
  using Clock = std::chrono::steady_clock;
  using SampleInfo = eprosima::fastdds::dds::SampleInfo;

  struct WaitingReply {
    ServiceCall call;
    SerializedSample bytes;
    Clock::time_point since;
  };

  /// Nothing for a request that needs nothing more.
  [[nodiscard]] std::optional<ServiceCall> read(SerializedSample& bytes, const SampleInfo& info,
                                                void* request);
  /// True when the call was answered before, and is again.
  [[nodiscard]] bool answer_again(const ServiceCall& call);
  void refuse(const ServiceCall& call, const Refusal& refusal);
  void remember(const eprosima::fastrtps::rtps::GUID_t& request_writer, Clock::time_point now);
  [[nodiscard]] bool reaches_client(const ServiceCall& call) const;
  [[nodiscard]] bool may_reach_client(const ServiceCall& call) const;
  void wait_for_reader(const ServiceCall& call, SerializedSample bytes);
  void send_waiting();
  /// True when it needs to wait no more.
  [[nodiscard]] bool send_or_drop(const WaitingReply& reply, Clock::time_point now);
  /// False when there is no room yet.
  [[nodiscard]] bool send(const WaitingReply& reply, Clock::time_point now);
  void repeat_heartbeat(Clock::time_point now);

  std::string service_;
  bool carries_out_once_;
  MakeRefusal make_refusal_;
  ServiceFaults& faults_;
  TypeSupport request_type_;
  TypeSupport reply_type_;
  ReplyWriter replies_;
  SerializedSampleReader requests_;
  SampleLosses request_losses_;
  AnsweredRequests answered_;
  std::deque<WaitingReply> waiting_;
  std::size_t waiting_bytes_ = 0;
  /// When each client of rmw_cyclonedds was to get its first reply.
  std::map<eprosima::fastrtps::rtps::GUID_t, Clock::time_point> first_replies_;
  Clock::time_point last_heartbeat_;
};

/// A reply that can say in words why there is no answer.
template <typename Reply>
concept CarriesRefusal = requires(Reply reply) {
  reply.status().code(std::uint8_t{});
  reply.status().reason(std::string());
};

/// Answers the requests of one ROS 2 service, one at a time, on its own thread, from clients of
/// rmw_fastrtps and rmw_cyclonedds. Requests that cannot be read, and those of clients that do not
/// take the replies they have, are counted (Participant::service_faults) and refused, where the
/// reply has a status.
template <typename Request, typename Reply>
class ServiceServer {
 public:
  /// What `answer` throws is refused in words. Throws DdsError when the topics cannot be made.
  ServiceServer(Participant& participant, const std::string& service,
                std::function<Reply(const Request&)> answer, ServiceOptions options = {})
      : answer_(std::move(answer)),
        idle_(std::move(options.idle)),
        turn_(std::move(options.turn)),
        server_(participant, service, type_support<Request>(), type_support<Reply>(),
                options.carries_out_once, make_refusal()),
        thread_([this, run = std::move(options.run)](const std::stop_token& stop) {
          run([&] { serve(stop); });
        }) {}

 private:
  void serve(const std::stop_token& stop) {
    Request request;
    while (!stop.stop_requested()) {
      const auto call = server_.take(&request, stop, std::chrono::seconds(1));
      if (!call) {
        idle_();
        continue;
      }
      turn_([&] { answer(*call, request); });
    }
  }

  void answer(const ServiceCall& call, const Request& request) {
    try {
      const Reply reply = answer_(request);
      server_.send_reply(call, &reply);
    } catch (const std::exception& fault) {
      server_.send_failure(call, fault.what());
    }
  }

  static UntypedServiceServer::MakeRefusal make_refusal() {
    if constexpr (CarriesRefusal<Reply>) {
      return [](const Refusal& refusal, std::size_t gap_bytes) {
        Reply reply;
        reply.status().code(refusal.code);
        reply.status().reason(refusal.reason);
        return to_bytes(type_support<Reply>(), &reply, gap_bytes);
      };
    } else {
      return {};
    }
  }

  std::function<Reply(const Request&)> answer_;
  std::function<void()> idle_;
  std::function<void(const std::function<void()>& work)> turn_;
  UntypedServiceServer server_;
  // Last member: stops before the others are destroyed.
  std::jthread thread_;
};

}  // namespace stillmap::dds
