#include "idl/dds/rtps_writer.hpp"

#include <fastdds/rtps/common/CacheChange.h>
#include <fastdds/rtps/history/WriterHistory.h>
#include <fastdds/rtps/writer/RTPSWriter.h>

#include <mutex>
#include <utility>

#include "idl/dds/dds_error.hpp"

// Fast DDS 2.9 exports this function, but installs no header that declares it.
namespace eprosima::fastrtps::rtps {
class RTPSDomainImpl {
 public:
  static RTPSWriter* find_local_writer(const GUID_t& writer_guid);
};
}  // namespace eprosima::fastrtps::rtps

namespace stillmap::dds {

using namespace eprosima::fastrtps::rtps;

namespace {

/// The history of a writer, which Fast DDS gives to its own classes alone.
class HiddenHistory : public RTPSWriter {
 public:
  static const WriterHistory& of(const RTPSWriter& writer) {
    return *(writer.*(&HiddenHistory::mp_history));
  }
};

}  // namespace

RTPSWriter& find_rtps_writer(const GUID_t& guid) {
  RTPSWriter* const found = RTPSDomainImpl::find_local_writer(guid);
  if (found == nullptr) throw DdsError("Fast DDS does not find a writer that it just made");
  return *found;
}

RtpsWriterListener::RtpsWriterListener(RTPSWriter& writer, ReaderCallback reader_changed)
    : writer_(writer), reader_changed_(std::move(reader_changed)) {
  const std::scoped_lock lock(writer_.getMutex());
  inner_ = writer_.getListener();
  writer_.set_listener(this);
}

void RtpsWriterListener::release() {
  const std::scoped_lock lock(writer_.getMutex());
  const WriterHistory& history = HiddenHistory::of(writer_);
  for (const SequenceNumber_t& number : std::exchange(put_off_, {})) {
    CacheChange_t* change = nullptr;
    if (history.get_change(number, writer_.getGuid(), &change)) {
      inner_.load()->onWriterChangeReceivedByAll(&writer_, change);
    }
  }
}

void RtpsWriterListener::onWriterChangeReceivedByAll(RTPSWriter* writer, CacheChange_t* change) {
  // It is linked while it waits to be sent; nobody links it without the writer's mutex. With an
  // instance go other samples of it.
  const bool waits_to_be_sent = change->writer_info.is_linked.load();
  if (waits_to_be_sent || change->kind != ChangeKind_t::ALIVE) {
    put_off_.push_back(change->sequenceNumber);
  } else {
    inner_.load()->onWriterChangeReceivedByAll(writer, change);
  }
}

void RtpsWriterListener::onWriterMatched(RTPSWriter* writer, MatchingInfo& info) {
  reader_changed_(info.remoteEndpointGuid, info.status == MATCHED_MATCHING);
  inner_.load()->onWriterMatched(writer, info);
}

void RtpsWriterListener::onWriterMatched(
    RTPSWriter* writer, const eprosima::fastdds::dds::PublicationMatchedStatus& info) {
  inner_.load()->onWriterMatched(writer, info);
}

void RtpsWriterListener::on_offered_incompatible_qos(RTPSWriter* writer,
                                                     eprosima::fastdds::dds::PolicyMask qos) {
  inner_.load()->on_offered_incompatible_qos(writer, qos);
}

void RtpsWriterListener::on_liveliness_lost(
    RTPSWriter* writer, const eprosima::fastrtps::LivelinessLostStatus& status) {
  inner_.load()->on_liveliness_lost(writer, status);
}

void RtpsWriterListener::on_reader_discovery(RTPSWriter* writer,
                                             ReaderDiscoveryInfo::DISCOVERY_STATUS reason,
                                             const GUID& reader,
                                             const ReaderProxyData* reader_info) {
  WriterListener* const inner = inner_.load();
  if (inner != nullptr) inner->on_reader_discovery(writer, reason, reader, reader_info);
}

}  // namespace stillmap::dds
