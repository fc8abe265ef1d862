#include "tests/idl/vendor_participant.hpp"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <unistd.h>

#include <atomic>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "idl/dds/service_identity.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::GuidPrefix_t;
using ReturnCode = eprosima::fastrtps::types::ReturnCode_t;

GuidPrefix_t next_prefix(const VendorId& vendor) {
  static std::atomic<std::uint8_t> made = 0;
  GuidPrefix_t prefix;
  const auto process = static_cast<std::uint32_t>(::getpid());
  prefix.value[0] = vendor[0];
  prefix.value[1] = vendor[1];
  std::memcpy(prefix.value + 2, &process, sizeof process);
  prefix.value[11] = ++made;
  return prefix;
}

}  // namespace

VendorParticipant::VendorParticipant(const VendorId& vendor, Listener* listener) {
  talk_over_transports();
  DomainParticipantQos qos;
  qos.wire_protocol().prefix = next_prefix(vendor);
  qos.transport().use_builtin_transports = false;
  const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {"127.0.0.1"};
  qos.transport().user_transports.push_back(udp);
  participant_ = DomainParticipantFactory::get_instance()->create_participant(
      static_cast<DomainId_t>(test_domain_id()), qos, listener, StatusMask::none());
}

VendorParticipant::~VendorParticipant() {
  participant_->delete_contained_entities();
  DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

Topic* VendorParticipant::topic(const std::string& name, const std::string& type_name) {
  if (TopicDescription* const known = participant_->lookup_topicdescription(name)) {
    return static_cast<Topic*>(known);
  }
  serialized_sample_type(type_name).register_type(participant_);
  return participant_->create_topic(name, type_name, TOPIC_QOS_DEFAULT);
}

DataWriter& VendorParticipant::make_writer(const std::string& name, const std::string& type_name,
                                           const TopicQos& qos) {
  Publisher* const publisher = participant_->create_publisher(PUBLISHER_QOS_DEFAULT);
  return *publisher->create_datawriter(topic(name, type_name), writer_qos(qos, DdsOptions{}));
}

DataReader& VendorParticipant::make_reader(const std::string& name, const std::string& type_name,
                                           const TopicQos& qos) {
  Subscriber* const subscriber = participant_->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  return *subscriber->create_datareader(topic(name, type_name), reader_qos(qos, DdsOptions{}));
}

ByteClient::ByteClient(VendorParticipant& peer, const std::string& service,
                       const std::string& type_stem, bool has_reply_reader)
    : requests_(&peer.make_writer(request_topic(service), type_stem + "_Request_", service_qos())) {
  if (has_reply_reader) {
    replies_ = &peer.make_reader(reply_topic(service), type_stem + "_Response_", service_qos());
  }
}

bool ByteClient::wait_for_server() const {
  const auto is_found = [this] {
    PublicationMatchedStatus requests;
    requests_->get_publication_matched_status(requests);
    SubscriptionMatchedStatus replies;
    replies.current_count = 1;
    if (replies_ != nullptr) replies_->get_subscription_matched_status(replies);
    return requests.current_count > 0 && replies.current_count > 0;
  };
  return test::eventually(is_found, discovery_timeout);
}

eprosima::fastrtps::rtps::SampleIdentity ByteClient::call(const SerializedSample& request,
                                                          std::int64_t call_number) {
  eprosima::fastrtps::rtps::WriteParams params;
  if (call_number > 0) {
    params.related_sample_identity() =
        identity_of_call({.client = replies_->guid(), .number = call_number});
  }
  SerializedSample bytes = request;
  requests_->write(&bytes, params);
  return params.sample_identity();
}

std::optional<ByteClient::Reply> ByteClient::receive(std::chrono::milliseconds timeout) {
  Reply reply;
  SampleInfo info;
  const auto has_come = [&] {
    while (replies_->take_next_sample(&reply.bytes, &info) == ReturnCode::RETCODE_OK) {
      if (info.valid_data) return true;
    }
    return false;
  };
  if (!test::eventually(has_come, timeout, 5ms)) return std::nullopt;
  reply.answered = info.related_sample_identity;
  return reply;
}

}  // namespace stillmap::dds
