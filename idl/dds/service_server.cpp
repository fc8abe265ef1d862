#include "idl/dds/service_server.hpp"

#include <algorithm>
#include <utility>

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using eprosima::fastrtps::rtps::GUID_t;

// How long a reply waits for the client's reader to be discovered.
constexpr auto match_timeout = 500ms;
// How often a waiting reply looks for its reader.
constexpr auto poll_period = 5ms;
// A Cyclone reader takes the newest sample of the first heartbeat that it hears after finding us
// for old, and all before it: a reply whose own heartbeat is the first is lost. So heartbeats go
// out for this long before the first reply to a new client.
constexpr auto cyclone_settle_time = 150ms;
constexpr auto settling_heartbeat_period = 25ms;
// Replies that wait for their readers; what comes on top pushes the oldest out.
constexpr std::size_t max_waiting = 30;

std::string mebibytes(std::size_t bytes) { return std::to_string(bytes >> 20U) + " MiB"; }

Refusal unreadable(const std::string& type_name) {
  return {.code = stillmap_msgs::msg::ReplyStatus_Constants::INVALID_REQUEST,
          .reason = "the request cannot be read as a " + type_name +
                    "; client and server must have the same version of stillmap_msgs"};
}

Refusal too_slow() {
  return {.code = stillmap_msgs::msg::ReplyStatus_Constants::FAILED,
          .reason = "this client does not take its replies: " +
                    mebibytes(UntypedServiceServer::max_client_bytes) +
                    " or more of them were waiting, so this request was not carried out; was the "
                    "process stopped, or is its network slow? Ask again"};
}

Refusal given_up() {
  return {.code = stillmap_msgs::msg::ReplyStatus_Constants::FAILED,
          .reason =
              "the reply to this request was dropped: this client did not take it, and "
              "others waited for its memory; was the process stopped, or is its network "
              "slow? The request was carried out"};
}

/// The bytes that `make` makes after a gap for the call's header, with the header in it.
template <typename Make>
SerializedSample with_header(const ServiceCall& call, Make make) {
  SerializedSample bytes = make(call.header ? call.header->size() : 0);
  if (call.header) put_correlation_header(*call.header, bytes);
  return bytes;
}

}  // namespace

const SerializedSample* AnsweredRequests::find(const RequestId& id, Clock::time_point now) const {
  const auto found = std::ranges::find(answers_, id, &Answer::id);
  return found == answers_.end() || now - found->given > max_age ? nullptr : &found->reply;
}

void AnsweredRequests::add(const RequestId& id, SerializedSample reply, Clock::time_point now) {
  bytes_ += reply.size();
  answers_.push_back({.id = id, .reply = std::move(reply), .given = now});
  while (!answers_.empty() && (answers_.size() > max_count || bytes_ > max_bytes ||
                               now - answers_.front().given > max_age)) {
    bytes_ -= answers_.front().reply.size();
    answers_.pop_front();
  }
}

UntypedServiceServer::UntypedServiceServer(Participant& participant, const std::string& service,
                                           TypeSupport request_type, TypeSupport reply_type,
                                           bool carries_out_once, MakeRefusal make_refusal)
    : service_(service),
      carries_out_once_(carries_out_once),
      make_refusal_(std::move(make_refusal)),
      faults_(participant.service_faults()),
      request_type_(std::move(request_type)),
      reply_type_(std::move(reply_type)),
      replies_(participant, service, reply_type_.get_type_name()),
      requests_(participant, request_topic(service), request_type_.get_type_name(), service_qos()) {
}

std::optional<ServiceCall> UntypedServiceServer::take(void* request, const std::stop_token& stop,
                                                      std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  SerializedSample bytes;
  SampleInfo info;
  do {
    send_waiting();
    if (waiting_bytes_ > max_waiting_bytes) {
      std::this_thread::sleep_for(poll_period);
    } else if (requests_.take(bytes, info, stop, waiting_.empty() ? timeout : poll_period)) {
      if (auto call = read(bytes, info, request)) return call;
    }
  } while (Clock::now() < deadline && !stop.stop_requested());
  return std::nullopt;
}

std::optional<ServiceCall> UntypedServiceServer::read(SerializedSample& bytes,
                                                      const SampleInfo& info, void* request) {
  faults_.lost_requests(service_, request_losses_.add(info.sample_identity));
  ServiceCall call{.request_writer = info.sample_identity.writer_guid(),
                   .reply_identity = reply_identity(info),
                   .names_reply_reader = names_reply_reader(info),
                   .header = std::nullopt,
                   .id = request_id(info)};
  const bool needs_header = has_correlation_header(call.request_writer);
  if (needs_header) call.header = take_correlation_header(bytes);
  const bool is_complete = call.header.has_value() == needs_header;
  if (!is_complete || !from_bytes(request_type_, bytes, request)) {
    faults_.unreadable_request(service_);
    // Without its header, a client of Cyclone's cannot even be refused.
    if (is_complete) refuse(call, unreadable(request_type_.get_type_name()));
    return std::nullopt;
  }
  if (answer_again(call)) return std::nullopt;
  if (replies_.is_slow(call.request_writer.guidPrefix, max_client_bytes, Clock::now())) {
    faults_.slow_client(service_);
    refuse(call, too_slow());
    return std::nullopt;
  }
  return call;
}

