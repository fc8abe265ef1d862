#include "idl/dds/rtps_writer.hpp"

#include <fastdds/rtps/common/CacheChange.h>
#include <fastdds/rtps/writer/RTPSWriter.h>

#include <algorithm>
#include <mutex>

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

RTPSWriter& find_rtps_writer(const GUID_t& guid) {
  RTPSWriter* const found = RTPSDomainImpl::find_local_writer(guid);
  if (found == nullptr) throw DdsError("Fast DDS does not find a writer that it just made");
  return *found;
}

AcknowledgedSamples::AcknowledgedSamples(RTPSWriter& writer) : writer_(writer) {
  const std::scoped_lock lock(writer_.getMutex());
  inner_ = writer_.getListener();
  writer_.set_listener(this);
}

void AcknowledgedSamples::release() {
  const std::scoped_lock lock(writer_.getMutex());
  // They are acknowledged in their order.
  for (SequenceNumber_t first = writer_.get_seq_num_min();
       first != SequenceNumber_t::unknown() && first <= acknowledged_;
       first = writer_.get_seq_num_min()) {
    if (!writer_.remove_older_changes(1)) return;
  }
}

void AcknowledgedSamples::onWriterChangeReceivedByAll(RTPSWriter*, CacheChange_t* change) {
  acknowledged_ = std::max(acknowledged_, change->sequenceNumber);
}

void AcknowledgedSamples::onWriterMatched(RTPSWriter* writer, MatchingInfo& info) {
  inner_->onWriterMatched(writer, info);
}

void AcknowledgedSamples::onWriterMatched(
    RTPSWriter* writer, const eprosima::fastdds::dds::PublicationMatchedStatus& info) {
  inner_->onWriterMatched(writer, info);
}

void AcknowledgedSamples::on_offered_incompatible_qos(RTPSWriter* writer,
                                                      eprosima::fastdds::dds::PolicyMask qos) {
  inner_->on_offered_incompatible_qos(writer, qos);
}

void AcknowledgedSamples::on_liveliness_lost(
    RTPSWriter* writer, const eprosima::fastrtps::LivelinessLostStatus& status) {
  inner_->on_liveliness_lost(writer, status);
}

void AcknowledgedSamples::on_reader_discovery(RTPSWriter* writer,
                                              ReaderDiscoveryInfo::DISCOVERY_STATUS reason,
                                              const GUID& reader,
                                              const ReaderProxyData* reader_info) {
  inner_->on_reader_discovery(writer, reason, reader, reader_info);
}

}  // namespace stillmap::dds
