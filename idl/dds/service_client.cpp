#include "idl/dds/service_client.hpp"

#include <algorithm>
#include <limits>
#include <random>
#include <set>
#include <sstream>
#include <utility>

namespace stillmap::dds {
namespace {

/// Whether a stop was requested is looked at this often while no server is there.
constexpr std::chrono::milliseconds stop_period(100);

std::chrono::milliseconds left_until(std::chrono::steady_clock::time_point deadline) {
  const auto left = deadline - std::chrono::steady_clock::now();
  return std::max(std::chrono::ceil<std::chrono::milliseconds>(left), std::chrono::milliseconds(0));
}

std::int64_t random_number() {
  std::random_device device;
  // Room is left to count on.
  return std::uniform_int_distribution<std::int64_t>(
      1, std::numeric_limits<std::int64_t>::max() / 2)(device);
}

}  // namespace

UntypedServiceClient::UntypedServiceClient(Participant& participant, const std::string& service,
                                           TypeSupport request_type, TypeSupport reply_type)
    : request_type_(std::move(request_type)),
      reply_type_(std::move(reply_type)),
      call_number_(random_number()),
      requests_(participant, request_topic(service), request_type_.get_type_name(), service_qos()),
      replies_(participant, reply_topic(service), reply_type_.get_type_name(), service_qos()) {}

bool UntypedServiceClient::wait_for_server(std::chrono::milliseconds timeout) const {
  const auto deadline = Clock::now() + timeout;
  return requests_.readers().wait_for_any(timeout) &&
         replies_.events().wait_for_writer(left_until(deadline));
}

bool UntypedServiceClient::find_server(Clock::time_point deadline,
                                       const std::stop_token& stop) const {
  const auto period = stop.stop_possible() ? stop_period : std::chrono::milliseconds::max();
  while (!wait_for_server(std::min(left_until(deadline), period))) {
    if (stop.stop_requested() || Clock::now() >= deadline) return false;
  }
  return true;
}

bool UntypedServiceClient::call(const void* request, void* reply, std::chrono::milliseconds timeout,
                                const std::stop_token& stop) {
  return exchange(to_bytes(request_type_, request, 0), timeout, stop,
                  [&](SerializedSample& answer) { return from_bytes(reply_type_, answer, reply); });
}

std::optional<SerializedSample> UntypedServiceClient::call(const SerializedSample& request,
                                                           std::chrono::milliseconds timeout,
                                                           const std::stop_token& stop) {
  SerializedSample reply;
  const bool answered = exchange(request, timeout, stop, [&](SerializedSample& answer) {
    reply.swap(answer);
    return true;
  });
  return answered ? std::optional(std::move(reply)) : std::nullopt;
}

std::vector<std::string> UntypedServiceClient::who_answers(const void* request,
                                                           std::chrono::milliseconds timeout,
                                                           const std::stop_token& stop) {
  const auto deadline = Clock::now() + timeout;
  sent_.clear();
  send(to_bytes(request_type_, request, 0), {.client = replies_.guid(), .number = ++call_number_});
  std::set<std::string> found;
  SerializedSample bytes;
  eprosima::fastdds::dds::SampleInfo info;
  while (static_cast<int>(found.size()) < replies_.events().matched_writers() &&
         replies_.take(bytes, info, stop, left_until(deadline))) {
    if (!is_ours(info.related_sample_identity)) continue;
    std::ostringstream prefix;
    prefix << info.sample_identity.writer_guid().guidPrefix;
    found.insert(prefix.str());
  }
  return {found.begin(), found.end()};
}

bool UntypedServiceClient::exchange(const SerializedSample& request,
                                    std::chrono::milliseconds timeout, const std::stop_token& stop,
                                    const Accept& accept) {
  const auto now = Clock::now();
  if (!find_server(now + timeout, stop)) return false;
  sent_.clear();
  const RequestId id{.client = replies_.guid(), .number = ++call_number_};
  for (const auto deadline : {now + timeout / 2, now + timeout}) {
    send(request, id);
    if (receive(accept, stop, deadline)) return true;
    if (stop.stop_requested()) return false;
  }
  return false;
}

void UntypedServiceClient::send(const SerializedSample& request, const RequestId& id) {
  eprosima::fastrtps::rtps::WriteParams params;
  params.related_sample_identity() = identity_of_call(id);
  if (requests_.write(request, params)) sent_.push_back(params.sample_identity());
}

bool UntypedServiceClient::receive(const Accept& accept, const std::stop_token& stop,
                                   Clock::time_point deadline) {
  // Of a page of the map, as large as servers make it.
  constexpr std::size_t max_kept_bytes = 8U << 20U;
  eprosima::fastdds::dds::SampleInfo info;
  bool is_answered = false;
  while (!is_answered && replies_.take(received_, info, stop, left_until(deadline)))
    is_answered = is_ours(info.related_sample_identity) && accept(received_);
  if (received_.capacity() > max_kept_bytes) SerializedSample().swap(received_);
  return is_answered;
}

bool UntypedServiceClient::is_ours(const eprosima::fastrtps::rtps::SampleIdentity& answered) const {
  return std::ranges::any_of(sent_, [&](const auto& request) {
    return answered.sequence_number() == request.sequence_number() &&
           (answered.writer_guid() == replies_.guid() ||
            answered.writer_guid() == request.writer_guid());
  });
}

}  // namespace stillmap::dds
