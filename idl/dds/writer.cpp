#include "idl/dds/writer.hpp"

#include <fastdds/rtps/writer/RTPSWriter.h>

#include <algorithm>
#include <fastdds/dds/publisher/DataWriter.hpp>

#include "idl/dds/dds_error.hpp"
#include "idl/dds/qos.hpp"

namespace stillmap::dds {

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::WriteParams;
using ReturnCode = eprosima::fastrtps::types::ReturnCode_t;

namespace {

// Fast DDS only reads the sample, but says so nowhere.
void* mutable_sample(const void* sample) { return const_cast<void*>(sample); }

}  // namespace

int MatchedReaders::count() const {
  const std::scoped_lock lock(mutex_);
  return static_cast<int>(readers_.size());
}

bool MatchedReaders::wait_for_any(std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [this] { return !readers_.empty(); });
}

bool MatchedReaders::has(const Guid& reader) const {
  const std::scoped_lock lock(mutex_);
  return readers_.contains(reader);
}

int MatchedReaders::count_of_participant(const Guid& endpoint) const {
  const std::scoped_lock lock(mutex_);
  return static_cast<int>(std::ranges::count(readers_, endpoint.guidPrefix, &Guid::guidPrefix));
}

void MatchedReaders::follow(eprosima::fastrtps::rtps::RTPSWriter& writer) {
  const std::scoped_lock lock(mutex_);
  writer_ = &writer;
  std::erase_if(readers_,
                [&](const Guid& reader) { return !writer.matched_reader_is_matched(reader); });
}

void MatchedReaders::update(const Guid& reader, bool is_matched) {
  const std::scoped_lock lock(mutex_);
  if (writer_ != nullptr) is_matched = writer_->matched_reader_is_matched(reader);
  if (is_matched) {
    readers_.insert(reader);
  } else {
    readers_.erase(reader);
  }
  changed_.notify_all();
}

void MatchedReaders::on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) {
  update(eprosima::fastrtps::rtps::iHandle2GUID(status.last_subscription_handle),
         status.current_count_change > 0);
}

UntypedWriter::UntypedWriter(Participant& participant, const std::string& topic,
                             const TypeSupport& type, const TopicQos& qos)
    : topic_(topic), writer_(participant.make_writer(topic, type, qos, &readers_)) {
  auto& rtps_writer = find_rtps_writer(writer_->guid());
  readers_.follow(rtps_writer);
  const auto update = [this](const MatchedReaders::Guid& reader, bool is_matched) {
    readers_.update(reader, is_matched);
  };
  if (qos.reliable) rtps_listener_.emplace(rtps_writer, update);
}

eprosima::fastrtps::rtps::GUID_t UntypedWriter::guid() const { return writer_->guid(); }

bool UntypedWriter::wait_for_acknowledgements(std::chrono::milliseconds timeout) {
  return writer_->wait_for_acknowledgments(to_duration(timeout)) == ReturnCode::RETCODE_OK;
}

void UntypedWriter::forget_written() {
  std::size_t removed = 0;
  writer_->clear_history(&removed);
}

bool UntypedWriter::write_untyped(const void* sample) {
  if (rtps_listener_) rtps_listener_->release();
  const ReturnCode code = writer_->write(mutable_sample(sample), HANDLE_NIL);
  if (code == ReturnCode::RETCODE_OK) return true;
  if (code == ReturnCode::RETCODE_TIMEOUT || code == ReturnCode::RETCODE_OUT_OF_RESOURCES) {
    return false;
  }
  throw DdsError("cannot write topic " + topic_ + ": Fast DDS return code " +
                 std::to_string(code()));
}

bool UntypedWriter::write_untyped(const void* sample, WriteParams& params) {
  if (rtps_listener_) rtps_listener_->release();
  return writer_->write(mutable_sample(sample), params);
}

void UntypedWriter::dispose_untyped(const void* sample) {
  if (rtps_listener_) rtps_listener_->release();
  writer_->dispose(mutable_sample(sample), HANDLE_NIL);
}

void UntypedWriter::unregister_untyped(const void* sample) {
  if (rtps_listener_) rtps_listener_->release();
  writer_->unregister_instance(mutable_sample(sample), HANDLE_NIL);
}

}  // namespace stillmap::dds
