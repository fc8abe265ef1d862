#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/dds/participant.hpp"
#include "idl/dds/type_support.hpp"

namespace stillmap::dds {

/// Events of a reader. It only wakes waiting threads: work inside a Fast DDS callback would block
/// every other reader of the process.
class ReaderEvents : public eprosima::fastdds::dds::DataReaderListener {
 public:
  /// `wakes`: events of another reader, whose waiting thread what happens here wakes, too; may be
  /// null, else it must outlive these.
  explicit ReaderEvents(ReaderEvents* wakes = nullptr) : wakes_(wakes) {}

  /// Returns at new data, a writer that does not fit, a requested stop, or after `timeout`.
  void wait_for_data(const std::stop_token& stop, std::chrono::milliseconds timeout);

  using Guid = eprosima::fastrtps::rtps::GUID_t;

  [[nodiscard]] int matched_writers() const;
  [[nodiscard]] bool has_writer(const Guid& writer) const;
  /// Matched writers in the process that `endpoint` belongs to.
  [[nodiscard]] int writers_of_participant(const Guid& endpoint) const;
  [[nodiscard]] bool wait_for_writer(std::chrono::milliseconds timeout) const;
  /// Writers on this topic whose quality of service does not fit ours, as a best-effort writer for
  /// a reliable reader.
  [[nodiscard]] int incompatible_writers() const;

 private:
  void on_data_available(eprosima::fastdds::dds::DataReader* reader) override;
  void on_subscription_matched(
      eprosima::fastdds::dds::DataReader* reader,
      const eprosima::fastdds::dds::SubscriptionMatchedStatus& status) override;
  void on_requested_incompatible_qos(
      eprosima::fastdds::dds::DataReader* reader,
      const eprosima::fastdds::dds::RequestedIncompatibleQosStatus& status) override;

  void wake();

  ReaderEvents* wakes_;
  mutable std::mutex mutex_;
  mutable std::condition_variable_any changed_;
  bool must_look_ = false;
  std::set<Guid> writers_;
  int incompatible_writers_ = 0;
};

/// A sample that was taken and is none of the topic's type.
struct UnreadableSample {
  eprosima::fastrtps::rtps::SampleIdentity identity;
  std::string why;
};

/// What Reader<T> does without knowing T.
class UntypedReader {
 public:
  UntypedReader(Participant& participant, const std::string& topic,
                const eprosima::fastdds::dds::TypeSupport& type, const TopicQos& qos);
  UntypedReader(Participant& participant, const std::string& topic,
                const eprosima::fastdds::dds::TypeSupport& type, const TopicQos& qos,
                const ContentFilter& filter);

  /// Of a reader that accepts best effort, too: those of writers that are read reliably.
  [[nodiscard]] const ReaderEvents& events() const { return events_; }
  /// Writers that are read, in either way.
  [[nodiscard]] int matched_writers() const;
  /// Writers that cannot be read, as ReaderEvents::incompatible_writers.
  [[nodiscard]] int incompatible_writers() const;
  [[nodiscard]] eprosima::fastrtps::rtps::GUID_t guid() const { return reader_->guid(); }

  /// What was passed over since the last call because it could not be read, oldest first; of a
  /// flood, the newest hundreds. By the thread that takes.
  [[nodiscard]] std::vector<UnreadableSample> take_unreadable();

 protected:
  [[nodiscard]] bool take_untyped(void* sample, eprosima::fastdds::dds::SampleInfo& info,
                                  const std::stop_token& stop, std::chrono::milliseconds timeout);

 private:
  /// Reads what the reliable reader does not match.
  struct BestEffort {
    explicit BestEffort(ReaderEvents& reliable) : events(&reliable) {}
    ReaderEvents events;
    Participant::ReaderHandle reader;
  };
  [[nodiscard]] bool take_next(void* sample, eprosima::fastdds::dds::SampleInfo& info);
  /// Of one of both readers; with `only_new`, not what the reliable reader gets, too.
  [[nodiscard]] bool take_next_of(eprosima::fastdds::dds::DataReader& reader, bool only_new,
                                  void* sample, eprosima::fastdds::dds::SampleInfo& info);
  void open_best_effort_when_needed();

  std::function<std::unique_ptr<BestEffort>()> make_best_effort_;
  ReaderEvents events_;
  Participant::ReaderHandle reader_;
  mutable std::mutex best_effort_mutex_;
  std::unique_ptr<BestEffort> best_effort_;
  std::deque<UnreadableSample> unreadable_;
};

/// Reads samples of a generated type T from one topic. One thread takes.
template <typename T>
class Reader : public UntypedReader {
 public:
  /// Throws DdsError. The participant must outlive the reader.
  Reader(Participant& participant, const std::string& topic, const TopicQos& qos)
      : UntypedReader(participant, topic, type_support<T>(), qos) {}
  /// Takes only what the filter lets pass. Throws DdsError, also for a filter that does not fit T.
  Reader(Participant& participant, const std::string& topic, const TopicQos& qos,
         const ContentFilter& filter)
      : UntypedReader(participant, topic, type_support<T>(), qos, filter) {}

  /// Waits for the next sample and moves it into `sample`, whose memory is used again. False after
  /// `timeout` or when a stop was requested.
  [[nodiscard]] bool take(T& sample, eprosima::fastdds::dds::SampleInfo& info,
                          const std::stop_token& stop, std::chrono::milliseconds timeout) {
    return take_untyped(&sample, info, stop, timeout);
  }

  [[nodiscard]] bool take(T& sample, const std::stop_token& stop,
                          std::chrono::milliseconds timeout) {
    eprosima::fastdds::dds::SampleInfo info;
    return take_untyped(&sample, info, stop, timeout);
  }
};

}  // namespace stillmap::dds
