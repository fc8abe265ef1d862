#include "idl/dds/reply_writer.hpp"

#include <fastdds/rtps/common/CacheChange.h>
#include <fastdds/rtps/writer/StatefulWriter.h>

#include <fastdds/rtps/interfaces/IReaderDataFilter.hpp>
#include <mutex>

#include "idl/dds/rtps_writer.hpp"

// Replies are for one reader each, and what their writer holds must be bounded in bytes; DataWriter
// offers neither. The RTPS writer beneath has both in its public interface.
namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using namespace eprosima::fastrtps::rtps;

// Many heartbeats.
constexpr std::chrono::duration<double> min_patience = 500ms;
// Under a rate limit, so many times what sending all of them takes.
constexpr double sending_margin = 2.0;

/// Bytes bound what is held. The least recent reply would go first where their number did, whether
/// its client has it or not.
TopicQos reply_qos() {
  TopicQos qos = service_qos();
  qos.depth = 100'000;
  return qos;
}

GuidPrefix_t process_of(const ServiceCall& call) { return call.request_writer.guidPrefix; }

}  // namespace

/// The client's reader, or its writer where it names no reader, is in the process that asked.
class ReplyWriter::ToAskingProcess final : public eprosima::fastdds::rtps::IReaderDataFilter {
 public:
  [[nodiscard]] bool is_relevant(const CacheChange_t& reply, const GUID_t& reader) const override {
    const GUID_t& client = reply.write_params.related_sample_identity().writer_guid();
    return client == GUID_t::unknown() || client.guidPrefix == reader.guidPrefix;
  }
};

ReplyWriter::ReplyWriter(Participant& participant, const std::string& service,
                         const std::string& type_name)
    : rate_bytes_per_s_(participant.options().large_message_bytes_per_s),
      filter_(std::make_unique<ToAskingProcess>()),
      writer_(participant, reply_topic(service), type_name, reply_qos()),
      rtps_writer_(&find_rtps_writer(writer_.guid())) {
  const std::scoped_lock lock(rtps_writer_->getMutex());
  rtps_writer_->reader_data_filter(filter_.get());
}

ReplyWriter::~ReplyWriter() = default;

std::vector<ServiceCall> ReplyWriter::make_room(std::size_t bytes, Clock::time_point now) {
  const auto wait = patience();
  std::vector<ServiceCall> lost;
  while (!held_.empty()) {
    const Held& oldest = held_.front();
    if (!is_acknowledged(oldest)) {
      if (has_room(bytes) || now - oldest.written < wait) break;
      lost.push_back(oldest.call);
      given_up_.insert(process_of(oldest.call));
    }
    release_oldest();
  }
  if (held_.empty() && lost.empty()) given_up_.clear();
  return lost;
}

bool ReplyWriter::has_room(std::size_t bytes) const {
  return held_.empty() || held_bytes_ + bytes <= max_held_bytes;
}

bool ReplyWriter::write(const ServiceCall& call, const SerializedSample& reply,
                        Clock::time_point now) {
  WriteParams params;
  params.related_sample_identity() = call.reply_identity;
  if (!writer_.write(reply, params)) return false;
  held_.push_back({.number = params.sample_identity().sequence_number(),
                   .call = call,
                   .bytes = reply.size(),
                   .written = now});
  held_bytes_ += reply.size();
  return true;
}

std::chrono::duration<double> ReplyWriter::patience() const {
  if (rate_bytes_per_s_ == 0) return min_patience;
  return min_patience + std::chrono::duration<double>(
                            sending_margin * static_cast<double>(held_bytes_) / rate_bytes_per_s_);
}

bool ReplyWriter::is_slow(const GuidPrefix& client, std::size_t max_bytes, Clock::time_point now) {
  std::size_t bytes = 0;
  bool is_overdue = false;
  for (const Held& reply : held_) {
    if (process_of(reply.call) != client || is_acknowledged(reply)) continue;
    bytes += reply.bytes;
    is_overdue = is_overdue || now - reply.written >= patience();
  }
  if (bytes == 0) given_up_.erase(client);
  // On a slow network, its replies keep those of others waiting long before any is overdue.
  const bool is_waited_for = is_overdue || rate_bytes_per_s_ > 0;
  return given_up_.contains(client) || (is_waited_for && bytes >= max_bytes);
}

void ReplyWriter::send_heartbeat() {
  // Reliable writers are stateful. As a heartbeat of liveliness it goes out although nothing is to
  // be acknowledged.
  static_cast<StatefulWriter*>(rtps_writer_)->send_periodic_heartbeat(false, true);
}

bool ReplyWriter::is_acknowledged(const Held& reply) const {
  CacheChange_t change;
  change.writerGUID = rtps_writer_->getGuid();
  change.sequenceNumber = reply.number;
  return rtps_writer_->is_acked_by_all(&change);
}

void ReplyWriter::release_oldest() {
  {
    // Fast DDS releases it itself once every reader has heard that it is none of theirs; a stopped
    // one never does.
    const std::scoped_lock lock(rtps_writer_->getMutex());
    if (rtps_writer_->get_seq_num_min() == held_.front().number) {
      rtps_writer_->remove_older_changes(1);
    }
  }
  held_bytes_ -= held_.front().bytes;
  held_.pop_front();
}

}  // namespace stillmap::dds
