#pragma once

#include <fastdds/rtps/common/WriteParams.h>

#include <chrono>
#include <condition_variable>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "idl/dds/participant.hpp"
#include "idl/dds/rtps_writer.hpp"
#include "idl/dds/type_support.hpp"

namespace stillmap::dds {

/// The readers that a writer has found. Where two are found at once, Fast DDS 2.9 may tell a
/// DataWriterListener of one of them twice and of the other never: once the RTPS writer is known,
/// that is asked, and tells its own listener of each.
class MatchedReaders : public eprosima::fastdds::dds::DataWriterListener {
 public:
  using Guid = eprosima::fastrtps::rtps::GUID_t;

  /// Believes this writer from now on, which must live as long.
  void follow(eprosima::fastrtps::rtps::RTPSWriter& writer);
  /// A reader came, or went.
  void update(const Guid& reader, bool is_matched);

  [[nodiscard]] int count() const;
  [[nodiscard]] bool wait_for_any(std::chrono::milliseconds timeout) const;
  [[nodiscard]] bool has(const Guid& reader) const;
  /// Readers in the process that `endpoint` belongs to.
  [[nodiscard]] int count_of_participant(const Guid& endpoint) const;

 private:
  void on_publication_matched(
      eprosima::fastdds::dds::DataWriter* writer,
      const eprosima::fastdds::dds::PublicationMatchedStatus& status) override;

  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  eprosima::fastrtps::rtps::RTPSWriter* writer_ = nullptr;
  std::set<Guid> readers_;
};

/// What Writer<T> does without knowing T.
class UntypedWriter {
 public:
  UntypedWriter(Participant& participant, const std::string& topic,
                const eprosima::fastdds::dds::TypeSupport& type, const TopicQos& qos);

  [[nodiscard]] const MatchedReaders& readers() const { return readers_; }
  [[nodiscard]] eprosima::fastrtps::rtps::GUID_t guid() const;

  /// True once every matched reliable reader has everything written; false after `timeout`.
  [[nodiscard]] bool wait_for_acknowledgements(std::chrono::milliseconds timeout);

  /// Late joiners get nothing of what was written so far.
  void forget_written();

 protected:
  /// False when there was no room: nothing was written.
  [[nodiscard]] bool write_untyped(const void* sample);
  [[nodiscard]] bool write_untyped(const void* sample,
                                   eprosima::fastrtps::rtps::WriteParams& params);
  void dispose_untyped(const void* sample);
  void unregister_untyped(const void* sample);

 private:
  std::string topic_;
  MatchedReaders readers_;
  std::optional<RtpsWriterListener> rtps_listener_;
  // After what listens to it.
  Participant::WriterHandle writer_;
};

/// Writes samples of a generated type T to one topic. Thread-safe.
template <typename T>
class Writer : public UntypedWriter {
 public:
  /// Throws DdsError. The participant must outlive the writer.
  Writer(Participant& participant, const std::string& topic, const TopicQos& qos)
      : UntypedWriter(participant, topic, type_support<T>(), qos) {}

  /// False when a keep_all history had no room within its `max_blocking`: nothing was written.
  [[nodiscard]] bool write(const T& sample) { return write_untyped(&sample); }

  /// The same with identities for request and reply; `params` gets the sample's own identity.
  [[nodiscard]] bool write(const T& sample, eprosima::fastrtps::rtps::WriteParams& params) {
    return write_untyped(&sample, params);
  }

  /// Tells readers that the instance with the sample's key is gone.
  void dispose(const T& sample) { dispose_untyped(&sample); }

  /// Keeps the instance with the sample's key for late joiners no more; who has it keeps it.
  void unregister(const T& sample) { unregister_untyped(&sample); }
};

}  // namespace stillmap::dds
