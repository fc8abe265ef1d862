#pragma once

#include <fastdds/rtps/common/Guid.h>
#include <fastdds/rtps/common/SequenceNumber.h>
#include <fastdds/rtps/writer/WriterListener.h>

namespace eprosima::fastrtps::rtps {
class RTPSWriter;
}

namespace stillmap::dds {

/// The RTPS writer beneath a DataWriter. Throws DdsError where there is none.
[[nodiscard]] eprosima::fastrtps::rtps::RTPSWriter& find_rtps_writer(
    const eprosima::fastrtps::rtps::GUID_t& guid);

/// Puts off what Fast DDS does when all readers of a volatile writer have a sample: it removes that
/// from the history. Where a reader goes, Fast DDS 2.9 does so with the writer's locators locked,
/// which deadlocks with a thread that sends repairs or what is rate-limited (its pull request
/// 3468), and the process hears nobody any more. Samples are released by `release` instead, in the
/// thread that writes. For topics without keys.
class AcknowledgedSamples : public eprosima::fastrtps::rtps::WriterListener {
 public:
  using RTPSWriter = eprosima::fastrtps::rtps::RTPSWriter;

  /// Stands between the writer and its listener until the writer's end, which it must outlive.
  explicit AcknowledgedSamples(RTPSWriter& writer);

  /// Removes from the history what all readers have.
  void release();

 private:
  using GUID = eprosima::fastrtps::rtps::GUID_t;

  void onWriterMatched(RTPSWriter* writer, eprosima::fastrtps::rtps::MatchingInfo& info) override;
  void onWriterMatched(RTPSWriter* writer,
                       const eprosima::fastdds::dds::PublicationMatchedStatus& info) override;
  void on_offered_incompatible_qos(RTPSWriter* writer,
                                   eprosima::fastdds::dds::PolicyMask qos) override;
  void onWriterChangeReceivedByAll(RTPSWriter* writer,
                                   eprosima::fastrtps::rtps::CacheChange_t* change) override;
  void on_liveliness_lost(RTPSWriter* writer,
                          const eprosima::fastrtps::LivelinessLostStatus& status) override;
  void on_reader_discovery(RTPSWriter* writer,
                           eprosima::fastrtps::rtps::ReaderDiscoveryInfo::DISCOVERY_STATUS reason,
                           const GUID& reader,
                           const eprosima::fastrtps::rtps::ReaderProxyData* reader_info) override;

  RTPSWriter& writer_;
  eprosima::fastrtps::rtps::WriterListener* inner_;
  /// All up to this one; guarded by the writer's mutex.
  eprosima::fastrtps::rtps::SequenceNumber_t acknowledged_;
};

}  // namespace stillmap::dds