bool UntypedServiceServer::answer_again(const ServiceCall& call) {
  if (!call.id) return false;
  const SerializedSample* const reply = answered_.find(*call.id, Clock::now());
  if (reply == nullptr) return false;
  wait_for_reader(call, *reply);
  return true;
}

void UntypedServiceServer::refuse(const ServiceCall& call, const Refusal& refusal) {
  if (make_refusal_)
    wait_for_reader(call, with_header(call, [&](std::size_t gap_bytes) {
                      return make_refusal_(refusal, gap_bytes);
                    }));
}

void UntypedServiceServer::send_reply(const ServiceCall& call, const void* reply) {
  SerializedSample bytes = with_header(
      call, [&](std::size_t gap_bytes) { return to_bytes(reply_type_, reply, gap_bytes); });
  if (carries_out_once_ && call.id) answered_.add(*call.id, bytes, Clock::now());
  wait_for_reader(call, std::move(bytes));
}

void UntypedServiceServer::send_failure(const ServiceCall& call, const std::string& reason) {
  refuse(call, {.code = stillmap_msgs::msg::ReplyStatus_Constants::FAILED, .reason = reason});
}

void UntypedServiceServer::wait_for_reader(const ServiceCall& call, SerializedSample bytes) {
  if (waiting_.size() == max_waiting) {
    faults_.undelivered_reply(service_);
    waiting_bytes_ -= waiting_.front().bytes.size();
    waiting_.pop_front();
  }
  waiting_bytes_ += bytes.size();
  waiting_.push_back({.call = call, .bytes = std::move(bytes), .since = Clock::now()});
  send_waiting();
}

void UntypedServiceServer::send_waiting() {
  // A reply written before the client's reader is known never reaches it.
  const auto now = Clock::now();
  std::erase_if(waiting_, [&](const WaitingReply& reply) {
    if (!send_or_drop(reply, now)) return false;
    waiting_bytes_ -= reply.bytes.size();
    return true;
  });
  // What was acknowledged is released even while nothing is to be sent.
  if (waiting_.empty()) static_cast<void>(replies_.make_room(0, now));
}

bool UntypedServiceServer::send_or_drop(const WaitingReply& reply, Clock::time_point now) {
  if (reply.call.header) remember(reply.call.request_writer, now);
  if (reaches_client(reply.call)) return send(reply, now);
  if (reply.call.header) repeat_heartbeat(now);
  if (now - reply.since < match_timeout) return false;
  if (may_reach_client(reply.call)) return send(reply, now);
  faults_.undelivered_reply(service_);
  return true;
}

void UntypedServiceServer::repeat_heartbeat(Clock::time_point now) {
  if (now - last_heartbeat_ < settling_heartbeat_period) return;
  last_heartbeat_ = now;
  replies_.send_heartbeat();
}

void UntypedServiceServer::remember(const GUID_t& request_writer, Clock::time_point now) {
  if (!first_replies_.try_emplace(request_writer, now).second) return;
  std::erase_if(first_replies_, [this](const auto& client) {
    return !requests_.events().has_writer(client.first);
  });
}

bool UntypedServiceServer::reaches_client(const ServiceCall& call) const {
  const auto& readers = replies_.readers();
  if (call.names_reply_reader) return readers.has(call.reply_identity.writer_guid());
  // Which of the process's readers is the right one is not known. Each of its clients has a writer
  // and a reader: once all are found, the right one is.
  const int found = readers.count_of_participant(call.request_writer);
  if (found == 0 || found < requests_.events().writers_of_participant(call.request_writer))
    return false;
  if (!call.header) return true;
  const auto first = first_replies_.find(call.request_writer);
  return first == first_replies_.end() || Clock::now() - first->second >= cyclone_settle_time;
}

bool UntypedServiceServer::may_reach_client(const ServiceCall& call) const {
  const bool is_client_there = replies_.readers().count_of_participant(call.request_writer) > 0;
  return !call.names_reply_reader && is_client_there;
}

bool UntypedServiceServer::send(const WaitingReply& reply, Clock::time_point now) {
  for (const ServiceCall& lost : replies_.make_room(reply.bytes.size(), now)) {
    faults_.undelivered_reply(service_);
    if (!make_refusal_) continue;
    const SerializedSample refusal = with_header(
        lost, [&](std::size_t gap_bytes) { return make_refusal_(given_up(), gap_bytes); });
    static_cast<void>(replies_.write(lost, refusal, now));
  }
  if (!replies_.has_room(reply.bytes.size())) return false;
  if (!replies_.write(reply.call, reply.bytes, now)) faults_.undelivered_reply(service_);
  return true;
}

}  // namespace stillmap::dds
