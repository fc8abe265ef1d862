#include "idl/dds/participant.hpp"

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/ContentFilteredTopic.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <mutex>
#include <sstream>
#include <string_view>
#include <typeinfo>

#include "idl/dds/discovery.hpp"
#include "idl/dds/discovery_monitor.hpp"
#include "idl/dds/interfaces.hpp"
#include "idl/dds/qos.hpp"
#include "idl/dds/ros_graph.hpp"
#include "idl/dds/ros_nodes.hpp"
#include "idl/dds/secured_participant.hpp"
#include "idl/dds/security/identity.hpp"
#include "idl/dds/transports.hpp"
#include "idl/dds/type_hash.hpp"

namespace stillmap::dds {
namespace {

using namespace eprosima::fastdds::dds;

// Of a TCP peer that receives nothing, which blocks sending to all others.
constexpr std::chrono::seconds tcp_user_timeout{5};

DomainParticipantQos participant_qos(const DdsOptions& options) {
  DomainParticipantQos qos;
  qos.name(options.node_name.empty() ? options.participant_name : options.node_name);
  // ROS 2 ignores participants without it.
  constexpr std::string_view enclave = "enclave=/;";
  qos.user_data().setValue({enclave.begin(), enclave.end()});
  set_transports(options, qos);
  set_flow_controllers(options, qos);
  auto& builtin = qos.wire_protocol().builtin;
  builtin.readerHistoryMemoryPolicy = builtin.writerHistoryMemoryPolicy =
      eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  // One whose first announcements got lost is found after 1 s, not 3.
  builtin.discovery_config.leaseDuration = to_duration(std::chrono::seconds(options.lease_s));
  builtin.discovery_config.leaseDuration_announcementperiod = to_duration(std::chrono::seconds(1));
  // Announces host, user and process.
  qos.properties().properties().emplace_back(parameter_policy_physical_data_host, "");
  qos.properties().properties().emplace_back(parameter_policy_physical_data_user, "");
  qos.properties().properties().emplace_back(parameter_policy_physical_data_process, "");
  return qos;
}

/// What ROS 2 adds to its endpoints; what it announces in itself has two definitions, and no hash.
std::string user_data_of(const std::string& topic, const TypeSupport& type, bool is_writer) {
  if (topic != ros_discovery_topic) return type_hash_user_data(type.get_type_name());
  return is_writer ? std::string() : any_gids_user_data;
}

template <typename Qos>
Qos with_user_data(Qos qos, const std::string& text) {
  qos.user_data().setValue({text.begin(), text.end()});
  return qos;
}

// Fast DDS would pass samples of one form to readers of the other.
void check_type_support(const DomainParticipant& participant, const TypeSupport& type) {
  const TypeSupport registered = participant.find_type(type.get_type_name());
  if (registered.empty()) return;
  const auto& registered_type = *registered;
  const auto& wanted_type = *type;
  if (typeid(registered_type) != typeid(wanted_type)) {
    throw DdsError("type " + type.get_type_name() +
                   " is used in one process both as messages and as serialized bytes");
  }
}

std::unique_ptr<const Identity> identity_of(const DdsOptions& options) {
  if (options.security.empty()) return nullptr;
  return std::make_unique<const Identity>(load_identity(options.security));
}

}  // namespace

Participant::Participant(const DdsOptions& options)
    : options_(options),
      identity_(identity_of(options)),
      monitor_(std::make_unique<DiscoveryMonitor>(identity_ != nullptr)),
      factory_(DomainParticipantFactory::get_shared_instance()),
      handle_(join()),
      publisher_(handle_->create_publisher(PUBLISHER_QOS_DEFAULT)),
      subscriber_(handle_->create_subscriber(SUBSCRIBER_QOS_DEFAULT)) {
  if (publisher_ == nullptr || subscriber_ == nullptr) throw failure("cannot make endpoints");
  if (!options_.node_name.empty()) {
    // The announcing writer and the reader of the others' announcements are no part of the node, so
    // no graph exists while they are made.
    try {
      nodes_ = std::make_unique<RosNodes>(*this);
    } catch (const NotPermitted&) {
      // Others go without names.
    }
    auto graph = std::make_unique<RosGraph>(*this, *monitor_, handle_->guid());
    graph_ = std::move(graph);
  }
}

Participant::~Participant() {
  // Moved out first: the removal of the graph's own writer must not be announced.
  const auto graph = std::move(graph_);
}

Participant::Handle Participant::join() {
  if (options_.domain_id > max_domain_id) {
    throw failure("domain ids go from 0 to " + std::to_string(max_domain_id));
  }
  if (const std::string fault = unknown_interfaces(options_.interfaces, own_addresses());
      !fault.empty()) {
    throw failure(fault);
  }
  DomainParticipant* const made = [&] {
    // Of two threads of this process, the second must find the ports of the first one's used: no
    // two of a process may have the same number.
    static std::mutex making;
    const std::scoped_lock lock(making);
    return factory_->create_participant(static_cast<DomainId_t>(options_.domain_id), qos(),
                                        monitor_.get(), StatusMask::none());
  }();
  if (made == nullptr) {
    throw failure(
        "Fast DDS made no participant; check that /dev/shm can be written, and that no "
        "other process listens at a port that was given");
  }
  if (options_.transport == NetworkTransport::tcp && options_.listening_port != 0) {
    set_tcp_user_timeout(options_.listening_port, tcp_user_timeout);
  }
  const auto leave = [factory = factory_](DomainParticipant* participant) {
    participant->delete_contained_entities();
    factory->delete_participant(participant);
  };
  return Handle(made, leave);
}

DomainParticipantQos Participant::qos() {
  DomainParticipantQos qos = participant_qos(options_);
  unresolved_peers_ = set_discovery(options_, qos);
  if (identity_) add_security(identity_->folder, qos.properties());
  return qos;
}

std::vector<RemoteParticipant> Participant::remote_participants() const {
  std::vector<RemoteParticipant> participants = monitor_->remote_participants();
  if (nodes_) nodes_->add_to(participants);
  return participants;
}

RemoteParticipant Participant::self() const {
  RemoteParticipant self;
  std::ostringstream guid;
  guid << handle_->guid().guidPrefix;
  self.guid = guid.str();
  self.name = handle_->get_qos().name().to_string();
  // As the others name it.
  if (!options_.node_name.empty()) self.ros_nodes = {"/" + options_.node_name};
  self.addresses = options_.interfaces;
  self.is_on_this_host = true;
  self.uses_shared_memory = has_shared_memory(handle_->get_qos());
  self.is_secured = identity_ != nullptr;
  self.endpoints = monitor_->local_endpoints();
  return self;
}

void Participant::require_permission(const std::string& topic, bool to_write) const {
  if (!identity_) return;
  const Access& access = identity_->access;
  if (to_write ? access.may_publish(topic) : access.may_subscribe(topic)) return;
  std::string text = "refused by the permissions of this domain: identity '" + identity_->name;
  text += "' (role " + identity_->role + ") may not " + (to_write ? "write " : "read ") + topic;
  throw NotPermitted(text);
}

DdsError Participant::failure(const std::string& what) const {
  std::string text = "DDS domain " + std::to_string(options_.domain_id);
  for (const std::string& address : options_.interfaces) text += ", interface " + address;
  if (options_.listening_port != 0) text += ", port " + std::to_string(options_.listening_port);
  return DdsError(text + ": " + what);
}

Topic* Participant::topic(const std::string& name, TypeSupport type) {
  check_type_support(*handle_, type);
  if (const auto known = topics_.find(name); known != topics_.end()) {
    if (known->second->get_type_name() != type.get_type_name()) {
      throw failure("topic " + name + " has type " + known->second->get_type_name() + ", not " +
                    type.get_type_name());
    }
    return known->second;
  }
  type.register_type(handle_.get());
  Topic* const made = handle_->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT);
  if (made == nullptr) throw failure("cannot make topic " + name);
  topics_.emplace(name, made);
  return made;
}

