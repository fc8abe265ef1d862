#include "idl/dds/reader.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace stillmap::dds {

using namespace eprosima::fastdds::dds;
using ReturnCode = eprosima::fastrtps::types::ReturnCode_t;

void ReaderEvents::wait_for_data(const std::stop_token& stop, std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, stop, timeout, [this] { return must_look_; });
  must_look_ = false;
}

void ReaderEvents::wake() {
  {
    const std::scoped_lock lock(mutex_);
    must_look_ = true;
    changed_.notify_all();
  }
  if (wakes_ != nullptr) wakes_->wake();
}

int ReaderEvents::matched_writers() const {
  const std::scoped_lock lock(mutex_);
  return static_cast<int>(writers_.size());
}

bool ReaderEvents::has_writer(const Guid& writer) const {
  const std::scoped_lock lock(mutex_);
  return writers_.contains(writer);
}

int ReaderEvents::writers_of_participant(const Guid& endpoint) const {
  const std::scoped_lock lock(mutex_);
  return static_cast<int>(std::ranges::count(writers_, endpoint.guidPrefix, &Guid::guidPrefix));
}

bool ReaderEvents::wait_for_writer(std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [this] { return !writers_.empty(); });
}

int ReaderEvents::incompatible_writers() const {
  const std::scoped_lock lock(mutex_);
  return incompatible_writers_;
}

void ReaderEvents::on_data_available(DataReader*) { wake(); }

void ReaderEvents::on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) {
  const Guid writer = eprosima::fastrtps::rtps::iHandle2GUID(status.last_publication_handle);
  const std::scoped_lock lock(mutex_);
  if (status.current_count_change > 0) {
    writers_.insert(writer);
  } else if (status.current_count_change < 0) {
    // Of two threads that match at once, the second may be told of no change.
    writers_.erase(writer);
  }
  changed_.notify_all();
}

void ReaderEvents::on_requested_incompatible_qos(DataReader*,
                                                 const RequestedIncompatibleQosStatus& status) {
  {
    const std::scoped_lock lock(mutex_);
    incompatible_writers_ = static_cast<int>(status.total_count);
  }
  wake();
}

UntypedReader::UntypedReader(Participant& participant, const std::string& topic,
                             const TypeSupport& type, const TopicQos& qos)
    : reader_(participant.make_reader(topic, type, qos, &events_)) {
  if (!qos.reliable || !qos.accept_best_effort) return;
  make_best_effort_ = [this, &participant, topic, type, weaker = qos]() mutable {
    weaker.reliable = false;
    weaker.transient_local = false;
    auto made = std::make_unique<BestEffort>(events_);
    made->reader = participant.make_reader(topic, type, weaker, &made->events);
    return made;
  };
}

UntypedReader::UntypedReader(Participant& participant, const std::string& topic,
                             const TypeSupport& type, const TopicQos& qos,
                             const ContentFilter& filter)
    : reader_(participant.make_reader(topic, type, qos, filter, &events_)) {}

bool UntypedReader::take_untyped(void* sample, SampleInfo& info, const std::stop_token& stop,
                                 std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (!stop.stop_requested()) {
    open_best_effort_when_needed();
    if (take_next(sample, info)) return true;
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) return false;
    events_.wait_for_data(stop, left);
  }
  return false;
}

bool UntypedReader::take_next(void* sample, SampleInfo& info) {
  if (take_next_of(*reader_, false, sample, info)) return true;
  return best_effort_ && take_next_of(*best_effort_->reader, true, sample, info);
}

bool UntypedReader::take_next_of(DataReader& reader, bool only_new, void* sample,
                                 SampleInfo& info) {
  constexpr std::size_t max_unreadable = 500;
  RefusedBytes refused;
  while (reader.take_next_sample(sample, &info) == ReturnCode::RETCODE_OK) {
    std::string why = refused.take_reason();
    // Samples without data only say that a key or a writer is gone.
    if (!info.valid_data) continue;
    // A best-effort reader also gets, once more, what reliable writers write.
    if (only_new && events_.has_writer(info.sample_identity.writer_guid())) continue;
    if (why.empty()) return true;
    unreadable_.push_back({info.sample_identity, std::move(why)});
    if (unreadable_.size() > max_unreadable) unreadable_.pop_front();
  }
  return false;
}

std::vector<UnreadableSample> UntypedReader::take_unreadable() {
  std::vector<UnreadableSample> taken(std::make_move_iterator(unreadable_.begin()),
                                      std::make_move_iterator(unreadable_.end()));
  unreadable_.clear();
  return taken;
}

void UntypedReader::open_best_effort_when_needed() {
  if (!make_best_effort_ || best_effort_ || events_.incompatible_writers() == 0) return;
  auto made = make_best_effort_();
  const std::scoped_lock lock(best_effort_mutex_);
  best_effort_ = std::move(made);
}

int UntypedReader::matched_writers() const {
  const std::scoped_lock lock(best_effort_mutex_);
  // Best effort matches every writer.
  const int by_best_effort = best_effort_ ? best_effort_->events.matched_writers() : 0;
  return std::max(by_best_effort, events_.matched_writers());
}

int UntypedReader::incompatible_writers() const {
  const std::scoped_lock lock(best_effort_mutex_);
  if (best_effort_) return best_effort_->events.incompatible_writers();
  return make_best_effort_ ? 0 : events_.incompatible_writers();
}

}  // namespace stillmap::dds
