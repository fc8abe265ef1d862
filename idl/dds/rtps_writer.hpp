#pragma once

#include <fastdds/rtps/common/Guid.h>
#include <fastdds/rtps/common/SequenceNumber.h>
#include <fastdds/rtps/writer/WriterListener.h>

#include <atomic>
#include <functional>
#include <vector>

namespace eprosima::fastrtps::rtps {
class RTPSWriter;
}

namespace stillmap::dds {

/// The RTPS writer beneath a DataWriter. Throws DdsError where there is none.
[[nodiscard]] eprosima::fastrtps::rtps::RTPSWriter& find_rtps_writer(
    const eprosima::fastrtps::rtps::GUID_t& guid);

/// Stands between an RTPS writer and its listener, and tells which readers come and go.
///
/// Puts off some of what Fast DDS does when all readers of a writer have a sample: it removes that
/// from the history of a volatile writer, and an instance that was unregistered from any. Where a
/// reader goes, Fast DDS 2.9 does so with the writer's locators locked. A sample that waits to be
/// sent, for its turn under a limit of rate or once more for another reader, is removed under the
/// lock of the thread that sends, which waits for the locators: a deadlock, and the process hears
/// nobody any more. (Mended in Fast DDS 2.10.7, 2.14.5 and 3.1.1: its pull request 5432.) Such
/// samples are removed by `release` instead, in the thread that writes; all others at once, since
/// 2.9 counts wrongly for a reader of the same process that joins while the history has any.
class RtpsWriterListener : public eprosima::fastrtps::rtps::WriterListener {
 public:
  using RTPSWriter = eprosima::fastrtps::rtps::RTPSWriter;
  using GUID = eprosima::fastrtps::rtps::GUID_t;
  using ReaderCallback = std::function<void(const GUID& reader, bool is_matched)>;

  /// Until the writer's end, which it must outlive. `reader_changed` is called for each reader that
  /// comes or goes.
  RtpsWriterListener(RTPSWriter& writer, ReaderCallback reader_changed);

  /// Does what was put off.
  void release();

 private:
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
  ReaderCallback reader_changed_;
  /// Fast DDS calls `on_reader_discovery` without the writer's mutex, under which it is set.
  std::atomic<eprosima::fastrtps::rtps::WriterListener*> inner_ = nullptr;
  /// Samples of which `inner_` has not been told; guarded by the writer's mutex.
  std::vector<eprosima::fastrtps::rtps::SequenceNumber_t> put_off_;
};

}  // namespace stillmap::dds