Participant::WriterHandle Participant::make_writer(const std::string& name, TypeSupport type,
                                                   const TopicQos& qos,
                                                   DataWriterListener* listener) {
  require_permission(name, true);
  const std::scoped_lock lock(mutex_);
  DataWriter* const made = publisher_->create_datawriter(
      topic(name, type), with_user_data(writer_qos(qos, options_), user_data_of(name, type, true)),
      listener);
  if (made == nullptr) throw failure("cannot write topic " + name);
  const auto remove = [this](DataWriter* writer) {
    const std::scoped_lock remove_lock(mutex_);
    if (graph_) graph_->remove(writer->guid());
    monitor_->remove_local_endpoint(writer->guid());
    publisher_->delete_datawriter(writer);
  };
  WriterHandle handle(made, remove);
  monitor_->add_local_endpoint(made->guid(), name, type.get_type_name(), type->m_isGetKeyDefined,
                               true, qos);
  if (graph_) graph_->add_writer(made->guid());
  return handle;
}

Participant::ReaderHandle Participant::make_reader(const std::string& name, TypeSupport type,
                                                   const TopicQos& qos,
                                                   DataReaderListener* listener) {
  require_permission(name, false);
  const std::scoped_lock lock(mutex_);
  DataReader* const made = subscriber_->create_datareader(
      topic(name, type), with_user_data(reader_qos(qos, options_), user_data_of(name, type, false)),
      listener);
  if (made == nullptr) throw failure("cannot read topic " + name);
  monitor_->add_local_endpoint(made->guid(), name, type.get_type_name(), type->m_isGetKeyDefined,
                               false, qos);
  return own(*made, nullptr);
}

Participant::ReaderHandle Participant::make_reader(const std::string& name, TypeSupport type,
                                                   const TopicQos& qos, const ContentFilter& filter,
                                                   DataReaderListener* listener) {
  require_permission(name, false);
  const std::scoped_lock lock(mutex_);
  Topic* const whole = topic(name, type);
  ContentFilteredTopic* const filtered =
      handle_->create_contentfilteredtopic(name + "_filtered_" + std::to_string(filters_made_++),
                                           whole, filter.expression, filter.parameters);
  if (filtered == nullptr) throw failure("cannot filter topic " + name + ": " + filter.expression);
  DataReader* const made = subscriber_->create_datareader(
      filtered, with_user_data(reader_qos(qos, options_), user_data_of(name, type, false)),
      listener);
  if (made == nullptr) {
    handle_->delete_contentfilteredtopic(filtered);
    throw failure("cannot read topic " + name);
  }
  monitor_->add_local_endpoint(made->guid(), name, type.get_type_name(), type->m_isGetKeyDefined,
                               false, qos);
  return own(*made, filtered);
}

Participant::ReaderHandle Participant::own(DataReader& made, ContentFilteredTopic* filtered) {
  const auto remove = [this, filtered](DataReader* reader) {
    const std::scoped_lock lock(mutex_);
    if (graph_) graph_->remove(reader->guid());
    monitor_->remove_local_endpoint(reader->guid());
    subscriber_->delete_datareader(reader);
    if (filtered != nullptr) handle_->delete_contentfilteredtopic(filtered);
  };
  ReaderHandle handle(&made, remove);
  if (graph_) graph_->add_reader(made.guid());
  return handle;
}

}  // namespace stillmap::dds
