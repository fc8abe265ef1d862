#include "idl/dds/service_server.hpp"

#include <utility>

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using eprosima::fastdds::dds::SampleInfo;

// How long a reply waits for the client's reader to be discovered.
constexpr auto match_timeout = 500ms;
// How often a waiting reply looks for its reader.
constexpr auto poll_period = 5ms;
// A Cyclone reader drops what comes before the first heartbeat that it hears after finding us. A
// client has found us when it asks, and our heartbeats are 50 ms apart.
constexpr auto cyclone_settle_time = 150ms;
// Replies that wait for their readers; what comes on top pushes the oldest out.
constexpr std::size_t max_waiting = 30;

}  // namespace

UntypedServiceServer::UntypedServiceServer(Participant& participant, const std::string& service,
                                           TypeSupport request_type, TypeSupport reply_type)
    : service_(service),
      faults_(participant.service_faults()),
      request_type_(std::move(request_type)),
      reply_type_(std::move(reply_type)),
      replies_(participant, reply_topic(service), reply_type_.get_type_name(), service_qos()),
      requests_(participant, request_topic(service), request_type_.get_type_name(), service_qos()) {
}

std::optional<ServiceCall> UntypedServiceServer::take(void* request, const std::stop_token& stop,
                                                      std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  SerializedSample bytes;
  SampleInfo info;
  do {
    send_waiting();
    if (requests_.take(bytes, info, stop, waiting_.empty() ? timeout : poll_period)) {
      return read(bytes, info, request);
    }
  } while (Clock::now() < deadline && !stop.stop_requested());
  return std::nullopt;
}

std::optional<ServiceCall> UntypedServiceServer::read(SerializedSample& bytes,
                                                      const SampleInfo& info, void* request) {
  ServiceCall call{.request_writer = info.sample_identity.writer_guid(),
                   .reply_identity = reply_identity(info),
                   .names_reply_reader = names_reply_reader(info),
                   .header = std::nullopt,
                   .is_readable = false};
  const bool needs_header = has_correlation_header(call.request_writer);
  if (needs_header) {
    call.header = take_correlation_header(bytes);
    remember(call.request_writer);
  }
  const bool is_complete = call.header.has_value() == needs_header;
  call.is_readable = is_complete && from_bytes(request_type_, bytes, request);
  if (!call.is_readable) faults_.unreadable_request(service_);
  if (!is_complete) return std::nullopt;
  return call;
}

void UntypedServiceServer::send_reply(const ServiceCall& call, const void* reply) {
  const std::size_t gap_bytes = call.header ? call.header->size() : 0;
  WaitingReply waiting{.call = call,
                       .bytes = to_bytes(reply_type_, reply, gap_bytes),
                       .deadline = Clock::now() + match_timeout};
  if (call.header) put_correlation_header(*call.header, waiting.bytes);
  if (waiting_.size() == max_waiting) {
    faults_.undelivered_reply(service_);
    waiting_.pop_front();
  }
  waiting_.push_back(std::move(waiting));
  send_waiting();
}

void UntypedServiceServer::send_waiting() {
  // A reply written before the client's reader is known never reaches it.
  const auto now = Clock::now();
  std::erase_if(waiting_, [&](const WaitingReply& reply) {
    const bool is_late = now >= reply.deadline;
    if (!is_late && !reaches_client(reply.call)) return false;
    if (is_late && !may_reach_client(reply.call)) {
      faults_.undelivered_reply(service_);
    } else {
      send(reply);
    }
    return true;
  });
}

void UntypedServiceServer::remember(const eprosima::fastrtps::rtps::GUID_t& request_writer) {
  const bool is_new = first_requests_.try_emplace(request_writer, Clock::now()).second;
  if (!is_new) return;
  std::erase_if(first_requests_, [this](const auto& client) {
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
  const auto first = first_requests_.find(call.request_writer);
  return first == first_requests_.end() || Clock::now() - first->second >= cyclone_settle_time;
}

bool UntypedServiceServer::may_reach_client(const ServiceCall& call) const {
  const bool is_client_there = replies_.readers().count_of_participant(call.request_writer) > 0;
  return !call.names_reply_reader && is_client_there;
}

void UntypedServiceServer::send(const WaitingReply& reply) {
  eprosima::fastrtps::rtps::WriteParams params;
  params.related_sample_identity() = reply.call.reply_identity;
  if (!replies_.write(reply.bytes, params)) faults_.undelivered_reply(service_);
}

}  // namespace stillmap::dds
